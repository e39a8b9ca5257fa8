#pragma once

#include <cmath>
#include <limits>
#include <vector>

#include <Eigen/Core>

#include "markers/detail/dot_fit.h"
#include "markers/detail/sampler.h"
#include "markers/family.h"

namespace crosstie::markers::detail {

inline constexpr int kSamplesPerSegment = 12;
inline constexpr double kOutside = std::numeric_limits<double>::quiet_NaN();  ///< value of what lies outside of the image

/// The sampled directions round a dot, clockwise in the image, equidistant on the unit circle.
class RingSweep {
 public:
  RingSweep(const Sampler& image, const DotFit& dot, int count);

  [[nodiscard]] std::size_t count() const { return units_.size(); }
  /// Direction `k` on the unit circle.
  [[nodiscard]] const Eigen::Vector2d& unit(std::size_t k) const { return units_[k]; }
  /// In pixels for each dot radius.
  [[nodiscard]] const Eigen::Vector2d& direction(std::size_t k) const { return directions_[k]; }

  /// Grey levels at `rho` round the circle; NaN outside of the image.
  [[nodiscard]] std::vector<double> at(double rho) const;

 private:
  const Sampler& image_;
  Eigen::Vector2d centre_px_;
  Eigen::Vector2d half_extent_px_;
  std::vector<Eigen::Vector2d> units_, directions_;
};

/// Mean over 2 * half + 1 neighbours round the circle; what is not finite counts as `outside`.
std::vector<double> smoothed(const std::vector<double>& values, int half, double outside);

/// Levels round the marker: 0 = as dark as the gap in that direction, 1 = as bright as the dot.
class RingLevels {
 public:
  RingLevels(const RingSweep& sweep, const MarkerFamily& family, const DotFit& dot);

  [[nodiscard]] const std::vector<double>& gap() const { return gap_; }
  [[nodiscard]] const std::vector<double>& quiet() const { return quiet_; }
  /// At `rho`, from the gap's level in each direction; NaN outside of the image.
  [[nodiscard]] std::vector<double> at(double rho) const {
    std::vector<double> values = sweep_.at(rho);
    for (std::size_t k = 0; k < values.size(); ++k) {
      values[k] = (values[k] - base_[k] - tilt(k, rho - gap_rho_)) * per_contrast_;
    }
    return values;
  }

 private:
  [[nodiscard]] double tilt(std::size_t k, double rho) const { return rho * slope_.dot(sweep_.unit(k)); }

  const RingSweep& sweep_;
  double per_contrast_;
  double gap_rho_;
  double lift_ = 0.0;  // of the dark plane at the centre
  Eigen::Vector2d slope_ = Eigen::Vector2d::Zero();
  std::vector<double> base_, gap_, quiet_;
};

}  // namespace crosstie::markers::detail
