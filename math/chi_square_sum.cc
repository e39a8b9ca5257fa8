#include "math/chi_square_sum.h"

#include <cmath>
#include <limits>

#include <Eigen/Core>
#include <unsupported/Eigen/SpecialFunctions>

#include "math/distributions.h"

namespace crosstie::math {
namespace {

/// Degrees of freedom of the chi-square variable that has the same skewness; not a number where there is none.
double degrees(const std::array<double, 3>& moments) {
  const auto [mean, second, third] = moments;
  if (!(mean > 0.0 && second > 0.0 && third > 0.0)) return std::numeric_limits<double>::quiet_NaN();
  return second * second * second / (third * third);
}

}  // namespace

double chi_square_sum_above(double x, const std::array<double, 3>& moments) {
  const double dof = degrees(moments);
  if (std::isnan(dof)) return dof;
  const double y = (x - moments[0]) * std::sqrt(dof / moments[1]) + dof;
  return y <= 0.0 ? 1.0 : Eigen::numext::igammac(0.5 * dof, 0.5 * y);
}

double chi_square_sum_limit(double p, const std::array<double, 3>& moments) {
  const double dof = degrees(moments);
  return moments[0] + (chi_square_quantile(1.0 - p, dof) - dof) * std::sqrt(moments[1] / dof);
}

}  // namespace crosstie::math
