#include <algorithm>
#include <cmath>
#include <numbers>

#include <fmt/format.h>
#include <Eigen/Geometry>

#include "report/detail/html.h"
#include "report/detail/number.h"
#include "report/detail/scene.h"
#include "report/detail/verification_sections.h"

namespace crosstie::report::detail {
namespace {

using base::Deviation;
using base::LengthDeviation;
using base::Verification;

constexpr double kDegrees = 180.0 / std::numbers::pi;

std::string fit_sentence(const Verification& verification) {
  const auto used =
      std::count_if(verification.points.begin(), verification.points.end(), [](const Deviation& d) { return d.used; });
  if (verification.fit == "rigid") {
    return fmt::format(
        "Rigid best fit over {} points: 6 degrees of freedom (3 rotations, 3 translations) are taken from 3 \u00d7 {} = {} "
        "coordinates; the scale of the measurement is under test.",
        used, used, 3 * used);
  }
  if (verification.fit == "similarity") {
    return fmt::format(
        "Similarity fit over {} points: 7 degrees of freedom, the scale among them; lengths therefore say nothing of the "
        "measurement's scale.",
        used);
  }
  return fmt::format("No fit: the coordinates of {} points are compared as they stand (0 degrees of freedom).", used);
}

/// Rotations about the fixed axes x, then y, then z.
Eigen::Vector3d euler_xyz(const Eigen::Matrix3d& r) {
  const double y = std::asin(std::clamp(-r(2, 0), -1.0, 1.0));
  if (std::abs(r(2, 0)) > 1.0 - 1e-12) return {0.0, y, std::atan2(-r(0, 1), r(1, 1))};
  return {std::atan2(r(2, 1), r(2, 2)), y, std::atan2(r(1, 0), r(0, 0))};
}

}  // namespace

std::vector<KeyFigure> verification_key_figures(const Verification& verification) {
  const auto unit_of = [](double length_mm) {
    const std::vector<double> one = {length_mm};
    return unit_for_lengths(one);
  };
  const LengthUnit unit = unit_of(verification.rms_mm.maxCoeff());
  const auto shown = [](double length_mm, const LengthUnit& in) {
    return significant(length_mm * in.per_mm, 3) + "\u00a0" + in.name;
  };
  Eigen::Vector3d variance = Eigen::Vector3d::Zero();
  double used = 0.0;
  const Deviation* worst = nullptr;
  for (const Deviation& deviation : verification.points) {
    if (!deviation.used) continue;
    used += 1.0;
    variance += deviation.sigma_mm.cwiseAbs2();
    if (worst == nullptr || deviation.deviation_mm.norm() > worst->deviation_mm.norm()) worst = &deviation;
  }
  const Eigen::Vector3d sigma = (variance / std::max(1.0, used)).cwiseSqrt();
  std::vector<KeyFigure> figures;
  figures.push_back({"Deviation, rms x / y / z",
                     fmt::format("{} / {} / {} {}", significant(unit.per_mm * verification.rms_mm.x(), 3),
                                 significant(unit.per_mm * verification.rms_mm.y(), 3),
                                 significant(unit.per_mm * verification.rms_mm.z(), 3), unit.name),
                     sigma.isZero(0.0)
                         ? std::string("no sigma was given")
                         : fmt::format("predicted sigma {} / {} / {}, U (k\u00a0=\u00a02) {} / {} / {} {}",
                                       significant(unit.per_mm * sigma.x(), 2), significant(unit.per_mm * sigma.y(), 2),
                                       significant(unit.per_mm * sigma.z(), 2), significant(2.0 * unit.per_mm * sigma.x(), 2),
                                       significant(2.0 * unit.per_mm * sigma.y(), 2),
                                       significant(2.0 * unit.per_mm * sigma.z(), 2), unit.name),
                     ""});
  figures.push_back({"3D deviation, rms", shown(verification.rms3d_mm, unit_of(verification.rms3d_mm)),
                     fmt::format("{} points, {} in the fit", verification.points.size(), static_cast<int>(used)), ""});
  if (worst != nullptr) {
    const double predicted = worst->sigma_mm.norm();
    figures.push_back(
        {"Largest 3D deviation", fmt::format("{} at {}", shown(verification.max_mm, unit_of(verification.max_mm)), worst->id),
         predicted > 0.0
             ? fmt::format("predicted sigma there {}, {}", shown(predicted, unit), expanded(predicted * unit.per_mm, unit.name))
             : "",
         ""});
  }
  if (verification.normalised_rms > 0.0) {
    figures.push_back({"Deviation over predicted sigma, rms", significant(verification.normalised_rms, 3),
                       "expected 1 where all sigmas are true", ""});
  }
  const bool fitted_scale = verification.fit == "similarity";
  figures.push_back({fitted_scale ? "Scale, fitted" : "Scale, as a check",
                     with_sigma(verification.scale_ppm, verification.scale_sigma_ppm, "ppm"),
                     expanded(verification.scale_sigma_ppm, "ppm"), ""});
  if (!verification.lengths.empty()) {
    std::size_t outside = 0;
    for (const LengthDeviation& length : verification.lengths) {
      if (std::abs(length.measured_mm - length.nominal_mm) > length.mpe_mm) ++outside;
    }
    figures.push_back({"Length errors, rms / max",
                       fmt::format("{} / {}", shown(verification.length_rms_mm, unit_of(verification.length_rms_mm)),
                                   shown(verification.length_max_mm, unit_of(verification.length_max_mm))),
                       fmt::format("{} of {} lengths beyond the permissible error", outside, verification.lengths.size()),
                       outside > 0 ? "fail" : ""});
  }
  return figures;
}

std::string verification_fit_section(const Verification& verification) {
  const base::Pose& pose = verification.reference_from_measured;
  const Eigen::Matrix3d rotation = pose.rotation.toRotationMatrix();
  const Eigen::Vector3d euler = euler_xyz(rotation) * kDegrees;
  const auto sigma = [&](int i) { return std::sqrt(std::max(0.0, verification.pose_cov(i, i))); };
  std::vector<std::pair<std::string, std::string>> entries;
  for (int axis = 0; axis < 3; ++axis) {
    entries.emplace_back(fmt::format("Translation {}", "xyz"[axis]),
                         with_sigma(pose.translation_mm(axis), sigma(3 + axis), "mm"));
  }
  for (int axis = 0; axis < 3; ++axis) {
    entries.emplace_back(fmt::format("Rotation about {}", "xyz"[axis]), fixed(euler(axis), 6) + "\u00b0");
  }
  bool all_known = true;
  for (int axis = 0; axis < 3; ++axis) {
    all_known = all_known && sigma(axis) > 0.0 && sigma(3 + axis) > 0.0;
    if (!(sigma(axis) > 0.0)) continue;
    entries.emplace_back(
        fmt::format("Sigma of rotation about {}", "xyz"[axis]),
        fmt::format("{} \u00b5rad ({})", significant(1e6 * sigma(axis), 2), expanded(1e6 * sigma(axis), "\u00b5rad")));
  }
  entries.emplace_back("Quaternion w x y z",
                       fmt::format("{} {} {} {}", fixed(pose.rotation.w(), 9), fixed(pose.rotation.x(), 9),
                                   fixed(pose.rotation.y(), 9), fixed(pose.rotation.z(), 9)));
  entries.emplace_back(
      verification.fit == "similarity" ? "Scale \u2212 1, fitted" : "Scale \u2212 1, of a similarity fit (check)",
      with_sigma(verification.scale_ppm, verification.scale_sigma_ppm, "ppm"));
  std::string matrix;
  const Eigen::Matrix4d full = pose.matrix();
  for (int row = 0; row < 4; ++row) {
    matrix += fmt::format("{:>14} {:>14} {:>14} {:>16}\n", fixed(full(row, 0), 9), fixed(full(row, 1), 9),
                          fixed(full(row, 2), 9), fixed(full(row, 3), 6));
  }
  const std::string no_sigma =
      all_known || verification.fit == "none"
          ? ""
          : paragraph(
                "No uncertainty of the frame is stated where none is shown: either no sigma was given, or the measurement is a "
                "free network whose frame these very points define.",
                "muted");
  return paragraph(fit_sentence(verification)) + definition_list(entries) + no_sigma +
         paragraph(
             "Rotations are about the fixed axes x, then y, then z (R = Rz Ry Rx). reference_from_measured, translation in mm:",
             "muted") +
         "<pre tabindex=\"0\">" + escape(matrix) + "</pre>\n";
}

std::string verification_partners_section(const Verification& verification) {
  const auto joined = [](const std::vector<int>& ids) {
    std::string text;
    for (std::size_t i = 0; i < ids.size(); ++i) {
      if (i >= 200) return text + fmt::format(", \u2026 ({} in all)", ids.size());
      text += (i > 0 ? ", " : "") + std::to_string(ids[i]);
    }
    return text.empty() ? std::string("none") : text;
  };
  std::vector<int> excluded;
  for (const Deviation& deviation : verification.points) {
    if (!deviation.used) excluded.push_back(deviation.id);
  }
  return paragraph("Only measured: " + joined(verification.only_measured) + ".") +
         paragraph("Only in the reference: " + joined(verification.only_reference) + ".") +
         paragraph("In both, but left out of fit and statistics: " + joined(excluded) + ".") +
         (verification.by_position.unpaired.empty()
              ? std::string()
              : paragraph("Uncoded, with no point of the reference near: " + joined(verification.by_position.unpaired) + "."));
}

}  // namespace crosstie::report::detail
