#include "app/verdicts.h"

#include <algorithm>
#include <cmath>
#include <string>

namespace crosstie::app {
namespace {

using base::Verdict;

constexpr double kCoverage = 2.0;  ///< k of the expanded uncertainty U

struct Judged {
  const char* name;
  const char* unit;
  const char* source;
};

Verdict upper_limit(const Judged& what, double value, double limit, double sigma) {
  return {what.name, value, limit, what.unit, what.source, base::judge_upper_limit(value, limit, kCoverage * sigma)};
}

}  // namespace

std::vector<Verdict> judge(const base::AdjustedNetwork& network, const JobLimits& limits) {
  std::vector<Verdict> verdicts;
  // The relative sigma of a standard deviation from r degrees of freedom is 1 / sqrt(2 r).
  const double relative = network.redundancy > 0 ? 1.0 / std::sqrt(2.0 * network.redundancy) : 0.0;
  verdicts.push_back(upper_limit({"sigma0_px", "px", "limits.sigma0_px: circular targets are measured far better than 0.1 px"},
                                 network.sigma0_px, limits.sigma0_px, relative * network.sigma0_px));
  double largest_w = 0.0;
  bool judged_bars = false;
  for (const base::AdjustedScaleBar& bar : network.scale_bars) {
    if (bar.bar.role == base::ScaleBarRole::kDefines) continue;
    judged_bars = true;
    largest_w = std::max(largest_w, std::abs(bar.w));
  }
  if (judged_bars) {
    verdicts.push_back(upper_limit({"scale_bar_w", "", "limits.scale_bar_w: 0.1 % two-sided of a normal distribution"},
                                   largest_w, limits.scale_bar_w, 0.0));
  }
  if (!network.control.empty()) {
    double largest = 0.0;
    for (const base::AdjustedControl& point : network.control) largest = std::max(largest, point.w);
    verdicts.push_back(upper_limit({"control_w", "", "limits.control_w: 0.1 % two-sided of a normal distribution"}, largest,
                                   limits.control_w, 0.0));
  }
  if (limits.point_sigma_mm) {
    double largest = 0.0;
    for (const base::AdjustedPoint& point : network.points) {
      largest = std::max(largest, std::sqrt(point.cov_mm2.diagonal().maxCoeff()));
    }
    verdicts.push_back(upper_limit({"point_sigma_mm", "mm", "limits.point_sigma_mm of the job"}, largest,
                                   *limits.point_sigma_mm, relative * largest));
  }
  return verdicts;
}

std::vector<Verdict> judge(const base::Verification& verification, const JobLimits& limits) {
  std::vector<Verdict> verdicts;
  double sum = 0.0;
  double sigma_of_max = 0.0;
  double largest = 0.0;
  std::size_t used = 0;
  for (const base::Deviation& point : verification.points) {
    if (!point.used) continue;
    ++used;
    sum += point.sigma_mm.squaredNorm();
    if (point.deviation_mm.norm() > largest) {
      largest = point.deviation_mm.norm();
      sigma_of_max = point.sigma_mm.norm();
    }
  }
  if (limits.deviation_rms_mm && used > 0) {
    const double sigma = std::sqrt(sum) / static_cast<double>(used);  // of a root mean square of `used` vectors, to first order
    verdicts.push_back(upper_limit({"deviation_rms_mm", "mm", "limits.deviation_rms_mm of the job"}, verification.rms3d_mm,
                                   *limits.deviation_rms_mm, sigma));
  }
  if (limits.deviation_max_mm && used > 0) {
    verdicts.push_back(upper_limit({"deviation_max_mm", "mm", "limits.deviation_max_mm of the job"}, verification.max_mm,
                                   *limits.deviation_max_mm, sigma_of_max));
  }
  if (limits.length_mpe_a_mm && !verification.lengths.empty()) {
    const auto worst = std::max_element(verification.lengths.begin(), verification.lengths.end(),
                                        [](const base::LengthDeviation& a, const base::LengthDeviation& b) {
                                          return std::abs(a.measured_mm - a.nominal_mm) / a.mpe_mm <
                                                 std::abs(b.measured_mm - b.nominal_mm) / b.mpe_mm;
                                        });
    verdicts.push_back(upper_limit(
        {"length_error_mm", "mm", "limits.length_mpe_a_mm and length_mpe_k of the job (the length nearest to its MPE)"},
        std::abs(worst->measured_mm - worst->nominal_mm), worst->mpe_mm, worst->sigma_mm));
  }
  return verdicts;
}

Outcome outcome_of(const std::vector<Verdict>& verdicts) {
  const bool failed = std::any_of(verdicts.begin(), verdicts.end(),
                                  [](const Verdict& verdict) { return verdict.level == base::VerdictLevel::kFail; });
  return failed ? Outcome::kVerdictFailed : Outcome::kOk;
}

}  // namespace crosstie::app
