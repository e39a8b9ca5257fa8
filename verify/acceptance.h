#pragma once

#include <numbers>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "base/acceptance.h"
#include "base/cloud.h"
#include "base/result.h"

namespace crosstie::verify {

/// How the points of an artefact are chosen and judged.
struct AcceptanceOptions {
  int part = 2;  ///< of VDI/VDE 2634: 2 for single views, 3 for several views in one frame
  /// Share of the points that may be discarded, those of the largest deviations. Default: 3 per mille, VDI/VDE 2634 part 2.
  double discard_share = 0.003;
  /// Full opening of the cap that is evaluated, about the mean direction of the points; beyond it a scanner sees the surface at a grazing
  /// angle, and its points there are mixed ones of the silhouette. Nothing: 120 degrees of a single view, 240 of several (all but the
  /// side of the stem). crosstie's own choice: a contract or the guideline as bought may say another one.
  std::optional<double> cap_rad = std::nullopt;
  /// Least opening that the points must cover, the narrowest way across. Nothing: 90 degrees of a single view (below it the error of a free
  /// radius goes into the centre many times over, math/probed_sphere.h), 180 of several.
  std::optional<double> least_cap_rad = std::nullopt;
  /// Points within this share of the radius of the sphere are points of it, whatever they deviate by. Default: 0.1, far beyond the form
  /// error of any scanner that could pass, so that no blunder is left out unseen.
  double shell = 0.1;
  /// Points of a plate farther from it than this are none of it. Default: 5 mm, as `verify --surface` has it.
  double plate_gate_mm = 5.0;
  /// Points nearer to the border of a plate are left out: mixed ones of the edge. Default: 3 mm, two to three points of a head 1.3 m away.
  double plate_border_mm = 3.0;
  /// Fewer make no range: of 1000 points 3 may be discarded. Default: 300.
  std::size_t least_points = 300;
  int resamples = 200;  ///< of the block bootstrap that tells the sigma of a range

  [[nodiscard]] double cap() const;
  [[nodiscard]] double least_cap() const;
  [[nodiscard]] base::Result<> validate() const;
};

/// A calibrated sphere.
struct SphereArtefact {
  std::string name;
  double diameter_mm = 0.0;
  double diameter_sigma_mm = 0.0;
  double form_mm = 0.0;                                   ///< its own range of form deviations, as its certificate says
  std::optional<Eigen::Vector3d> near_mm = std::nullopt;  ///< its centre to half a radius; nothing: it is looked for
};

/// A ball bar: two spheres in a calibrated distance.
struct BarArtefact {
  SphereArtefact a;
  SphereArtefact b;
  double length_mm = 0.0;  ///< of the centres, at 20 degrees
  double length_sigma_mm = 0.0;
  double temperature_c = 20.0;
  double temperature_sigma_c = 0.0;
  double cte_per_k = 0.0;

  [[nodiscard]] double length_at_temperature_mm() const { return length_mm * (1.0 + cte_per_k * (temperature_c - 20.0)); }
};

/// A calibrated plate.
struct PlaneArtefact {
  double form_mm = 0.0;                                   ///< its own flatness deviation, as its certificate says
  std::optional<Eigen::Vector3d> near_mm = std::nullopt;  ///< a place on it; with `radius_mm` the points about it that count
  double radius_mm = 0.0;
};

/// Centres of spheres of a diameter in a cloud, those with the most points first: local algebraic fits from every occupied cell of a grid
/// of one radius, refined. Deterministic.
std::vector<Eigen::Vector3d> find_spheres(const base::Cloud& cloud, double diameter_mm);

/// PF and PS of a sphere (VDI/VDE 2634 part 2, probing error).
///
/// Points within `shell` of the calibrated radius and within the cap about their mean direction; least-squares sphere with free radius and
/// equal weights; floor(discard_share N) points of the largest |deviation| go, and the sphere is fitted anew until the choice stays.
///     PF = max - min of the radial deviations,   PS = diameter - calibrated diameter.
/// Sigma of PS and centre: the points' own covariance along the normal, or the scatter of the deviations where that is larger, propagated
/// through the unweighted fit, times f^2 = N / N_eff: means of deviations over places of two, four, ... point distances have f^2 times the
/// variance of independent points (as `stitch` has it). Sigma of PF: block bootstrap over places in which points err together, the sphere
/// fitted anew. The calibration of the head is not in them: its errors are what the test is to find.
///
/// Second-order bias of the least-squares sphere by noise: with P = I - n n', points off along the surface lie outside of it by
/// tr(P C) / (2 r), noise turns the normals, which adds P C n / r to the normal equations, and it carries points over the border of the cap
/// whose noise along the normal, t' C n, goes with it. Propagated through the fit all three together make the diameter of a cap too small
/// where depths are noisier than places across, too large where noise is the same in all directions (2 sigma^2 / r of a whole sphere).
/// It is part of PS as the guideline defines it, and told (size_bias_mm); the warning noise_bias where it exceeds a sigma. Points seen at a
/// grazing angle are biased beyond their noise, hence the cap.
///
/// Errors: kUsage; kNoUniqueSolution where the cloud holds no such sphere, too few points of it, or a cap that is too small.
base::Result<base::MeasuredSphere> measure_sphere(const base::Cloud& cloud, const SphereArtefact& artefact,
                                                  const AcceptanceOptions& options = {});

/// SD of a ball bar, and PF and PS of its spheres: those two of which the distance is right within 3 % where no places are given.
base::Result<base::AcceptancePosition> measure_bar(const base::Cloud& cloud, const BarArtefact& artefact,
                                                   const AcceptanceOptions& options = {});

/// F: range of the deviations from the least-squares plane, with the same discarding and sigma.
base::Result<base::MeasuredPlane> measure_plane(const base::Cloud& cloud, const PlaneArtefact& artefact,
                                                const AcceptanceOptions& options = {});

/// Maximum permissible errors; the guideline leaves them to the maker's data sheet or the contract. Nothing: not judged.
struct AcceptanceLimits {
  std::optional<double> form_mm = std::nullopt;      ///< of PF
  std::optional<double> size_mm = std::nullopt;      ///< of |PS|
  std::optional<double> spacing_mm = std::nullopt;   ///< of |SD|
  std::optional<double> flatness_mm = std::nullopt;  ///< of F
  std::optional<double> length_mm = std::nullopt;    ///< of |E|, part 3
};

/// The characteristics over all positions, each position held against its limit after ISO 14253-1 with U = 2 sigma of the value: inside by
/// more than U conforms, outside by more than U does not, between neither is proven.
/// Warnings: too_few_positions (PF and PS 10, SD 7, F 6, after part 2), sphere_size, bar_length, plate_length against the diagonal of the
/// measuring volume where it is given (0: not held against it), noise_bias, correlated_points.
base::Acceptance judge_acceptance(std::vector<base::AcceptancePosition> positions, const AcceptanceLimits& limits, int part,
                                  double volume_diagonal_mm);

}  // namespace crosstie::verify
