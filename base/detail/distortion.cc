#include "base/detail/distortion.h"

#include <algorithm>
#include <cmath>
#include <vector>

namespace crosstie::base::detail {
namespace {

/// Coefficients of a polynomial, constant first.
using Polynomial = std::vector<double>;

double evaluate(const Polynomial& p, double s) {
  double value = 0.0;
  for (std::size_t i = p.size(); i-- > 0;) value = value * s + p[i];
  return value;
}

Polynomial derivative(const Polynomial& p) {
  Polynomial result;
  for (std::size_t i = 1; i < p.size(); ++i) result.push_back(static_cast<double>(i) * p[i]);
  return result;
}

Polynomial product(const Polynomial& a, const Polynomial& b) {
  Polynomial result(a.size() + b.size() - 1, 0.0);
  for (std::size_t i = 0; i < a.size(); ++i) {
    for (std::size_t j = 0; j < b.size(); ++j) result[i + j] += a[i] * b[j];
  }
  return result;
}

/// The sign changes of `p` in (0, end], ascending. Between two neighbouring extrema a polynomial is monotone, so bisection
/// finds its only zero there; the extrema are the zeros of the derivative, found in the same way.
std::vector<double> zeros(const Polynomial& p, double end) {
  if (p.size() < 2) return {};
  std::vector<double> bounds = zeros(derivative(p), end);
  bounds.push_back(end);
  std::vector<double> result;
  double low = 0.0;
  for (double high : bounds) {
    const bool positive = evaluate(p, low) > 0.0;
    if (positive != (evaluate(p, high) > 0.0)) {
      double a = low;
      double b = high;
      for (double middle = 0.5 * (a + b); middle > a && middle < b; middle = 0.5 * (a + b)) {
        ((evaluate(p, middle) > 0.0) == positive ? a : b) = middle;
      }
      result.push_back(b);
    }
    low = high;
  }
  return result;
}

/// The numerator and the denominator of `radial` as polynomials in s = r^2.
Polynomial numerator(const Distortion& k) { return {1.0 + k[12], k[0], k[1], k[4]}; }
Polynomial denominator(const Distortion& k) { return {1.0, k[5], k[6], k[7]}; }

}  // namespace

Distorted distort(const Distortion& k, double x, double y, double* dx, double* dy) {
  const double xx = x * x;
  const double yy = y * y;
  const double xy = x * y;
  const double s = xx + yy;
  const double ss = s * s;
  const double n = 1.0 + k[12] + s * (k[0] + s * (k[1] + s * k[4]));
  const double d = 1.0 + s * (k[5] + s * (k[6] + s * k[7]));
  const double n_s = k[0] + s * (2.0 * k[1] + s * 3.0 * k[4]);
  const double d_s = k[5] + s * (2.0 * k[6] + s * 3.0 * k[7]);
  const double inverse_d = 1.0 / d;
  const double radial = n * inverse_d;
  const double radial_s = (n_s - radial * d_s) * inverse_d;

  Distorted result;
  result.x = x * radial + 2.0 * k[2] * xy + k[3] * (s + 2.0 * xx) + k[8] * s + k[9] * ss + k[13] * x + k[14] * y;
  result.y = y * radial + k[2] * (s + 2.0 * yy) + 2.0 * k[3] * xy + k[10] * s + k[11] * ss;

  const double prism_x = k[8] + 2.0 * k[9] * s;
  const double prism_y = k[10] + 2.0 * k[11] * s;
  const double mixed = 2.0 * xy * radial_s + 2.0 * (k[2] * x + k[3] * y);
  result.dx_dx = radial + 2.0 * xx * radial_s + 2.0 * k[2] * y + 6.0 * k[3] * x + 2.0 * x * prism_x + k[13];
  result.dx_dy = mixed + 2.0 * y * prism_x + k[14];
  result.dy_dx = mixed + 2.0 * x * prism_y;
  result.dy_dy = radial + 2.0 * yy * radial_s + 6.0 * k[2] * y + 2.0 * k[3] * x + 2.0 * y * prism_y;

  if (dx != nullptr && dy != nullptr) {
    const double sss = ss * s;
    const double by_numerator[3] = {s * inverse_d, ss * inverse_d, sss * inverse_d};
    const double by_denominator[3] = {-radial * by_numerator[0], -radial * by_numerator[1], -radial * by_numerator[2]};
    const double by_radial[8] = {by_numerator[0],   by_numerator[1],  0.0, 0.0, by_numerator[2], by_denominator[0],
                                 by_denominator[1], by_denominator[2]};
    for (int i = 0; i < 8; ++i) {
      dx[i] = x * by_radial[i];
      dy[i] = y * by_radial[i];
    }
    dx[2] = 2.0 * xy;
    dy[2] = s + 2.0 * yy;
    dx[3] = s + 2.0 * xx;
    dy[3] = 2.0 * xy;
    dx[8] = dy[10] = s;
    dx[9] = dy[11] = ss;
    dx[10] = dx[11] = dy[8] = dy[9] = 0.0;
    dx[12] = x * inverse_d;
    dy[12] = y * inverse_d;
    dx[13] = x;
    dx[14] = y;
    dy[13] = dy[14] = 0.0;
  }
  return result;
}

double first_fold(const Distortion& k, double max_tangent) {
  // With r radial = r N(s) / D(s), s = r^2:   d/dr = (N D + 2 s (N' D - N D')) / D^2.
  const Polynomial n = numerator(k);
  const Polynomial d = denominator(k);
  Polynomial slope = product(n, d);
  const Polynomial left = product(derivative(n), d);
  const Polynomial right = product(n, derivative(d));
  for (std::size_t i = 0; i < left.size(); ++i) slope[i + 1] += 2.0 * (left[i] - right[i]);
  double end = max_tangent * max_tangent;
  for (const Polynomial& p : {slope, d}) {
    const std::vector<double> found = zeros(p, end);
    if (!found.empty()) end = std::min(end, found.front());
  }
  return std::sqrt(end);
}

double undistorted_radius(const Distortion& k, double distorted_radius, double max_radius) {
  const Polynomial n = numerator(k);
  const Polynomial d = denominator(k);
  const auto distorted = [&](double r) { return r * evaluate(n, r * r) / evaluate(d, r * r); };
  double low = 0.0;
  double high = max_radius;
  if (!(distorted(high * (1.0 - 1e-12)) > distorted_radius)) return max_radius;
  for (int i = 0; i < 60; ++i) {  // a start value for Newton's method needs no more than some digits
    const double middle = 0.5 * (low + high);
    (distorted(middle) < distorted_radius ? low : high) = middle;
    if (high - low < 1e-6 * high) break;
  }
  return 0.5 * (low + high);
}

}  // namespace crosstie::base::detail
