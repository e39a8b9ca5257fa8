#pragma once

#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

#include <Eigen/Core>

#include "markers/detail/dot_fit.h"
#include "markers/detail/sampler.h"
#include "markers/family.h"

namespace crosstie::markers::detail {

inline constexpr int kSamplesPerSegment = 16;
inline constexpr double kOutside = std::numeric_limits<double>::quiet_NaN();  ///< value of what lies outside of the image

/// Unit vectors of the sampled directions, clockwise in the image.
class RingSweep {
 public:
  RingSweep(const Sampler& image, const DotFit& dot, int count)
      : image_(image), centre_px_(dot.ellipse.centre_px), pixel_from_unit_(dot.ellipse.pixel_from_unit()) {
    directions_.reserve(static_cast<std::size_t>(count));
    for (int k = 0; k < count; ++k) {
      const double phi = 2.0 * std::numbers::pi * k / count;
      directions_.emplace_back(pixel_from_unit_ * Eigen::Vector2d(std::cos(phi), std::sin(phi)));
    }
  }

  [[nodiscard]] std::size_t count() const { return directions_.size(); }
  /// Direction `k` in pixels for each dot radius.
  [[nodiscard]] const Eigen::Vector2d& direction(std::size_t k) const { return directions_[k]; }
  [[nodiscard]] double angle_rad(std::size_t k) const {
    return 2.0 * std::numbers::pi * static_cast<double>(k) / static_cast<double>(count());
  }

  /// Grey levels at `rho` round the circle; NaN outside of the image.
  [[nodiscard]] std::vector<double> at(double rho) const {
    std::vector<double> greys;
    greys.reserve(directions_.size());
    for (const Eigen::Vector2d& direction : directions_) {
      const Eigen::Vector2d p = centre_px_ + rho * direction;
      greys.push_back(image_.inside(p.x(), p.y()) ? image_.bilinear(p.x(), p.y()) : kOutside);
    }
    return greys;
  }

 private:
  const Sampler& image_;
  Eigen::Vector2d centre_px_;
  Eigen::Matrix2d pixel_from_unit_;
  std::vector<Eigen::Vector2d> directions_;
};

/// Mean over 2 * half + 1 neighbours round the circle; what is not finite counts as `outside`.
std::vector<double> smoothed(const std::vector<double>& values, int half, double outside);

/// Levels round the marker: 0 = as dark as the gap in that direction, 1 = as bright as the dot.
class RingLevels {
 public:
  RingLevels(const RingSweep& sweep, const MarkerFamily& family, const DotFit& dot);

  [[nodiscard]] const std::vector<double>& gap() const { return gap_; }
  [[nodiscard]] const std::vector<double>& quiet() const { return quiet_; }
  /// What at() takes off at `rho` beyond the gap's level in each direction.
  [[nodiscard]] double carried(std::size_t k, double rho) const { return tilt(k, rho - gap_rho_) / contrast_; }
  /// At `rho`, from the gap's level in each direction; NaN outside of the image.
  [[nodiscard]] std::vector<double> at(double rho) const {
    std::vector<double> values = sweep_.at(rho);
    for (std::size_t k = 0; k < values.size(); ++k) {
      values[k] = (values[k] - base_[k] - tilt(k, rho - gap_rho_)) / contrast_;
    }
    return values;
  }

 private:
  [[nodiscard]] double tilt(std::size_t k, double rho) const {
    return rho * (slope_.x() * std::cos(sweep_.angle_rad(k)) + slope_.y() * std::sin(sweep_.angle_rad(k)));
  }

  const RingSweep& sweep_;
  double contrast_;
  double gap_rho_;
  double lift_ = 0.0;  // of the dark plane at the centre
  Eigen::Vector2d slope_ = Eigen::Vector2d::Zero();
  std::vector<double> base_, gap_, quiet_;
};

}  // namespace crosstie::markers::detail
