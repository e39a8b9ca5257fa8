#pragma once

#include <optional>

#include <Eigen/Core>

#include "markers/detail/ellipse.h"
#include "markers/detail/ring_light.h"
#include "markers/detail/sampler.h"

namespace crosstie::markers::detail {

/// What the fit of a dot is allowed to use.
struct DotFitOptions {
  double gap_outer = 1.8;           ///< [dot radii] where the gap ends and other things begin
  double saturated_level = 253.0;   ///< [grey levels] from here on a pixel is a lower bound
  double min_contrast = 3.0;        ///< [grey levels] with less than this it is given up early
  double min_radius_px = 1.5;       ///< [px] the same for the semi-minor axis
  double start_error_px = 1.0;      ///< by which the start's edge may be off
  bool alone = false;               ///< nothing stands around: the gap is used out to its end
  const RingLight* ring = nullptr;  ///< taken off the grey levels where it is known; the gap is then used nearly to the ring
};

/// A blurred ellipse fitted to the grey levels of dot and gap.
struct DotFit {
  Ellipse ellipse;
  Eigen::Matrix2d cov_px2 = Eigen::Matrix2d::Zero();  ///< of the centre, for the pixels' noise alone
  double blur_px = 0.0;      ///< standard deviation of the Gaussian that blurs the edge (lens and pixel)
  double inner_level = 0.0;  ///< grey level of the dot, at its centre
  double outer_level = 0.0;  ///< grey level of the gap, extrapolated to the centre
  Eigen::Vector2d inner_slope = Eigen::Vector2d::Zero();  ///< [1/px] change of these levels along x and y
  Eigen::Vector2d outer_slope = Eigen::Vector2d::Zero();
  double residual = 0.0;          ///< RMS of the residuals in grey levels, all pixels
  double outlier_fraction = 0.0;  ///< of the weight that the pixels near the edge lost
  double deviation_px = 0.0;      ///< amplitude of the largest of the harmonics 3..5 of the edge about the ellipse
  double harmonic_power = 0.0;    ///< power of the harmonics 3..5 over what the pixels' noise explains; 1 where it does
};

inline constexpr int kHarmonicDof = 6;  ///< cosines and sines of the harmonics 3, 4, 5

/// Model: with e = p - c, rho = sqrt(e^T A e) and the distance d = (rho - 1) rho / |A e| from the edge along its normal,
///     grey(p) = O(e) + (I(e) - O(e)) Phi(-(d + blur^2 k / 2) / blur),
/// k the curvature of the ellipse (a blurred convex edge recedes), O and I linear in e, Phi the normal distribution function;
/// values over the saturation level are cut off there. Parameters: c, A, blur, O, I (12). Pixels are weighted by their noise
/// (dark and bright level and the roughness of the edge apart), occluded ones are down-weighted. The harmonics 3..5 of the edge
/// are fitted at the end: an ellipse cannot follow them, so their power tells what the harmonic 1, the centre, suffers from all
/// causes. Nothing where the ellipse leaves the image, collapses, or the adjustment does not converge.
std::optional<DotFit> fit_dot(const Sampler& image, const Ellipse& start, const DotFitOptions& options);

/// The same from an earlier fit on, with other options: with the ring's light taken off, as a rule.
std::optional<DotFit> refine_dot(const Sampler& image, const DotFit& earlier, const DotFitOptions& options);

}  // namespace crosstie::markers::detail
