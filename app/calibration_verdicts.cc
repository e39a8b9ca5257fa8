// Values of a calibration held against the limits.

#include <algorithm>
#include <cmath>

#include <fmt/core.h>

#include "app/verdicts.h"

namespace crosstie::app {
namespace {

using base::Verdict;
using base::VerdictLevel;

constexpr double kCoverage = 2.0;  ///< k of the expanded uncertainty U

/// A ratio to what is predicted: beyond the limit (2: 5 % of true predictions) doubtful, beyond 3.29 / 2 of it (0.1 %) refuted.
VerdictLevel judge_ratio(double ratio, double limit) {
  constexpr double kRefuted = 3.29 / 2.0;
  if (ratio <= limit) return VerdictLevel::kOk;
  return ratio <= kRefuted * limit ? VerdictLevel::kWarning : VerdictLevel::kFail;
}

void judge_validation(const base::Calibration& calibration, const JobLimits& limits, std::vector<Verdict>& verdicts) {
  if (!calibration.validation || calibration.validation->halves.size() != 2) return;
  const base::CrossValidation& validation = *calibration.validation;
  const std::string source = "limits.halves_ratio; FAIL above 1.645 times it (0.1 %)";
  for (std::size_t c = 0; c < validation.model_difference_px.size() && c < calibration.cameras.size(); ++c) {
    const double ratio = validation.model_difference_px[c] / validation.model_difference_predicted_px[c];
    verdicts.push_back({fmt::format("halves_ratio {}", calibration.cameras[c].name), ratio, limits.halves_ratio, "", source,
                        judge_ratio(ratio, limits.halves_ratio)});
  }
  if (!calibration.rig) return;
  const double ratio = std::abs(validation.baseline_gap_mm) / validation.baseline_gap_sigma_mm;
  verdicts.push_back(
      {"halves_ratio baseline", ratio, limits.halves_ratio, "", source, judge_ratio(ratio, limits.halves_ratio)});
}

}  // namespace

std::vector<Verdict> judge(const base::CalibrationChange& change, const JobLimits& limits) {
  std::vector<Verdict> verdicts;
  for (const base::CalibrationChange::Lens& lens : change.cameras) {
    if (!lens.difference || !lens.difference->test) continue;
    const base::DifferenceTest& test = *lens.difference->test;
    verdicts.push_back({fmt::format("change_px {}", lens.name), lens.difference->rms_px, test.limit_px, "px",
                        fmt::format("the covariances of both calibrations, level {}: never more than a WARNING", test.level),
                        test.exceeded() ? VerdictLevel::kWarning : VerdictLevel::kOk});
  }
  if (!change.rig) return verdicts;
  double largest = 0.0;
  for (Eigen::Index i = 0; i < 6; ++i) {
    if (change.rig->sigma(i) > 0.0) largest = std::max(largest, std::abs(change.rig->change(i)) / change.rig->sigma(i));
  }
  verdicts.push_back({"change_w rig", largest, limits.rig_change_w, "",
                      "limits.rig_change_w: 0.1 % two-sided of the largest of six; never more than a WARNING",
                      largest > limits.rig_change_w ? VerdictLevel::kWarning : VerdictLevel::kOk});
  return verdicts;
}

std::vector<Verdict> judge(const base::Calibration& calibration, const JobLimits& limits) {
  std::vector<Verdict> verdicts;
  for (const base::CalibratedCamera& camera : calibration.cameras) {
    if (!(camera.rms_heldout_px > 0.0)) continue;
    // The relative sigma of a root mean square of n independent values is 1 / sqrt(2 n); a corner has two.
    const double sigma = camera.rms_heldout_px / std::sqrt(4.0 * std::max(1, camera.corners));
    verdicts.push_back({fmt::format("heldout_rms_px {}", camera.name), camera.rms_heldout_px, limits.heldout_rms_px, "px",
                        "limits.heldout_rms_px: public boards reach 0.02 to 0.05 px",
                        base::judge_upper_limit(camera.rms_heldout_px, limits.heldout_rms_px, kCoverage * sigma)});
  }
  judge_validation(calibration, limits, verdicts);
  for (const base::CalibratedCamera& camera : calibration.cameras) {
    const double empty = 1.0 - camera.area.inner_share();
    verdicts.push_back({fmt::format("area_not_covered {}", camera.name), empty, limits.area_not_covered, "",
                        "limits.area_not_covered: never more than a WARNING",
                        empty <= limits.area_not_covered ? VerdictLevel::kOk : VerdictLevel::kWarning});
  }
  const base::CalibratedBoard& board = calibration.board;
  if (board.board.free && board.prior_ratio > 0.0) {
    // Of a sum of n squares over n: sqrt(2 / n).
    const double sigma = board.prior_ratio * std::sqrt(2.0 / (3.0 * std::max(1, board.board.count())));
    verdicts.push_back({"prior_ratio", board.prior_ratio, limits.prior_ratio, "",
                        "limits.prior_ratio: 1 where the prior is true",
                        base::judge_upper_limit(board.prior_ratio, limits.prior_ratio, kCoverage * sigma)});
  }
  if (limits.baseline_sigma_mm && calibration.rig) {
    const double relative = calibration.redundancy > 0 ? 1.0 / std::sqrt(2.0 * calibration.redundancy) : 0.0;
    const double sigma_mm = calibration.rig->baseline_sigma_mm;
    verdicts.push_back({"baseline_sigma_mm", sigma_mm, *limits.baseline_sigma_mm, "mm", "limits.baseline_sigma_mm of the job",
                        base::judge_upper_limit(sigma_mm, *limits.baseline_sigma_mm, kCoverage * relative * sigma_mm)});
  }
  return verdicts;
}

}  // namespace crosstie::app
