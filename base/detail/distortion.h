#pragma once

#include <array>

namespace crosstie::base::detail {

inline constexpr int kMaxDistortion = 15;

/// k1 k2 p1 p2 k3 k4 k5 k6 s1 s2 s3 s4 and k0 a1 a2, zeros where the model has fewer. Beyond the formula of base/camera.h, k0 is
/// added to the numerator of `radial` (a balanced distortion scales the image), a1 x + a2 y to x' (affinity and shear).
using Distortion = std::array<double, kMaxDistortion>;

/// The distortion (x', y') of a normalised image point (x, y), with its 2x2 derivative.
struct Distorted {
  double x = 0.0, y = 0.0;
  double dx_dx = 0.0, dx_dy = 0.0, dy_dx = 0.0, dy_dy = 0.0;

  [[nodiscard]] double determinant() const { return dx_dx * dy_dy - dx_dy * dy_dx; }
};

/// The formula of base/camera.h. The derivatives of x' (y') by the parameters go to `dx` (`dy`) where not null.
Distorted distort(const Distortion& k, double x, double y, double* dx = nullptr, double* dy = nullptr);

/// The smallest r > 0 at which d(r radial(r^2))/dr or the denominator of `radial` is zero, or `max_tangent`.
double first_fold(const Distortion& k, double max_tangent);

/// The r in [0, max_radius] with r radial(r^2) = distorted_radius; max_radius where there is none. The left side must grow.
double undistorted_radius(const Distortion& k, double distorted_radius, double max_radius);

}  // namespace crosstie::base::detail
