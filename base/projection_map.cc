#include "base/projection_map.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace crosstie::base {
namespace {

/// The smallest of the values that at least `share` of them do not exceed; not a number where there is none.
double quantile(std::vector<double> values, double share) {
  if (values.empty()) return std::numeric_limits<double>::quiet_NaN();
  const double place = std::ceil(share * static_cast<double>(values.size())) - 1.0;
  const auto at = static_cast<std::ptrdiff_t>(std::max(0.0, place));
  std::nth_element(values.begin(), values.begin() + at, values.end());
  return values[static_cast<std::size_t>(at)];
}

}  // namespace

MapFigures map_figures(const Eigen::VectorXd& values, const std::vector<char>& counts) {
  std::vector<double> counted;
  for (Eigen::Index i = 0; i < values.size(); ++i) {
    if (counts[static_cast<std::size_t>(i)] && std::isfinite(values(i))) counted.push_back(values(i));
  }
  return {quantile(counted, 0.5), quantile(counted, 0.95), quantile(counted, 1.0)};
}

std::vector<DifferenceQuantile> quantiles(const ProjectionDifference& difference) {
  std::vector<double> after;
  std::vector<double> before;
  std::vector<double> sigma;
  for (std::size_t i = 0; i < difference.compared.size(); ++i) {
    if (!difference.compared[i]) continue;
    const auto cell = static_cast<Eigen::Index>(i);
    after.push_back(difference.difference_px.col(cell).norm());
    if (difference.before_px.col(cell).allFinite()) before.push_back(difference.before_px.col(cell).norm());
    if (difference.sigma_px.size() > 0) sigma.push_back(difference.sigma_px(cell));
  }
  std::vector<DifferenceQuantile> result;
  for (const double share : {0.5, 0.68, 0.9, 0.95, 0.99, 1.0}) {
    result.push_back({share, quantile(after, share), quantile(before, share), quantile(sigma, share)});
  }
  return result;
}

}  // namespace crosstie::base
