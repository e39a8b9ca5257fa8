#include "scan/head_test.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include <fmt/format.h>
#include <Eigen/Cholesky>

#include "math/head_point.h"
#include "math/median.h"
#include "scan/detail/rectification.h"

namespace crosstie::scan {
namespace {

constexpr int kColumns = 24;              // parts across the image
constexpr std::size_t kLeastPixels = 50;  // of a part
constexpr int kTerms = 5;
constexpr std::array<const char*, kTerms> kNames = {"pitch", "yaw", "roll", "baseline up", "baseline forward"};

Eigen::Vector3d point_at(const base::Head& head, const Eigen::Vector2d& pixel, double depth_mm) {
  const auto ray = head.left.unproject(pixel);
  return ray ? Eigen::Vector3d(depth_mm / ray->z() * *ray) : Eigen::Vector3d::Zero();
}

/// Derivatives of a sample's distance by the terms [px/rad]; nothing where the sample is not seen.
std::optional<Eigen::Matrix<double, kTerms, 1>> slopes_of(const base::Head& head, const detail::Rectification& frame,
                                                          const CurveSample& sample) {
  constexpr double kStep_rad = 1e-4;
  const auto right_px = head.right.project(head.right_from_left * sample.p_in_rig_mm);
  if (!right_px) return {};
  Eigen::Matrix<double, kTerms, 1> slopes;
  for (int term = 0; term < kTerms; ++term) {
    std::array<double, 2> ends = {};
    for (const int side : {0, 1}) {
      const double step = side == 0 ? -kStep_rad : kStep_rad;
      base::Vector6d delta = base::Vector6d::Zero();
      if (term < 3) {
        delta(term) = step;
      } else {
        // The right camera moves across the baseline: v is minus that, in its own frame.
        delta.tail<3>() = -step * frame.baseline_mm * frame.rectified_from_right.row(term - 2).transpose();
      }
      base::Head moved = head;
      moved.right_from_left = base::perturbed(head.right_from_left, delta);
      const auto moved_frame = detail::rectify(moved.right_from_left);
      const auto off = moved_frame ? detail::off_curve_px(moved, *moved_frame, sample.left_px, *right_px) : std::nullopt;
      if (!off) return {};
      ends[static_cast<std::size_t>(side)] = *off;
    }
    // The distance that the calibration shows where the head truly stands differently is the opposite.
    slopes(term) = -(ends[1] - ends[0]) / (2.0 * kStep_rad);
  }
  return slopes;
}

/// Derivatives of the samples' distances by the head's parameters, in the order of its covariance: a row for each.
Eigen::MatrixXd slopes_by_head(const base::Head& head, const std::vector<CurveSample>& samples) {
  constexpr double kStep = 0.1;  // of a parameter's sigma
  Eigen::MatrixXd slopes = Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(samples.size()), head.cov.cols());
  for (Eigen::Index i = 0; i < head.cov.cols(); ++i) {
    const double step = kStep * std::sqrt(std::max(0.0, head.cov(i, i)));
    if (step == 0.0) continue;
    const std::array<std::optional<base::Head>, 2> ends = {math::moved_head(head, i, -step), math::moved_head(head, i, step)};
    if (!ends[0] || !ends[1]) continue;
    const std::array frames = {detail::rectify(ends[0]->right_from_left), detail::rectify(ends[1]->right_from_left)};
    if (!frames[0] || !frames[1]) continue;
    for (std::size_t row = 0; row < samples.size(); ++row) {
      const auto right_px = head.right.project(head.right_from_left * samples[row].p_in_rig_mm);
      if (!right_px) continue;
      const auto before = detail::off_curve_px(*ends[0], *frames[0], samples[row].left_px, *right_px);
      const auto after = detail::off_curve_px(*ends[1], *frames[1], samples[row].left_px, *right_px);
      if (before && after) slopes(static_cast<Eigen::Index>(row), i) = (*after - *before) / (2.0 * step);
    }
  }
  return slopes;
}

}  // namespace

