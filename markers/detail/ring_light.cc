#include "markers/detail/ring_light.h"

#include <cmath>
#include <numbers>

#include <Eigen/LU>

#include "markers/detail/dot_pixels.h"
#include "markers/detail/edge_profile.h"

namespace crosstie::markers::detail {
namespace {

/// Turns (0 .. 1) of a direction, to 1e-5 of a turn: far finer than the profile.
double turns_of(double x, double y) {
  const double ax = std::abs(x);
  const double ay = std::abs(y);
  const double t = ax > ay ? ay / ax : ax / std::max(ay, 1e-12);
  const double t2 = t * t;  // arctangent after Abramowitz and Stegun 4.4.47
  const double octant =
      t * (0.9998660 + t2 * (-0.3302995 + t2 * (0.1801410 + t2 * (-0.0851330 + t2 * 0.0208351)))) / (2.0 * std::numbers::pi);
  const double quadrant = ax > ay ? octant : 0.25 - octant;
  const double half = x < 0.0 ? 0.5 - quadrant : quadrant;
  return y < 0.0 ? 1.0 - half : half;
}

}  // namespace

void RingLight::take_off(PixelSet& pixels) const {
  // The light that this many blurs before the ring is not worth a thought.
  constexpr double kReach = 4.0;
  const Eigen::Matrix2d to_unit = ellipse.pixel_from_unit().inverse();
  const Eigen::Matrix2d shape = ellipse.shape();
  const Eigen::Vector2d shift = pixels.origin_px - ellipse.centre_px;
  const double from_rho = inner_rho - kReach * blur_px / ellipse.semi_minor_px;
  const double from2 = from_rho > 0.0 ? from_rho * from_rho : 0.0;
  const auto count = static_cast<double>(profile.size());
  for (std::size_t i = 0; i < pixels.used; ++i) {
    const double ex = shift.x() + pixels.radius_px * static_cast<double>(pixels.x[i]);
    const double ey = shift.y() + pixels.radius_px * static_cast<double>(pixels.y[i]);
    const double gx = shape(0, 0) * ex + shape(0, 1) * ey;
    const double gy = shape(1, 0) * ex + shape(1, 1) * ey;
    const double rho2 = ex * gx + ey * gy;
    if (rho2 <= from2 || rho2 < 0.25) continue;
    const double rho = std::sqrt(rho2);
    const double gradient = std::sqrt(gx * gx + gy * gy) / rho;
    const double spread = edge_profile((rho - inner_rho) / (gradient * blur_px)).distribution;
    if (spread <= 0.0) continue;
    const double position = count * turns_of(to_unit(0, 0) * ex + to_unit(0, 1) * ey, to_unit(1, 0) * ex + to_unit(1, 1) * ey);
    const auto k = static_cast<std::size_t>(position);
    const double fraction = position - static_cast<double>(k);
    const double f = (1.0 - fraction) * profile[k % profile.size()] + fraction * profile[(k + 1) % profile.size()];
    pixels.grey[i] -= static_cast<float>(contrast * f * spread);
  }
}

}  // namespace crosstie::markers::detail
