#include "verify/compare.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "math/rigid_alignment.h"
#include "verify/detail/partners.h"
#include "verify/detail/plausibility.h"
#include "verify/detail/predicted.h"
#include "verify/detail/test_lengths.h"

namespace crosstie::verify {
namespace {

using base::Deviation;
using base::ErrorCode;
using base::fail;
using base::Result;
using base::Verification;
using detail::FittedFrame;
using detail::Partners;
using detail::Predicted;
using Eigen::Vector3d;

constexpr double kPartsPerMillion = 1e6;

std::string fit_name(Fit fit) { return fit == Fit::kRigid ? "rigid" : fit == Fit::kSimilarity ? "similarity" : "none"; }

bool any_covariance(const Partners& partners) {
  return std::find(partners.has_covariance.begin(), partners.has_covariance.end(), true) != partners.has_covariance.end();
}

/// In a free network whose datum is spread over the fitted points, the frame is defined by these very points: its parameters
/// then have no variance, and what is computed for them is rounding, recognised against the variance of independent points.
void drop_rounding(Eigen::Matrix<double, 7, 7>& cov, const Eigen::Matrix<double, 7, 7>& independent) {
  constexpr double kRounding = 1e-8;  // of a variance
  for (Eigen::Index i = 0; i < 7; ++i) {
    if (cov(i, i) > kRounding * independent(i, i)) continue;
    cov.row(i).setZero();
    cov.col(i).setZero();
  }
}

/// The fit, with its covariance from the sigmas of both sides, or from the scatter where there are none.
struct Fitted {
  FittedFrame frame;
  Predicted predicted;
};

Result<Fitted> fit_frame(const Partners& partners, int parameters, const CompareOptions& options) {
  Fitted fitted;
  fitted.frame.parameters = parameters;
  math::Alignment alignment;
  if (parameters > 0) {
    auto result = math::align(partners.used_pairs(), {.with_scale = parameters == 7, .weighted = options.weighted});
    if (!result) return fail(std::move(result));
    alignment = std::move(*result);
    fitted.frame.reference_from_measured = alignment.a_from_b;
    fitted.frame.scale = alignment.scale;
    fitted.frame.weighted = alignment.weighted;
  }
  fitted.predicted = detail::predict(partners, fitted.frame, options.measured_cov_mm2);
  if (options.measured_cov_mm2.size() > 0) {
    drop_rounding(fitted.predicted.parameter_cov, detail::predict(partners, fitted.frame, {}).parameter_cov);
  }
  if (!any_covariance(partners)) fitted.predicted.parameter_cov = alignment.covariance;
  return fitted;
}

std::vector<Deviation> deviations(const Partners& partners, const Fitted& fitted, std::size_t first) {
  std::vector<Deviation> result;
  const base::Pose& pose = fitted.frame.reference_from_measured;
  for (std::size_t i = first; i < partners.pairs.size(); ++i) {
    Deviation deviation;
    deviation.id = partners.ids[i];
    deviation.reference_id = partners.reference_ids[i];
    deviation.reference_mm = partners.pairs[i].a_mm;
    deviation.measured_mm = fitted.frame.scale * (pose.rotation * partners.pairs[i].b_mm) + pose.translation_mm;
    deviation.deviation_mm = deviation.measured_mm - deviation.reference_mm;
    deviation.untransformed_mm = partners.pairs[i].b_mm - partners.pairs[i].a_mm;
    if (partners.has_covariance[i]) {
      deviation.sigma_mm = fitted.predicted.deviation_cov_mm2[i].diagonal().cwiseMax(0.0).cwiseSqrt();
    }
    deviation.used = partners.used[i];
    result.push_back(deviation);
  }
  return result;
}

/// The figures that Verification and PositionComparison share.
template <typename Comparison>
void add_statistics(const std::vector<Deviation>& points, bool used, Comparison& result) {
  Vector3d square_sum = Vector3d::Zero();
  double normalised = 0.0;
  int count = 0;
  int with_sigma = 0;
  for (const Deviation& deviation : points) {
    if (deviation.used != used) continue;
    ++count;
    square_sum += deviation.deviation_mm.cwiseAbs2();
    result.max_mm = std::max(result.max_mm, deviation.deviation_mm.norm());
    for (int axis = 0; axis < 3; ++axis) {
      if (deviation.sigma_mm(axis) <= 0.0) continue;
      normalised += std::pow(deviation.deviation_mm(axis) / deviation.sigma_mm(axis), 2);
      ++with_sigma;
    }
  }
  if (count == 0) return;
  result.rms_mm = (square_sum / count).cwiseSqrt();
  result.rms3d_mm = std::sqrt(square_sum.sum() / count);
  if (with_sigma > 0) result.normalised_rms = std::sqrt(normalised / with_sigma);
}

/// Uncoded targets, with the fit as it stands.
void compare_by_position(const base::PointList& measured, const base::PointList& reference, const CompareOptions& options,
                         const Fitted& fitted, Partners& partners, Verification& result) {
  const std::size_t first = partners.pairs.size();
  result.by_position.gate_mm = options.position_gate_mm;
  result.by_position.unpaired = detail::add_by_position(measured, reference, fitted.frame.reference_from_measured,
                                                        fitted.frame.scale, options.position_gate_mm, partners);
  result.only_reference = partners.only_reference;
  if (partners.pairs.size() == first) return;
  for (std::size_t i = first; i < partners.pairs.size(); ++i) {
    if (options.measured_cov_mm2.size() == 0) break;
    const auto row = 3 * static_cast<Eigen::Index>(partners.measured_index[i]);
    partners.pairs[i].cov_b_mm2 = options.measured_cov_mm2.block<3, 3>(row, row);
    partners.has_covariance[i] = true;
  }
  Fitted all = fitted;
  all.predicted = detail::predict(partners, fitted.frame, options.measured_cov_mm2);
  result.by_position.points = deviations(partners, all, first);
  std::sort(result.by_position.points.begin(), result.by_position.points.end(),
            [](const Deviation& a, const Deviation& b) { return a.id < b.id; });
  add_statistics(result.by_position.points, false, result.by_position);
}

void add_length_statistics(Verification& result) {
  double length_square_sum = 0.0;
  for (const base::LengthDeviation& length : result.lengths) {
    const double error_mm = length.measured_mm - length.nominal_mm;
    length_square_sum += error_mm * error_mm;
    result.length_max_mm = std::max(result.length_max_mm, std::abs(error_mm));
  }
  if (!result.lengths.empty()) result.length_rms_mm = std::sqrt(length_square_sum / static_cast<double>(result.lengths.size()));
}

}  // namespace

Result<> CompareOptions::validate() const {
  if (!std::isfinite(mpe.a_mm) || mpe.a_mm < 0.0) {
    return fail(ErrorCode::kUsage, fmt::format("mpe a_mm is {}; it must be 0 or more", mpe.a_mm));
  }
  if (!(mpe.k > 0.0)) return fail(ErrorCode::kUsage, fmt::format("mpe k is {}; it must be positive", mpe.k));
  if (!(position_gate_mm > 0.0)) {
    return fail(ErrorCode::kUsage, fmt::format("position_gate_mm is {}; it must be positive", position_gate_mm));
  }
  if (max_lengths < 0) return fail(ErrorCode::kUsage, fmt::format("max_lengths is {}; it must be 0 or more", max_lengths));
  return {};
}

Result<Verification> compare(const base::PointList& measured, const base::PointList& reference, const CompareOptions& options) {
  if (auto valid = options.validate(); !valid) return fail(std::move(valid));
  const auto coordinates = 3 * static_cast<Eigen::Index>(measured.points.size());
  if (options.measured_cov_mm2.size() > 0 &&
      (options.measured_cov_mm2.rows() != coordinates || options.measured_cov_mm2.cols() != coordinates ||
       !options.measured_cov_mm2.allFinite())) {
    return fail(
        ErrorCode::kBadInput,
        fmt::format("the covariance of the measurement is {} x {}, its {} points need {} finite rows and columns",
                    options.measured_cov_mm2.rows(), options.measured_cov_mm2.cols(), measured.points.size(), coordinates));
  }
  auto partners = detail::match_by_id(measured, reference, options.exclude_ids);
  if (!partners) return fail(std::move(partners));
  if (options.measured_cov_mm2.size() > 0) {
    for (std::size_t i = 0; i < partners->pairs.size(); ++i) {
      const auto row = 3 * static_cast<Eigen::Index>(partners->measured_index[i]);
      partners->pairs[i].cov_b_mm2 = options.measured_cov_mm2.block<3, 3>(row, row);
      partners->has_covariance[i] = true;
    }
  }
  const auto used = static_cast<std::size_t>(std::count(partners->used.begin(), partners->used.end(), true));
  if (options.fit != Fit::kNone && used < 3) {
    return fail(ErrorCode::kNoUniqueSolution,
                fmt::format("measurement and reference share {} usable point{}; a best fit needs 3 that are not on one line",
                            used, used == 1 ? "" : "s"));
  }
  auto warnings = detail::check_plausibility(*partners, options.fit);
  if (!warnings) return fail(std::move(warnings));

  const int parameters = options.fit == Fit::kRigid ? 6 : options.fit == Fit::kSimilarity ? 7 : 0;
  auto fitted = fit_frame(*partners, parameters, options);
  if (!fitted) return fail(std::move(fitted));

  Verification result;
  result.fit = fit_name(options.fit);
  result.reference_from_measured = fitted->frame.reference_from_measured;
  result.pose_cov = fitted->predicted.parameter_cov.topLeftCorner<6, 6>();
  result.only_measured = partners->only_measured;
  result.only_reference = partners->only_reference;
  result.warnings = std::move(*warnings);
  if (!any_covariance(*partners)) {
    result.warnings.push_back(
        {"no_sigma", "", "neither list gives sigmas: deviations are not held against what was predicted"});
  }
  const auto with_scale = used < 3 ? Result<Fitted>(fail(ErrorCode::kNoUniqueSolution, "")) : fit_frame(*partners, 7, options);
  if (with_scale) {
    result.scale_ppm = (with_scale->frame.scale - 1.0) * kPartsPerMillion;
    result.scale_sigma_ppm = std::sqrt(std::max(0.0, with_scale->predicted.parameter_cov(6, 6))) * kPartsPerMillion;
  }
  result.points = deviations(*partners, *fitted, 0);
  result.lengths = detail::test_lengths(*partners, fitted->frame.scale, options);
  add_statistics(result.points, true, result);
  add_length_statistics(result);
  compare_by_position(measured, reference, options, *fitted, *partners, result);
  return result;
}

}  // namespace crosstie::verify
