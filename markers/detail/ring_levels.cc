#include "markers/detail/ring_levels.h"

#include <Eigen/Cholesky>

namespace crosstie::markers::detail {
namespace {

/// How the level of what has tone 0 changes per dot radius from the centre, along both axes of the unit circle: the plane
/// through gap and quiet zone that most of both agree with (bright things, on the side of tone 1, have no say).
Eigen::Vector2d dark_slope(const RingSweep& sweep, const std::vector<double>& gap, double gap_rho,
                           const std::vector<double>& quiet, double quiet_rho, double outer_level, double contrast) {
  constexpr int kIterations = 8;
  constexpr double kTolerated = 0.08;  // of the contrast
  Eigen::Vector3d plane(outer_level, 0.0, 0.0);
  for (int iteration = 0; iteration < kIterations; ++iteration) {
    Eigen::Matrix3d n = Eigen::Matrix3d::Zero();
    Eigen::Vector3d b = Eigen::Vector3d::Zero();
    const auto add = [&](const std::vector<double>& greys, double rho) {
      for (std::size_t k = 0; k < greys.size(); ++k) {
        if (!std::isfinite(greys[k])) continue;
        const Eigen::Vector3d row(1.0, rho * std::cos(sweep.angle_rad(k)), rho * std::sin(sweep.angle_rad(k)));
        const double residual = (greys[k] - row.dot(plane)) / contrast;
        const double weight = 1.0 / (1.0 + std::pow(residual / kTolerated, 2));
        n += weight * row * row.transpose();
        b += weight * greys[k] * row;
      }
    };
    add(gap, gap_rho);
    if (iteration > 0) add(quiet, quiet_rho);  // the gap first: it is known to be there
    n.diagonal() *= 1.0 + 1e-9;
    plane = n.ldlt().solve(b);
  }
  return plane.allFinite() ? Eigen::Vector2d(plane.tail<2>()) : Eigen::Vector2d(0.0, 0.0);
}

}  // namespace

std::vector<double> smoothed(const std::vector<double>& values, int half, double outside) {
  const int n = static_cast<int>(values.size());
  std::vector<double> means(values.size());
  for (int k = 0; k < n; ++k) {
    double sum = 0.0;
    for (int i = -half; i <= half; ++i) {
      const double value = values[static_cast<std::size_t>((k + i + n) % n)];
      sum += std::isfinite(value) ? value : outside;
    }
    means[static_cast<std::size_t>(k)] = sum / (2 * half + 1);
  }
  return means;
}

RingLevels::RingLevels(const RingSweep& sweep, const MarkerFamily& family, const DotFit& dot)
    : sweep_(sweep), contrast_(dot.inner_level - dot.outer_level), gap_rho_(0.5 * (1.0 + family.ring_inner)) {
  const double quiet_rho = 0.5 * (family.ring_outer + family.disc_outer);
  const std::vector<double> gap = sweep.at(gap_rho_);
  slope_ = dark_slope(sweep, gap, gap_rho_, sweep.at(quiet_rho), quiet_rho, dot.outer_level, contrast_);
  base_ = smoothed(gap, kSamplesPerSegment / 2, dot.outer_level);
  for (std::size_t k = 0; k < gap.size(); ++k) {
    gap_.push_back((gap[k] - dot.outer_level - tilt(k, gap_rho_)) / contrast_);
    lift_ += (base_[k] - tilt(k, gap_rho_)) / static_cast<double>(gap.size());
  }
  quiet_ = sweep.at(quiet_rho);
  for (std::size_t k = 0; k < gap.size(); ++k) quiet_[k] = (quiet_[k] - lift_ - tilt(k, quiet_rho)) / contrast_;
}

}  // namespace crosstie::markers::detail
