#include "markers/detail/ring_levels.h"

#include <numbers>

#include <Eigen/Cholesky>
#include <Eigen/Geometry>

namespace crosstie::markers::detail {
namespace {

/// A grey level at rho times a unit vector.
struct Sample {
  double x, y, grey;
};

void add_samples(const RingSweep& sweep, const std::vector<double>& greys, double rho, std::vector<Sample>& samples) {
  for (std::size_t k = 0; k < greys.size(); ++k) {
    if (std::isfinite(greys[k])) samples.push_back({rho * sweep.unit(k).x(), rho * sweep.unit(k).y(), greys[k]});
  }
}

/// How the level of what has tone 0 changes per dot radius from the centre, along both axes of the unit circle: the plane
/// through gap and quiet zone that most of both agree with (bright things, on the side of tone 1, have no say).
Eigen::Vector2d dark_slope(const RingSweep& sweep, const std::vector<double>& gap, double gap_rho,
                           const std::vector<double>& quiet, double quiet_rho, double outer_level, double contrast) {
  constexpr int kIterations = 8;
  constexpr double kTolerated = 0.08;  // of the contrast
  constexpr double kSettled = 1e-4;    // the same, a change of the plane
  std::vector<Sample> samples;
  samples.reserve(gap.size() + quiet.size());
  add_samples(sweep, gap, gap_rho, samples);
  const double per_tolerated = 1.0 / (kTolerated * contrast);
  Eigen::Vector3d plane(outer_level, 0.0, 0.0);
  for (int iteration = 0; iteration < kIterations; ++iteration) {
    if (iteration == 1) add_samples(sweep, quiet, quiet_rho, samples);  // the gap first: it is known to be there
    double n = 0.0, x = 0.0, y = 0.0, xx = 0.0, xy = 0.0, yy = 0.0, g = 0.0, gx = 0.0, gy = 0.0;
    for (const Sample& sample : samples) {
      const double residual = (sample.grey - plane[0] - plane[1] * sample.x - plane[2] * sample.y) * per_tolerated;
      const double weight = 1.0 / (1.0 + residual * residual);
      const double wx = weight * sample.x;
      const double wy = weight * sample.y;
      n += weight;
      x += wx;
      y += wy;
      xx += wx * sample.x;
      xy += wx * sample.y;
      yy += wy * sample.y;
      g += weight * sample.grey;
      gx += wx * sample.grey;
      gy += wy * sample.grey;
    }
    Eigen::Matrix3d normal;
    normal << n, x, y, x, xx, xy, y, xy, yy;
    normal.diagonal() *= 1.0 + 1e-9;
    const Eigen::Vector3d next = normal.ldlt().solve(Eigen::Vector3d(g, gx, gy));
    const double change = (next - plane).cwiseAbs().maxCoeff();
    plane = next;
    if (iteration > 0 && change < kSettled * std::abs(contrast)) break;
  }
  return plane.allFinite() ? Eigen::Vector2d(plane.tail<2>()) : Eigen::Vector2d(0.0, 0.0);
}

}  // namespace

RingSweep::RingSweep(const Sampler& image, const DotFit& dot, int count)
    : image_(image), centre_px_(dot.ellipse.centre_px), half_extent_px_(dot.ellipse.half_extent_px()) {
  const Eigen::Matrix2d pixel_from_unit = dot.ellipse.pixel_from_unit();
  const double step_rad = 2.0 * std::numbers::pi / count;
  const Eigen::Rotation2Dd turn(step_rad);
  units_.reserve(static_cast<std::size_t>(count));
  directions_.reserve(static_cast<std::size_t>(count));
  Eigen::Vector2d unit(1.0, 0.0);
  for (int k = 0; k < count; ++k, unit = turn * unit) {
    units_.push_back(unit);
    directions_.emplace_back(pixel_from_unit * unit);
  }
}

std::vector<double> RingSweep::at(double rho) const {
  const Eigen::Vector2d first = centre_px_ - rho * half_extent_px_;
  const Eigen::Vector2d last = centre_px_ + rho * half_extent_px_;
  const bool whole = image_.inside(first.x(), first.y()) && image_.inside(last.x(), last.y());
  std::vector<double> greys(count());
  for (std::size_t k = 0; k < greys.size(); ++k) {
    const double x = centre_px_.x() + rho * directions_[k].x();
    const double y = centre_px_.y() + rho * directions_[k].y();
    greys[k] = whole || image_.inside(x, y) ? image_.bilinear(x, y) : kOutside;
  }
  return greys;
}

std::vector<double> smoothed(const std::vector<double>& values, int half, double outside) {
  const int n = static_cast<int>(values.size());
  const auto level = [&](int k) {
    const double value = values[static_cast<std::size_t>((k + n) % n)];
    return std::isfinite(value) ? value : outside;
  };
  std::vector<double> padded;  // with the neighbours of both ends
  padded.reserve(values.size() + 2 * static_cast<std::size_t>(half));
  for (int k = -half; k < n + half; ++k) padded.push_back(level(k));
  std::vector<double> means(values.size());
  const double share = 1.0 / (2 * half + 1);
  for (std::size_t k = 0; k < means.size(); ++k) {
    double sum = 0.0;
    for (std::size_t i = k; i <= k + 2 * static_cast<std::size_t>(half); ++i) sum += padded[i];
    means[k] = sum * share;
  }
  return means;
}

RingLevels::RingLevels(const RingSweep& sweep, const MarkerFamily& family, const DotFit& dot)
    : sweep_(sweep), per_contrast_(1.0 / (dot.inner_level - dot.outer_level)), gap_rho_(0.5 * (1.0 + family.ring_inner)) {
  const double quiet_rho = 0.5 * (family.ring_outer + family.disc_outer);
  gap_ = sweep.at(gap_rho_);
  quiet_ = sweep.at(quiet_rho);
  slope_ = dark_slope(sweep, gap_, gap_rho_, quiet_, quiet_rho, dot.outer_level, dot.inner_level - dot.outer_level);
  base_ = smoothed(gap_, kSamplesPerSegment / 2, dot.outer_level);
  for (std::size_t k = 0; k < gap_.size(); ++k) {
    lift_ += (base_[k] - tilt(k, gap_rho_)) / static_cast<double>(gap_.size());
    gap_[k] = (gap_[k] - dot.outer_level - tilt(k, gap_rho_)) * per_contrast_;
  }
  for (std::size_t k = 0; k < quiet_.size(); ++k) quiet_[k] = (quiet_[k] - lift_ - tilt(k, quiet_rho)) * per_contrast_;
}

}  // namespace crosstie::markers::detail
