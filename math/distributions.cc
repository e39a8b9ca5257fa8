#include "math/distributions.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <Eigen/Core>
#include <unsupported/Eigen/SpecialFunctions>

namespace crosstie::math {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

/// The x >= 0 with cdf(x) = p, by bracketing and bisection down to neighbouring doubles.
template <typename Cdf>
double positive_quantile(double p, double start, const Cdf& cdf) {
  double low = 0.0;
  double high = std::max(start, 1e-3);
  while (cdf(high) < p && high < 1e300) {
    low = high;
    high *= 2.0;
  }
  for (int i = 0; i < 2000; ++i) {
    const double middle = 0.5 * (low + high);
    if (middle <= low || middle >= high || high - low <= 1e-15 * high) break;
    (cdf(middle) < p ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

bool is_probability(double p) { return p > 0.0 && p < 1.0; }

}  // namespace

double normal_cdf(double x) { return 0.5 * std::erfc(-x / std::sqrt(2.0)); }

double normal_quantile(double p) {
  if (!is_probability(p)) return kNan;
  const double upper = std::min(p, 1.0 - p);  // the smaller tail keeps its digits
  const double x = positive_quantile(1.0 - upper, 1.0, [&](double t) { return 1.0 - normal_cdf(-t); });
  return p < 0.5 ? -x : x;
}

double chi_square_cdf(double x, double dof) {
  if (!(dof > 0.0)) return kNan;
  return x <= 0.0 ? 0.0 : Eigen::numext::igamma(0.5 * dof, 0.5 * x);
}

double chi_square_quantile(double p, double dof) {
  if (!is_probability(p) || !(dof > 0.0)) return kNan;
  return positive_quantile(p, dof, [&](double x) { return chi_square_cdf(x, dof); });
}

double f_cdf(double x, double dof_1, double dof_2) {
  if (!(dof_1 > 0.0 && dof_2 > 0.0)) return kNan;
  if (x <= 0.0) return 0.0;
  return Eigen::numext::betainc(0.5 * dof_1, 0.5 * dof_2, dof_1 * x / (dof_1 * x + dof_2));
}

double f_quantile(double p, double dof_1, double dof_2) {
  if (!is_probability(p) || !(dof_1 > 0.0 && dof_2 > 0.0)) return kNan;
  return positive_quantile(p, 1.0, [&](double x) { return f_cdf(x, dof_1, dof_2); });
}

double student_cdf(double x, double dof) {
  const double inside = f_cdf(x * x, 1.0, dof);  // P(|T| < |x|)
  return x < 0.0 ? 0.5 * (1.0 - inside) : 0.5 * (1.0 + inside);
}

double student_quantile(double p, double dof) {
  if (!is_probability(p) || !(dof > 0.0)) return kNan;
  const double x = p == 0.5 ? 0.0 : std::sqrt(f_quantile(std::abs(2.0 * p - 1.0), 1.0, dof));
  return p < 0.5 ? -x : x;
}

double tau_quantile(double p, double m, double redundancy) {
  if (!(redundancy > m)) return kNan;
  const double f = f_quantile(p, m, redundancy - m);
  return std::sqrt(redundancy * f / (redundancy - m + m * f));
}

double chi_square_two_sided(double x, double dof) {
  const double below = chi_square_cdf(x, dof);
  return std::min(1.0, 2.0 * std::min(below, 1.0 - below));
}

double student_two_sided(double t, double dof) {
  if (!(dof > 0.0) || std::isnan(t)) return kNan;
  return Eigen::numext::betainc(0.5 * dof, 0.5, dof / (dof + t * t));
}

}  // namespace crosstie::math
