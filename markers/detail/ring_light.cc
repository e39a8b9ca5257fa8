#include "markers/detail/ring_light.h"

#include <cmath>
#include <complex>
#include <numbers>

#include <Eigen/LU>

#include "markers/detail/dot_fit.h"
#include "markers/detail/dot_pixels.h"
#include "math/edge_profile.h"

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

std::optional<RingLight> RingLight::of(const Sampler& image, const DotFit& dot, const MarkerFamily& family,
                                       double saturated_level) {
  constexpr int kSamplesPerSegment = 8;
  constexpr double kShares[] = {0.25, 0.4, 0.55};  // of the ring's width, where it is sampled
  RingLight light;
  light.ellipse_ = dot.ellipse;
  light.blur_px_ = dot.blur_px;
  light.contrast_ = dot.inner_level - dot.outer_level;
  light.inner_rho_ = family.ring_inner;
  light.outer_rho_ = family.ring_outer;
  const Eigen::Matrix2d pixel_from_unit = dot.ellipse.pixel_from_unit();
  const Eigen::Vector2d reach = family.ring_outer * dot.ellipse.half_extent_px();
  const Eigen::Vector2d& centre = dot.ellipse.centre_px;
  if (!image.inside(centre.x() - reach.x(), centre.y() - reach.y()) ||
      !image.inside(centre.x() + reach.x(), centre.y() + reach.y())) {
    return std::nullopt;
  }
  const int count = family.bits * kSamplesPerSegment;
  light.profile_.resize(static_cast<std::size_t>(count));
  const std::complex<double> turn = std::polar(1.0, 2.0 * std::numbers::pi / count);
  std::complex<double> unit = 1.0;
  for (double& f : light.profile_) {
    const Eigen::Vector2d u(unit.real(), unit.imag());
    const Eigen::Vector2d edge = pixel_from_unit * u;
    const double gradient = Eigen::Vector2d(u.x() / dot.ellipse.semi_major_px, u.y() / dot.ellipse.semi_minor_px).norm();
    double sum = 0.0;
    double bracket = 0.0;
    for (const double share : kShares) {
      const double rho = light.inner_rho_ + share * (light.outer_rho_ - light.inner_rho_);
      const Eigen::Vector2d e = rho * edge;
      const double grey = image.bilinear(centre.x() + e.x(), centre.y() + e.y());
      if (grey >= saturated_level) return std::nullopt;
      sum += grey - dot.outer_level - dot.outer_slope.dot(e);
      bracket += light.bracket(rho, gradient);
    }
    f = sum / (light.contrast_ * bracket);
    unit *= turn;
  }
  return light;
}

double RingLight::bracket(double rho, double gradient) const {
  const double per_blur = 1.0 / (gradient * blur_px_);
  return math::edge_distribution((rho - inner_rho_) * per_blur) - math::edge_distribution((rho - outer_rho_) * per_blur);
}

void RingLight::take_off(PixelSet& pixels) const {
  // The light that this many blurs before the ring is not worth a thought.
  constexpr double kReach = 4.0;
  const Eigen::Matrix2d to_unit = ellipse_.pixel_from_unit().inverse();
  const Eigen::Matrix2d shape = ellipse_.shape();
  const Eigen::Vector2d shift = pixels.origin_px - ellipse_.centre_px;
  const double from_rho = inner_rho_ - kReach * blur_px_ / ellipse_.semi_minor_px;
  const double from2 = from_rho > 0.0 ? from_rho * from_rho : 0.0;
  const auto count = static_cast<double>(profile_.size());
  for (std::size_t i = 0; i < pixels.used; ++i) {
    const double ex = shift.x() + pixels.radius_px * static_cast<double>(pixels.x[i]);
    const double ey = shift.y() + pixels.radius_px * static_cast<double>(pixels.y[i]);
    const double gx = shape(0, 0) * ex + shape(0, 1) * ey;
    const double gy = shape(1, 0) * ex + shape(1, 1) * ey;
    const double rho2 = ex * gx + ey * gy;
    if (rho2 <= from2 || rho2 < 0.25) continue;
    const double rho = std::sqrt(rho2);
    const double gradient = std::sqrt(gx * gx + gy * gy) / rho;
    const double spread = bracket(rho, gradient);
    if (spread <= 0.0) continue;
    const double position = count * turns_of(to_unit(0, 0) * ex + to_unit(0, 1) * ey, to_unit(1, 0) * ex + to_unit(1, 1) * ey);
    const auto k = static_cast<std::size_t>(position);
    const double fraction = position - static_cast<double>(k);
    const double f = (1.0 - fraction) * profile_[k % profile_.size()] + fraction * profile_[(k + 1) % profile_.size()];
    pixels.grey[i] -= static_cast<float>(contrast_ * f * spread);
  }
}

}  // namespace crosstie::markers::detail
