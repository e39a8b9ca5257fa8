// Values of a commissioning held against the limits.

#include <algorithm>
#include <cmath>

#include "app/commissioning_view.h"
#include "app/verdicts.h"

namespace crosstie::app {
namespace {

using base::Verdict;

constexpr double kCoverage = 2.0;  ///< k of the expanded uncertainty U

/// Largest change of right_from_left over the sigma that a prior's adjustment leaves it: of the difference of the variances.
double largest_rig_change(const base::Commissioning& result, const base::Head& calibrated) {
  if (calibrated.cov.size() == 0 || result.head.cov.size() == 0) return 0.0;
  const base::Vector6d change = base::difference(calibrated.right_from_left, result.head.right_from_left);
  const base::Matrix6d before = calibrated.cov.bottomRightCorner<6, 6>();
  const base::Matrix6d after = result.head.cov.bottomRightCorner<6, 6>();
  double largest = 0.0;
  for (Eigen::Index i = 0; i < 6; ++i) {
    const double variance = before(i, i) - after(i, i);
    // Where the commissioning hardly adds anything, neither does it change anything.
    if (variance > 1e-4 * before(i, i)) largest = std::max(largest, std::abs(change(i)) / std::sqrt(variance));
  }
  return largest;
}

}  // namespace

std::vector<Verdict> judge(const base::Commissioning& result, const base::Head& calibrated, const JobLimits& limits) {
  std::vector<Verdict> verdicts;
  const double relative = result.redundancy > 0 ? 1.0 / std::sqrt(2.0 * result.redundancy) : 0.0;
  const auto add = [&](const char* name, double value, double limit, const char* unit, const char* source, double sigma) {
    verdicts.push_back({name, value, limit, unit, source, base::judge_upper_limit(value, limit, kCoverage * sigma)});
  };
  add("sigma0_px", result.sigma0_px, limits.sigma0_px, "px",
      "limits.sigma0_px: circular targets are measured far better than 0.1 px", relative * result.sigma0_px);
  double largest_w = 0.0;
  for (const base::CommissionedSphere& sphere : result.spheres) largest_w = std::max(largest_w, std::abs(sphere.w));
  add("sphere_w", largest_w, limits.sphere_w, "", "limits.sphere_w: 0.1 % two-sided of a normal distribution", 0.0);
  add("rig_change_w", largest_rig_change(result, calibrated), limits.rig_change_w, "",
      "limits.rig_change_w: 0.1 % two-sided of the largest of six; beyond it the head changed since calibrate", 0.0);
  if (limits.frame_u_mm) {
    const double largest = largest_frame_u_mm(result);
    add("frame_u_mm", largest, *limits.frame_u_mm, "mm",
        "limits.frame_u_mm of the job: U of a point of the working volume by the frame", 0.5 * kCoverage * relative * largest);
  }
  return verdicts;
}

}  // namespace crosstie::app
