#include "edge/detail/rim_filter.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>

#include <Eigen/Cholesky>
#include <Eigen/Geometry>

namespace crosstie::edge::detail {
namespace {

// Of local parabolas: (1 + y) exp(-y) = 1/2 with y = pi gamma^2, ISO 16610-31.
constexpr double kGamma = 0.73090;
constexpr double kReach = 1.6;  // of the weights, in cutoffs: beyond they are below 3e-7
constexpr double kPointsPerCutoff = 4.0;
constexpr double kUsualDistances = 4.0;  // points farther apart leave a gap

}  // namespace

RimFilter::RimFilter(const base::EdgeCurve& edge, const EdgeDeviations& off, double length_mm, bool closed, double cutoff_mm,
                     double tilt_cutoff_mm)
    : edge_(edge), off_(off), length_mm_(length_mm), closed_(closed), cutoff_mm_(cutoff_mm), tilt_cutoff_mm_(tilt_cutoff_mm) {
  order_.resize(off.s_mm.size());
  std::iota(order_.begin(), order_.end(), std::size_t{0});
  std::stable_sort(order_.begin(), order_.end(), [&](std::size_t a, std::size_t b) { return off.s_mm[a] < off.s_mm[b]; });
  for (const std::size_t i : order_) s_mm_.push_back(off.s_mm[i]);
  std::vector<double> spacings;
  for (std::size_t i = 1; i < s_mm_.size(); ++i) spacings.push_back(s_mm_[i] - s_mm_[i - 1]);
  if (!spacings.empty()) {
    const auto middle = spacings.begin() + static_cast<std::ptrdiff_t>(spacings.size() / 2);
    std::nth_element(spacings.begin(), middle, spacings.end());
    spacing_mm_ = *middle;
  }
  for (double* cutoff : {&cutoff_mm_, &tilt_cutoff_mm_}) *cutoff = std::max(*cutoff, kPointsPerCutoff * spacing_mm_);
}

double RimFilter::way(double from_mm, double to_mm) const {
  const double d = to_mm - from_mm;
  return closed_ ? d - length_mm_ * std::round(d / length_mm_) : d;
}

std::vector<std::size_t> RimFilter::near(double s_mm, double reach_mm) const {
  const double reach = std::min(reach_mm, closed_ ? 0.45 * length_mm_ : length_mm_);
  std::vector<std::size_t> near;
  const auto collect = [&](double low, double high) {
    const auto begin = std::lower_bound(s_mm_.begin(), s_mm_.end(), low);
    const auto end = std::upper_bound(begin, s_mm_.end(), high);
    for (auto it = begin; it != end; ++it) near.push_back(order_[static_cast<std::size_t>(it - s_mm_.begin())]);
  };
  collect(s_mm - reach, s_mm + reach);
  if (closed_ && s_mm - reach < 0.0) collect(s_mm - reach + length_mm_, length_mm_);
  if (closed_ && s_mm + reach > length_mm_) collect(0.0, s_mm + reach - length_mm_);
  return near;
}

RimFilter::Weights RimFilter::weights(double s_mm, std::vector<std::size_t> near, const Eigen::VectorXd& variances,
                                      double cutoff_mm) const {
  constexpr Eigen::Index kParabola = 3;
  const auto n = static_cast<Eigen::Index>(near.size());
  const Eigen::Index unknowns = std::min(kParabola, n);
  Eigen::MatrixXd design(n, unknowns);
  Eigen::VectorXd weight(n);
  for (Eigen::Index j = 0; j < n; ++j) {
    const double x = way(s_mm, off_.s_mm[near[static_cast<std::size_t>(j)]]) / cutoff_mm;
    weight(j) = std::exp(-std::numbers::pi * x * x / (kGamma * kGamma)) / variances(j);
    for (Eigen::Index k = 0; k < unknowns; ++k) design(j, k) = std::pow(x, static_cast<double>(k));
  }
  const Eigen::MatrixXd weighted = weight.asDiagonal() * design;
  const Eigen::MatrixXd hat = (design.transpose() * weighted).ldlt().solve(weighted.transpose());
  Weights result{std::move(near), Eigen::RowVectorXd::Zero(n), Eigen::RowVectorXd::Zero(n)};
  if (unknowns > 0) result.value = hat.row(0);
  if (unknowns > 1) result.slope = hat.row(1) / cutoff_mm;
  return result;
}

Smoothed RimFilter::at(double s_mm) const {
  Smoothed result;
  const std::vector<std::size_t> points = near(s_mm, kReach * cutoff_mm_);
  for (int row = 0; row < 2; ++row) {
    Eigen::VectorXd variances(static_cast<Eigen::Index>(points.size()));
    for (Eigen::Index j = 0; j < variances.size(); ++j)
      variances(j) = off_.cov_mm2[points[static_cast<std::size_t>(j)]](row, row);
    const Weights w = weights(s_mm, points, variances, cutoff_mm_);
    Eigen::RowVectorXd together = Eigen::RowVectorXd::Zero(off_.shared_mm.cols());
    for (Eigen::Index j = 0; j < variances.size(); ++j) {
      const auto i = static_cast<Eigen::Index>(points[static_cast<std::size_t>(j)]);
      result.uv_mm(row) += w.value(j) * off_.uv_mm(row, i);
      result.slope(row) += w.slope(j) * off_.uv_mm(row, i);
      result.variance_mm2(row) += w.value(j) * w.value(j) * variances(j);
      if (together.size() > 0) together += w.value(j) * off_.shared_mm.row(2 * i + row);
    }
    result.variance_mm2(row) += together.squaredNorm();
  }
  add_tilt(s_mm, result);
  return result;
}

void RimFilter::add_tilt(double s_mm, Smoothed& smoothed) const {
  const std::vector<std::size_t> points = near(s_mm, kReach * tilt_cutoff_mm_);
  const auto n = static_cast<Eigen::Index>(points.size());
  for (int row = 0; row < 2; ++row) {
    Eigen::VectorXd variances(n);
    for (Eigen::Index j = 0; j < n; ++j)
      variances(j) = edge_.points[off_.points[points[static_cast<std::size_t>(j)]]].tilt_variance_rad2(row);
    // Of points whose normals have no variance all count alike.
    const bool known = n > 0 && variances.minCoeff() > 0.0;
    const Weights w = weights(s_mm, points, known ? variances : Eigen::VectorXd::Ones(n), tilt_cutoff_mm_);
    Eigen::RowVectorXd together = Eigen::RowVectorXd::Zero(edge_.shared_tilt_rad.cols());
    Eigen::VectorXd places(n);
    for (Eigen::Index j = 0; j < n; ++j) {
      const std::size_t at = points[static_cast<std::size_t>(j)];
      places(j) = way(s_mm, off_.s_mm[at]);
      smoothed.tilt_rad(row) += w.value(j) * off_.tilt_rad(row, static_cast<Eigen::Index>(at));
      if (together.size() > 0)
        together += w.value(j) * edge_.shared_tilt_rad.row(2 * static_cast<Eigen::Index>(off_.points[at]) + row);
    }
    // What two points have in common of their depths.
    const Eigen::VectorXd parts = w.value.transpose().cwiseProduct(variances.cwiseSqrt());
    double alone = parts.squaredNorm();
    for (Eigen::Index j = 0; edge_.depths_mm > 0.0 && j < n; ++j) {
      for (Eigen::Index k = j + 1; k < n; ++k)
        alone += 2.0 * parts(j) * parts(k) * std::max(0.0, 1.0 - std::abs(places(j) - places(k)) / edge_.depths_mm);
    }
    smoothed.tilt_variance_rad2(row) = std::max(0.0, alone) + together.squaredNorm();
  }
}

std::vector<Unmeasured> RimFilter::gaps() const {
  const double limit = std::max(cutoff_mm_, kUsualDistances * spacing_mm_);
  std::vector<Unmeasured> gaps;
  const auto named = [&](double from, double to) {
    // A gap that the rim names begins at one of its points.
    for (const base::EdgeGap& gap : edge_.gaps) {
      for (std::size_t i = 0; i < off_.points.size(); ++i) {
        if (std::abs(edge_.points[off_.points[i]].s_mm - gap.from_mm) > 1e-6 + 0.01 * spacing_mm_) continue;
        const double s = off_.s_mm[i];  // the rim may run the other way
        if (std::abs(way(s, from)) < 1e-9 || std::abs(way(s, to)) < 1e-9) {
          if (std::abs((to - from) - gap.length_mm) < 0.5 * gap.length_mm + spacing_mm_) return gap.reason;
        }
      }
    }
    return std::string();
  };
  const auto add = [&](double from, double to, std::string reason) {
    Unmeasured& gap = gaps.emplace_back();  // filled where it is: GCC 12 warns of bounds in moving a temporary there
    gap.from_mm = from;
    gap.to_mm = to;
    gap.reason = std::move(reason);
  };
  const auto check = [&](double from, double to) {
    std::string reason = named(from, to);
    if (reason.empty() && to - from <= limit) return;
    if (reason.empty()) reason = "no point of the rim was measured";
    add(from, to, std::move(reason));
  };
  for (std::size_t i = 1; i < s_mm_.size(); ++i) check(s_mm_[i - 1], s_mm_[i]);
  if (closed_) {
    check(s_mm_.back(), s_mm_.front() + length_mm_);
  } else {
    if (s_mm_.front() > limit) add(0.0, s_mm_.front(), "the rim was not measured from the nominal's beginning on");
    if (length_mm_ - s_mm_.back() > limit) add(s_mm_.back(), length_mm_, "the rim was not measured to the nominal's end");
  }
  return gaps;
}

Eigen::Vector2d RimFilter::mean_square_mm2() const {
  return off_.uv_mm.rowwise().squaredNorm() / static_cast<double>(std::max<Eigen::Index>(1, off_.uv_mm.cols()));
}

Eigen::Vector2d RimFilter::mean_square_tilt_rad2() const {
  return off_.tilt_rad.rowwise().squaredNorm() / static_cast<double>(std::max<Eigen::Index>(1, off_.tilt_rad.cols()));
}

}  // namespace crosstie::edge::detail
