#include "base/machine.h"

#include <algorithm>
#include <cmath>
#include <set>

#include <fmt/format.h>
#include <Eigen/Geometry>

namespace crosstie::base {
namespace {

/// The place of a reading in the travel, -1 to 1.
double place(const LinearAxis& axis, double axis_mm) {
  const double half = 0.5 * (axis.to_mm - axis.from_mm);
  return half > 0.0 ? (axis_mm - axis.middle_mm()) / half : 0.0;
}

/// How far beyond the first and the last reading the error motions are still believed, since no stop repeats its reading to the last
/// digit: 0.1 % of the travel, or 3 sigmas of a reading where that is more. Over 0.1 % of it a term of order n changes by
/// 0.1 n (n + 1) % of its coefficient: 1.2 % at order 3.
double slack_mm(const LinearAxis& axis) {
  constexpr double kShareOfTravel = 1e-3;
  constexpr double kReadingSigmas = 3.0;
  return std::max(kShareOfTravel * (axis.to_mm - axis.from_mm), kReadingSigmas * axis.reading_sigma_mm);
}

/// 0, 1, 2 for X, Y, Z or A, B, C.
int component(const std::string& name) {
  const char letter = name.size() > 1 ? name[1] : 'X';
  return letter == 'Y' || letter == 'B' ? 1 : letter == 'Z' || letter == 'C' ? 2 : 0;
}

HeadPose evaluate(const MachineFrame& frame, double axis_mm, bool with_terms, Eigen::MatrixXd* derivatives = nullptr) {
  const LinearAxis& axis = frame.axis;
  const double way = axis_mm - axis.middle_mm();
  const double stretch = 1.0 + 1e-6 * axis.scale_ppm;
  Eigen::Vector3d shift = axis.direction_in_machine * way * stretch;
  Eigen::Vector3d turn = Eigen::Vector3d::Zero();
  const double t = place(axis, axis_mm);
  if (with_terms) {
    for (const ErrorMotion& term : axis.terms) {
      if (!term.in_frame) continue;
      (term.angle ? turn : shift)(component(term.name)) += term.value * legendre(term.order, t);
    }
  }
  const Eigen::Vector3d pivot = axis.pivot_mm + axis.direction_in_machine * axis.middle_mm();
  const Eigen::Quaterniond rotation = rotation_exp(turn);
  const Pose carried{rotation, shift + pivot - rotation * pivot};
  HeadPose head{axis_mm, carried * frame.machine_from_rig_at_middle};

  Eigen::MatrixXd jacobian = Eigen::MatrixXd::Zero(6, frame.cov.rows());
  if (frame.cov.rows() >= 9) {
    jacobian.leftCols<6>() = carried.adjoint();
    jacobian.block<3, 2>(3, 6) = frame.across * (way * stretch);
    jacobian.block<3, 1>(3, 8) = axis.direction_in_machine * (1e-6 * way);
    Eigen::Index column = 9;
    for (const ErrorMotion& term : axis.terms) {
      if (!term.in_frame || column >= frame.cov.cols()) continue;
      if (with_terms) {
        const double value = legendre(term.order, t);
        if (term.angle) {
          Eigen::Vector3d w = Eigen::Vector3d::Zero();
          w(component(term.name)) = value;
          jacobian.block<3, 1>(0, column) = w;
          jacobian.block<3, 1>(3, column) = (pivot + shift).cross(w);
        } else {
          jacobian(3 + component(term.name), column) = value;
        }
      }
      ++column;
    }
    head.cov = jacobian * frame.cov * jacobian.transpose();
  }
  if (derivatives != nullptr) *derivatives = jacobian;
  const double along = axis.reading_sigma_mm * axis.reading_sigma_mm;
  // A stop turns about the head itself and is shifted: the perturbation of the head's place, in the order of base::Pose.
  Matrix6d at_head = Matrix6d::Zero();
  at_head.topLeftCorner<3, 3>() = Eigen::Matrix3d::Identity() * axis.stop_sigma_rad * axis.stop_sigma_rad;
  at_head.bottomRightCorner<3, 3>() = Eigen::Matrix3d::Identity() * axis.stop_sigma_mm * axis.stop_sigma_mm +
                                      along * axis.direction_in_machine * axis.direction_in_machine.transpose();
  Matrix6d about = Matrix6d::Identity();
  about.bottomLeftCorner<3, 3>() = skew(head.machine_from_rig.translation_mm);
  head.stop_cov = about * at_head * about.transpose();
  return head;
}

}  // namespace

double legendre(int order, double t) {
  double before = 1.0;
  double here = t;
  if (order == 0) return before;
  for (int n = 1; n < order; ++n) {
    const double next = ((2 * n + 1) * t * here - n * before) / (n + 1);
    before = here;
    here = next;
  }
  return here;
}

double Cross::growth_sigma() const {
  return std::hypot(cte_per_k * temperature_sigma_c, cte_sigma_per_k * (temperature_c - measured_at_c),
                    cte_sigma_per_k * temperature_sigma_c);
}

Result<> Cross::validate() const {
  std::set<int> known;
  for (const ReferencePoint& marker : markers) {
    if (!marker.xyz_mm.allFinite() || !known.insert(marker.id).second) {
      return fail(ErrorCode::kBadInput, fmt::format("marker {} of the cross is given twice, or is not finite", marker.id));
    }
    if (cov_mm2.size() == 0 && (!marker.cov_mm2 || !marker.cov_mm2->allFinite())) {
      return fail(
          ErrorCode::kBadInput,
          fmt::format("marker {} of the cross has no sigmas; a frame with sigmas needs them: add sigma columns to its list",
                      marker.id));
    }
  }
  known.clear();
  for (const ReferenceSphere& sphere : spheres) {
    if (!sphere.centre_mm.allFinite() || !sphere.cov_mm2.allFinite() || !known.insert(sphere.id).second) {
      return fail(ErrorCode::kBadInput, fmt::format("sphere {} of the cross is given twice, or is not finite", sphere.id));
    }
  }
  const auto size = static_cast<Eigen::Index>(3 * (markers.size() + spheres.size()));
  if (cov_mm2.size() != 0 && (cov_mm2.rows() != size || cov_mm2.cols() != size || !cov_mm2.allFinite() ||
                              (cov_mm2 - cov_mm2.transpose()).cwiseAbs().maxCoeff() > 1e-9 * cov_mm2.cwiseAbs().maxCoeff())) {
    return fail(ErrorCode::kBadInput,
                fmt::format("the covariance of the cross must be symmetric, finite and of size {0} x {0}", size));
  }
  for (const double value : {measured_at_c, temperature_c, temperature_sigma_c, cte_per_k, cte_sigma_per_k}) {
    if (!std::isfinite(value)) return fail(ErrorCode::kBadInput, "temperature or CTE of the cross is not finite");
  }
  if (temperature_sigma_c < 0.0 || cte_sigma_per_k < 0.0 || std::abs(growth()) > 0.01) {
    return fail(
        ErrorCode::kBadInput,
        fmt::format("the cross would grow by {:.3g} of its length; check temperatures [degrees C] and CTE [1/K]", growth()));
  }
  return certificate.validate();
}

double LinearAxis::value(const std::string& name, double axis_mm) const {
  double sum = 0.0;
  for (const ErrorMotion& term : terms) {
    if (term.in_frame && term.name == name) sum += term.value * legendre(term.order, place(*this, axis_mm));
  }
  return sum;
}

Result<HeadPose> MachineFrame::at(double axis_mm) const {
  const double slack = slack_mm(axis);
  if (!(axis_mm >= axis.from_mm - slack && axis_mm <= axis.to_mm + slack)) {
    return fail(
        ErrorCode::kBadInput,
        fmt::format("the head was commissioned from {:.3f} to {:.3f} mm; at {:.3f} mm nothing is known of the axis: commission "
                    "with stations there",
                    axis.from_mm, axis.to_mm, axis_mm));
  }
  return evaluate(*this, axis_mm, true);
}

Eigen::MatrixXd MachineFrame::jacobian(double axis_mm) const {
  Eigen::MatrixXd derivatives;
  (void)evaluate(*this, axis_mm, true, &derivatives);
  return derivatives;
}

std::optional<double> MachineFrame::term_sigma(std::size_t index) const {
  constexpr Eigen::Index kBeforeTerms = 9;  // the pose, two directions, the scale
  if (!axis.terms.at(index).in_frame) return std::nullopt;
  const auto before = std::count_if(axis.terms.begin(), axis.terms.begin() + static_cast<std::ptrdiff_t>(index),
                                    [](const ErrorMotion& term) { return term.in_frame; });
  const Eigen::Index at = kBeforeTerms + static_cast<Eigen::Index>(before);
  return at < cov.rows() ? std::optional(std::sqrt(std::max(0.0, cov(at, at)))) : std::nullopt;
}

HeadPose MachineFrame::straight_at(double axis_mm) const { return evaluate(*this, axis_mm, false); }

std::string_view verdict_name(HeadCheck::Verdict verdict) {
  switch (verdict) {
    case HeadCheck::Verdict::kHolds:
      return "holds";
    case HeadCheck::Verdict::kRig:
      return "rig";
    case HeadCheck::Verdict::kHeadOrCross:
      return "head or cross";
    case HeadCheck::Verdict::kHead:
      return "head";
    case HeadCheck::Verdict::kCross:
      return "cross";
    case HeadCheck::Verdict::kHeadAndCross:
      return "head and cross";
  }
  return "";
}

}  // namespace crosstie::base
