#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

#include "base/edge_curve.h"
#include "base/pose.h"
#include "base/result.h"
#include "edge/nominal.h"

namespace crosstie::edge {

/// How far a measured rim lies from a nominal one, along it. u = normal x tangent lies in the surface, to the left of the way as
/// seen from the head: of a hole that runs counter-clockwise u > 0 is material that stands into the opening. v is along the normal.
struct EdgeDeviations {
  std::vector<std::size_t> points =
      {};                         ///< indices into the rim: those whose nearest place is not beyond an open nominal's end
  std::vector<double> s_mm = {};  ///< arc length of their nearest places
  Eigen::Matrix2Xd uv_mm = {};
  std::vector<Eigen::Matrix2d> cov_mm2 = {};  ///< of u and v, of each point alone
  Eigen::MatrixXd shared_mm = {};             ///< u v of each, as EdgeCurve::shared_mm
  Eigen::Matrix2Xd tilt_rad = {};  ///< of the measured normal from the nominal one, towards u and the nominal's tangent

  /// Of u (row 0) or v (row 1), all parts together; not that of the nominal's place.
  [[nodiscard]] double sigma_mm(std::size_t i, int row) const;
};

[[nodiscard]] EdgeDeviations deviations(const base::EdgeCurve& edge, const NominalCurve& nominal,
                                        const base::Pose& frame_from_hole);

struct NominalFitOptions {
  /// About where the hole lies; nothing: it is searched for.
  std::optional<base::Pose> frame_from_hole = std::nullopt;
  /// False: the sizes stay as they are given. Sizes that are not given are always estimated.
  bool fit_size = true;
  /// Stretches of the rim that do not belong to the nominal are left out of the fit, a quarter of the points at most, and reported.
  bool leave_out_stretches = true;
};

/// A stretch of a rim that is not part of the nominal which the rest of it follows: a break-out, spatter, another edge.
struct ForeignStretch {
  double from_mm = 0.0;  ///< arc length of its first point along the rim
  double length_mm = 0.0;
  std::vector<std::size_t> points = {};  ///< indices into the rim, in order
  double most_u_mm = 0.0;                ///< the largest of their distances, with its sign: see EdgeDeviations
};

/// Form of a rim in one direction: a stationary process along it. A short rim hardly tells over which length a form is correlated, nor how smooth it is, so
/// that it is a mean over both, each as its likelihood says.
struct FormComponent {
  struct Part {
    double variance_mm2 = 0.0;
    double length_mm = 0.0;  ///< over which its correlation falls to 1/e; 0: neighbours deviate independently
    bool smooth =
        false;  ///< true: Matern's process of order 5/2, as heat and springing leave it; false: exp(-d / length), as a torch does
  };
  std::vector<Part> parts = {};

  /// Covariance of two points by their distance along the rim; round a closed one of length L by the chord (L / pi) sin(pi way / L).
  [[nodiscard]] double cov_mm2(double distance_mm) const;
  [[nodiscard]] double sigma_mm() const;   ///< 0: none that noise does not explain
  [[nodiscard]] double length_mm() const;  ///< mean of the parts, by variance
};

/// By how much a rim deviates from its nominal beyond its sigmas.
struct RimForm {
  FormComponent across;        ///< u
  FormComponent along_normal;  ///< v

  [[nodiscard]] bool none() const { return across.parts.empty() && along_normal.parts.empty(); }
};

struct NominalFit {
  Nominal nominal;             ///< with the fitted sizes; a list without normals runs counter-clockwise as seen from the head
  base::Pose frame_from_hole;  ///< in the rim's frame
  /// Of [rotation rad, translation mm, sizes mm], the pose perturbed on the left as base::Pose has it: what each point has alone, what
  /// they share, and of a rim that is not closed its form, which on another part of the rim would be another. A turn about the normal that nothing determines is
  /// held and adds nothing.
  Eigen::MatrixXd covariance;
  bool turn_is_held = false;
  EdgeDeviations deviations;  ///< after the fit, of all points
  std::vector<ForeignStretch> left_out = {};
  RimForm form;         ///< of the points that were fitted
  double rms_mm = 0.0;  ///< of the distances of the points that were fitted
  double rms_u_mm = 0.0;
  double rms_v_mm = 0.0;
  double sigma0 =
      0.0;  ///< sqrt(v'Pv / redundancy), without unit, before the form counts: above 1 the hole's form deviates by more than noise
  long redundancy = 0;  ///< 2 for each point less unknowns
  int iterations = 0;
  std::vector<base::Warning> warnings;

  [[nodiscard]] double size_sigma_mm(std::size_t i) const;
};

/// Position, orientation and size of a nominal hole that fit a measured rim best: least squares of the orthogonal distances,
///     min  sum_i r_i' (E_i' C_i E_i)^-1 r_i + z'z,   r_i = E_i' (p_i - S_i z - c(nearest place)),   E_i = [u v],
/// C_i of each point alone, S_i z what all share with z of unit variance (generalised least squares of the full covariance, since z
/// is eliminated with its prior). Levenberg-Marquardt from starts of its own: the plane of the points, extents or a circle for the
/// sizes, and turns about the normal in steps of ten degrees; the best three are followed.
/// Where the rim then deviates by more than noise, stretches that do not belong to the nominal are looked for (least trimmed squares,
/// detail/foreign_stretch.h) and left out. What the rest deviates beyond its sigmas is the hole's form (detail/form.h): its variance is added to C_i, so that
/// points of small sigmas do not decide a hole whose form is larger, and its correlation along the rim counts in the covariance.
///
/// Errors: kBadInput as NominalCurve::make; for a nominal that fits only as its mirror image (where that differs from itself, and,
/// of a list, with normals; else a flat list turned round looks the same), or that is too large or too small by the ratio of two
/// units; for points without a covariance or normals.
/// kNoUniqueSolution for too few points and for an arc that does not determine the unknowns, naming the weakest.
/// Warnings: turn_held; stretch_left_out, one for each; form: sigma0 beyond its 99.9 % limit, or a form that chance does not explain.
base::Result<NominalFit> fit_nominal(const base::EdgeCurve& edge, const Nominal& nominal,
                                     const NominalFitOptions& options = {});

}  // namespace crosstie::edge