std::vector<CurveSample> phase_samples(const DepthMap& depths, const base::Head& head) {
  std::vector<CurveSample> samples;
  if (depths.epipolar_px.empty()) return samples;
  const int cell = std::max(1, depths.width / kColumns);
  for (int top = 0; top < depths.height; top += cell) {
    for (int left = 0; left < depths.width; left += cell) {
      std::vector<float> off, depth;
      for (int y = top; y < std::min(depths.height, top + cell); ++y) {
        for (int x = left; x < std::min(depths.width, left + cell); ++x) {
          const auto at = static_cast<std::size_t>(y) * static_cast<std::size_t>(depths.width) + static_cast<std::size_t>(x);
          if (!std::isnan(depths.epipolar_px[at])) off.push_back(depths.epipolar_px[at]);
          if (!std::isnan(depths.depth_mm[at])) depth.push_back(depths.depth_mm[at]);
        }
      }
      if (off.size() < kLeastPixels) continue;
      CurveSample sample;
      sample.left_px = {left + 0.5 * cell, top + 0.5 * cell};
      sample.off_px = math::median(off);
      for (float& value : off) value = std::abs(value - static_cast<float>(sample.off_px));
      // Of a median over the root of the mean: sqrt(pi / 2).
      sample.sigma_px = std::max(1e-4, 1.2533 * 1.4826 * math::median(off) / std::sqrt(static_cast<double>(off.size())));
      const double z = depth.empty() ? 0.0 : math::median(depth);
      samples.push_back(sample);
      samples.back().p_in_rig_mm = {0.0, 0.0, z};  // only its depth yet
    }
  }
  // Parts whose pixels were all left out, since they lie off their curves, have the depth of the others.
  std::vector<double> known;
  for (const CurveSample& sample : samples) {
    if (sample.p_in_rig_mm.z() > 0.0) known.push_back(sample.p_in_rig_mm.z());
  }
  const double usual = known.empty() ? 1000.0 : math::median(known);
  for (CurveSample& sample : samples) {
    const double z = sample.p_in_rig_mm.z() > 0.0 ? sample.p_in_rig_mm.z() : usual;
    sample.p_in_rig_mm = point_at(head, sample.left_px, z);
  }
  std::erase_if(samples, [](const CurveSample& sample) { return sample.p_in_rig_mm.isZero(); });
  return samples;
}

std::vector<CurveSample> marker_samples(const std::vector<base::ScannedMarker>& markers, const base::Head& head) {
  std::vector<CurveSample> samples;
  for (const base::ScannedMarker& marker : markers) {
    const auto pixel = head.left.project(marker.p_in_rig_mm);
    if (pixel && marker.off_curve_sigma_px > 0.0)
      samples.push_back({*pixel, marker.p_in_rig_mm, marker.off_curve_px, marker.off_curve_sigma_px});
  }
  return samples;
}

