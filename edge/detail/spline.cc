#include "edge/detail/spline.h"

#include <algorithm>

#include <Eigen/LU>

namespace crosstie::edge::detail {
namespace {

/// Solves a tridiagonal system with one right-hand side in space (Thomas): lower and upper neighbours a, c, diagonal b.
std::vector<Eigen::Vector3d> tridiagonal(const std::vector<double>& a, std::vector<double> b, const std::vector<double>& c,
                                         std::vector<Eigen::Vector3d> right) {
  const std::size_t n = b.size();
  for (std::size_t i = 1; i < n; ++i) {
    const double factor = a[i] / b[i - 1];
    b[i] -= factor * c[i - 1];
    right[i] -= factor * right[i - 1];
  }
  right[n - 1] /= b[n - 1];
  for (std::size_t i = n - 1; i-- > 0;) right[i] = (right[i] - c[i] * right[i + 1]) / b[i];
  return right;
}

/// The same where the first and the last unknown are neighbours, too (Sherman-Morrison).
std::vector<Eigen::Vector3d> cyclic(const std::vector<double>& a, std::vector<double> b, const std::vector<double>& c,
                                    const std::vector<Eigen::Vector3d>& right) {
  const std::size_t n = b.size();
  const double corner_top = a[0];
  const double corner_bottom = c[n - 1];
  const double gamma = -b[0];
  b[0] -= gamma;
  b[n - 1] -= corner_top * corner_bottom / gamma;
  std::vector<Eigen::Vector3d> x = tridiagonal(a, b, c, right);
  std::vector<Eigen::Vector3d> u(n, Eigen::Vector3d::Zero());
  u[0].setConstant(gamma);
  u[n - 1].setConstant(corner_bottom);
  const std::vector<Eigen::Vector3d> z = tridiagonal(a, b, c, u);
  const double ratio = corner_top / gamma;
  const double below = 1.0 + z[0].x() + ratio * z[n - 1].x();
  const Eigen::Vector3d factor = (x[0] + ratio * x[n - 1]) / below;
  for (std::size_t i = 0; i < n; ++i) x[i] -= factor * z[i].x();
  return x;
}

}  // namespace

Spline::Spline(std::vector<double> knots, const std::vector<Eigen::Vector3d>& points, bool closed, bool straight)
    : knots_(std::move(knots)), points_(points) {
  if (closed) points_.push_back(points.front());
  if (straight) return;
  const std::size_t n = closed ? points.size() : points.size() - 2;  // unknown second derivatives
  std::vector<double> a(n);
  std::vector<double> b(n);
  std::vector<double> c(n);
  std::vector<Eigen::Vector3d> right(n);
  const std::size_t intervals = knots_.size() - 1;
  const auto width = [&](std::size_t k) { return knots_[k + 1] - knots_[k]; };
  const auto slope = [&](std::size_t k) -> Eigen::Vector3d { return (points_[k + 1] - points_[k]) / width(k); };
  for (std::size_t i = 0; i < n; ++i) {
    const std::size_t after = closed ? i : i + 1;
    const std::size_t before = (after + intervals - 1) % intervals;
    a[i] = width(before);
    b[i] = 2.0 * (width(before) + width(after));
    c[i] = width(after);
    right[i] = 6.0 * (slope(after) - slope(before));
  }
  seconds_.assign(knots_.size(), Eigen::Vector3d::Zero());
  if (n == 0) return;
  const std::vector<Eigen::Vector3d> solved = closed ? cyclic(a, b, c, right) : tridiagonal(a, b, c, right);
  for (std::size_t i = 0; i < n; ++i) seconds_[closed ? i : i + 1] = solved[i];
  if (closed) seconds_.back() = seconds_.front();
}

Spline::Value Spline::at(double t) const {
  const auto above = std::upper_bound(knots_.begin() + 1, knots_.end() - 1, t);
  const auto k = static_cast<std::size_t>(above - knots_.begin()) - 1;
  const double h = knots_[k + 1] - knots_[k];
  const double x = t - knots_[k];
  Value value;
  const Eigen::Vector3d slope = (points_[k + 1] - points_[k]) / h;
  value.point = points_[k] + x * slope;
  value.derivative = slope;
  if (seconds_.empty()) return value;
  // p(x) = p_k + x m + x (x - h) / 6 [ (2 - x/h) M_k + (1 + x/h) M_k+1 ]
  const double w = x / h;
  const Eigen::Vector3d bent = (2.0 - w) * seconds_[k] + (1.0 + w) * seconds_[k + 1];
  value.point += x * (x - h) / 6.0 * bent;
  value.derivative += (2.0 * x - h) / 6.0 * bent + x * (x - h) / (6.0 * h) * (seconds_[k + 1] - seconds_[k]);
  return value;
}

}  // namespace crosstie::edge::detail
