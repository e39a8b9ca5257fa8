#pragma once

#include <Eigen/Core>

#include "markers/detail/dot_pixels.h"
#include "markers/detail/edge_profile.h"

namespace crosstie::markers::detail {

enum DotParameter { kCx, kCy, kAxx, kAxy, kAyy, kBlur, kO, kOx, kOy, kI, kIx, kIy, kDotParameters };
using DotState = Eigen::Matrix<double, kDotParameters, 1>;

/// The model at one pixel.
struct Prediction {
  double grey;    // cut off at saturation
  double inside;  // Phi(-d / blur)
  double slope;   // d grey / d d, negative for bright dots; 0 where cut off
  double rho;
  double distance;
  double set_back;  // of the blurred edge, by its curvature
  double x, y;      // relative to the origin of the fit
  double ex, ey;    // relative to the centre
  double nx, ny;    // outward normal
  double gradient;  // |A e|
  bool cut_off;
};

/// The blurred ellipse of dot_fit.h as a function of its parameters.
class DotModel {
 public:
  DotModel(const DotState& state, double radius_px, double saturated_level)
      : s_(state), radius_px_(radius_px), saturated_level_(saturated_level) {}

  [[nodiscard]] Prediction at(const DotPixel& pixel) const {
    Prediction p;
    p.x = pixel.x;
    p.y = pixel.y;
    p.ex = pixel.x - s_[kCx];
    p.ey = pixel.y - s_[kCy];
    const double gx = s_[kAxx] * p.ex + s_[kAxy] * p.ey;
    const double gy = s_[kAxy] * p.ex + s_[kAyy] * p.ey;
    p.rho = std::sqrt(std::max(p.ex * gx + p.ey * gy, 1e-12));
    p.gradient = std::max(std::sqrt(gx * gx + gy * gy), 1e-12);
    p.nx = gx / p.gradient;
    p.ny = gy / p.gradient;
    p.distance = (p.rho - 1.0) * p.rho / p.gradient;
    // Blurred, an edge of this curvature passes through the middle level that much further inside.
    const double curvature = (s_[kAxx] * p.ny * p.ny - 2.0 * s_[kAxy] * p.nx * p.ny + s_[kAyy] * p.nx * p.nx) / p.gradient;
    p.set_back = 0.5 * s_[kBlur] * s_[kBlur] * curvature;
    const double t = (p.distance + p.set_back) / s_[kBlur];
    const double outer = s_[kO] + (s_[kOx] * pixel.x + s_[kOy] * pixel.y) / radius_px_;
    const double inner = s_[kI] + (s_[kIx] * pixel.x + s_[kIy] * pixel.y) / radius_px_;
    const EdgeProfile profile = edge_profile(t);
    p.inside = 1.0 - profile.distribution;
    p.grey = outer + (inner - outer) * p.inside;
    p.slope = -(inner - outer) * profile.density / s_[kBlur];
    p.cut_off = p.grey >= saturated_level_;
    if (p.cut_off) {
      p.grey = saturated_level_;
      p.slope = 0.0;
    }
    return p;
  }

  /// Derivatives of the grey level by the parameters; the first kDotParameters entries of `j`.
  template <typename Vector>
  void derivatives(const Prediction& p, Vector& j) const {
    if (p.cut_off) {
      j.template head<kDotParameters>().setZero();
      return;
    }
    // d = (rho^2 - rho) / g with g = |A e|: d' = (2 rho - 1) rho' / g - d g' / g.
    const double g = p.gradient;
    const double by_rho = p.slope * (2.0 * p.rho - 1.0) / g;
    const double by_g = -p.slope * p.distance / g;
    const double rx = p.nx * g / p.rho;
    const double ry = p.ny * g / p.rho;
    j[kCx] = -(by_rho * rx + by_g * (s_[kAxx] * p.nx + s_[kAxy] * p.ny));
    j[kCy] = -(by_rho * ry + by_g * (s_[kAxy] * p.nx + s_[kAyy] * p.ny));
    j[kAxx] = by_rho * p.ex * p.ex / (2.0 * p.rho) + by_g * p.nx * p.ex;
    j[kAxy] = by_rho * p.ex * p.ey / p.rho + by_g * (p.nx * p.ey + p.ny * p.ex);
    j[kAyy] = by_rho * p.ey * p.ey / (2.0 * p.rho) + by_g * p.ny * p.ey;
    j[kBlur] = -p.slope * (p.distance - p.set_back) / s_[kBlur];
    const double outside = 1.0 - p.inside;
    j[kO] = outside;
    j[kOx] = outside * p.x / radius_px_;
    j[kOy] = outside * p.y / radius_px_;
    j[kI] = p.inside;
    j[kIx] = p.inside * p.x / radius_px_;
    j[kIy] = p.inside * p.y / radius_px_;
  }

 private:
  const DotState& s_;
  double radius_px_;
  double saturated_level_;
};

}  // namespace crosstie::markers::detail