base::HeadTest test_head(const base::Head& head, const std::vector<CurveSample>& samples, const std::string& source) {
  constexpr std::size_t kLeastSamples = 3;
  constexpr double kFloor_px = 0.02;   // unmodelled in lenses and images, of each sample
  constexpr double kPrior_rad = 0.02;  // of each term: keeps those that the samples do not tell apart from each other small
  constexpr double kGate = 4.0;        // of the scatter about the fit: another marker, another texture
  constexpr int kRounds = 6;
  base::HeadTest test;
  const auto frame = detail::rectify(head.right_from_left);
  if (!frame) return test;
  std::vector<Eigen::Matrix<double, kTerms, 1>> rows;
  std::vector<double> off, weights;
  std::vector<CurveSample> seen;
  for (const CurveSample& sample : samples) {
    const auto slopes = slopes_of(head, *frame, sample);
    if (!slopes) continue;
    seen.push_back(sample);
    rows.push_back(*slopes);
    off.push_back(sample.off_px);
    weights.push_back(1.0 / (sample.sigma_px * sample.sigma_px + kFloor_px * kFloor_px));
  }
  if (rows.size() < kLeastSamples) return test;
  const std::vector<double> stated = weights;
  Eigen::Matrix<double, kTerms, 1> terms = Eigen::Matrix<double, kTerms, 1>::Zero();
  Eigen::Matrix<double, kTerms, kTerms> cofactor;
  double scale = 1.0;
  for (int round = 0; round < kRounds; ++round) {
    Eigen::Matrix<double, kTerms, kTerms> normal =
        Eigen::Matrix<double, kTerms, kTerms>::Identity() / (kPrior_rad * kPrior_rad);
    Eigen::Matrix<double, kTerms, 1> pull = Eigen::Matrix<double, kTerms, 1>::Zero();
    for (std::size_t i = 0; i < rows.size(); ++i) {
      normal += weights[i] * rows[i] * rows[i].transpose();
      pull += weights[i] * off[i] * rows[i];
    }
    const Eigen::LDLT<Eigen::Matrix<double, kTerms, kTerms>> ldlt(normal);
    terms = ldlt.solve(pull);
    cofactor = ldlt.solve(Eigen::Matrix<double, kTerms, kTerms>::Identity());
    std::vector<double> ratios(rows.size());
    for (std::size_t i = 0; i < rows.size(); ++i) ratios[i] = std::abs(off[i] - rows[i].dot(terms)) * std::sqrt(stated[i]);
    std::vector<double> ordered = ratios;
    scale = std::max(1.0, 1.4826 * math::median(ordered));
    for (std::size_t i = 0; i < rows.size(); ++i) weights[i] = ratios[i] < kGate * scale ? stated[i] : 0.0;
  }
  double squares = 0.0, variance = 0.0, weighted = 0.0, count = 0.0;
  std::array<double, kTerms> along = {}, length = {};
  for (std::size_t i = 0; i < rows.size(); ++i) {
    if (weights[i] == 0.0) continue;
    squares += std::pow(rows[i].dot(terms), 2);
    variance += scale * scale * rows[i].dot(cofactor * rows[i]);
    weighted += weights[i] * off[i] * off[i];
    count += 1.0;
    test.places.push_back({seen[i].left_px, seen[i].off_px, seen[i].sigma_px});
    for (std::size_t term = 0; term < kTerms; ++term) {
      along[term] += weights[i] * rows[i](static_cast<Eigen::Index>(term)) * off[i];
      length[term] += weights[i] * std::pow(rows[i](static_cast<Eigen::Index>(term)), 2);
    }
  }
  test.source = source;
  test.samples = static_cast<std::int64_t>(rows.size());
  test.off_px = std::sqrt(squares / count);
  test.sigma_px = std::sqrt(variance / count);
  const Eigen::MatrixXd by_head = slopes_by_head(head, seen);
  for (std::size_t term = 0; term < kTerms; ++term) {
    const double norm = std::max(1e-300, length[term]);
    Eigen::VectorXd by_parameters = Eigen::VectorXd::Zero(by_head.cols());
    double spread = 0.0;
    for (std::size_t i = 0; i < rows.size(); ++i) {
      if (weights[i] == 0.0) continue;
      const double slope = rows[i](static_cast<Eigen::Index>(term));
      by_parameters += weights[i] * slope / norm * by_head.row(static_cast<Eigen::Index>(i)).transpose();
      spread += slope * slope / count;
    }
    base::HeadTest::Term one;
    one.name = kNames[term];
    one.value_rad = along[term] / norm;
    one.sigma_rad = scale / std::sqrt(norm);
    one.calibration_rad = std::sqrt(std::max(0.0, by_parameters.dot(head.cov * by_parameters)));
    one.off_px = std::abs(one.value_rad) * std::sqrt(spread);
    one.explained = weighted > 0.0 ? along[term] * along[term] / norm / weighted : 0.0;
    test.terms.push_back(one);
  }
  return test;
}

base::Result<> judge_head(const base::HeadTest& test, double limit_px) {
  constexpr double kSignificant = 5.0;  // sigmas
  constexpr double kOneTerm = 0.2;      // of the limit
  if (!test.done() || limit_px <= 0.0) return {};
  const auto most = std::max_element(test.terms.begin(), test.terms.end(),
                                     [](const auto& a, const auto& b) { return a.explained < b.explained; });
  if (most == test.terms.end()) return {};
  const double sigma_rad = std::hypot(most->sigma_rad, most->calibration_rad);
  const bool by_term = most->calibration_rad > 0.0 && std::abs(most->value_rad) > kSignificant * sigma_rad &&
                       most->off_px * (1.0 - kSignificant * most->sigma_rad / std::abs(most->value_rad)) > kOneTerm * limit_px;
  if (test.off_px - kSignificant * test.sigma_px <= limit_px && !by_term) return {};
  const std::string allowed = by_term ? fmt::format("its calibration knows that to {:.2f} mrad, and {:.2f} px are allowed",
                                                    1e3 * most->calibration_rad, kOneTerm * limit_px)
                                      : fmt::format("{} px are allowed", limit_px);
  return base::fail(
      base::ErrorCode::kBadInput,
      fmt::format(
          "the calibration is not that of this head as it was: by {} of {} places, images of the same lie {:.2f} +- "
          "{:.2f} px off the epipolar curves, as if the right camera had changed by {} {:+.2f} +- {:.2f} mrad ({:.0f} % "
          "of it); {}; calibrate again, or name the head's own calibration",
          test.source, test.samples, test.off_px, test.sigma_px, most->name, 1e3 * most->value_rad, 1e3 * most->sigma_rad,
          100.0 * most->explained, allowed));
}

}  // namespace crosstie::scan
