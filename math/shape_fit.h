#pragma once

#include <optional>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "base/result.h"
#include "math/shapes.h"

namespace crosstie::math {

/// What is known of a radius before the fit.
struct RadiusKnowledge {
  double radius_mm = 0.0;
  double sigma_mm = 0.0;  ///< 0: the radius is held; else it is an observation with this standard deviation
};

struct ShapeFitOptions {
  /// Standard deviation of each coordinate of every point, mm. Nothing: it follows from the residuals.
  std::optional<double> sigma_mm = std::nullopt;
  /// Covariance of each point, mm^2, in the points' order, in place of sigma_mm. Empty: none. What counts of it is the variance
  /// along the surface's normal, taken anew in each iteration. Points are taken as independent of each other.
  std::span<const Eigen::Matrix3d> cov_mm2 = {};
  /// Of circles, spheres and cylinders. One with a sigma needs the points' sigmas: their ratio is the weight.
  std::optional<RadiusKnowledge> radius = std::nullopt;
  /// True: points that do not belong to the shape (mounts, strays) are found and left out, see fit_plane().
  bool robust = false;
  /// With robust: a point goes where its standardised residual |w| is larger. 3.29: 0.1 % of good points, two-sided.
  double max_w = 3.29;

  /// kUsage for values out of their domain.
  [[nodiscard]] base::Result<> validate(std::size_t points) const;
};

enum class RejectedPointReason {
  kNoConsensus,  ///< far from the shape that most of the points agree on
  kResidual,     ///< agrees roughly, but its standardised residual is too large
};

struct RejectedPoint {
  std::size_t index = 0;     ///< in the points' order
  double residual_mm = 0.0;  ///< its distance from the shape that the others gave
  double w = 0.0;            ///< the same over its standard deviation
  RejectedPointReason reason = RejectedPointReason::kResidual;
};

/// Of the seven parameters of a shape's small change, in this order:
///     u v w     shift of the point or centre along the frame's axes e1, e2, e3, mm
///     a b       tilt: the direction e3 becomes e3 + a e1 + b e2, rad
///     size      radius; of a cone: distance of the point from the surface, mm
///     angle     half angle of a cone, rad
/// Estimated are: line u v a b, plane w a b, circle u v w a b size, sphere u v w size, cylinder u v a b size, cone u v a b size
/// angle; rows and columns of the others, and of a held radius, are zero.
using ShapeCovariance = Eigen::Matrix<double, 7, 7>;

/// How well a shape is known and how well the points fit to it.
struct ShapeQuality {
  Eigen::Matrix3d frame = Eigen::Matrix3d::Identity();  ///< e1, e2, e3 in columns; e3 is the direction (sphere: the identity)
  /// With sigmas given: as these say. Else times sigma0^2; then not a number where redundancy is 0: nothing tells.
  ShapeCovariance covariance = ShapeCovariance::Zero();
  double rms_mm = 0.0;   ///< sqrt(mean square of the distances) of the points that took part
  double form_mm = 0.0;  ///< surfaces: largest minus smallest signed distance; curves: diameter of the tube about the curve
  double sigma0 = 0.0;   ///< sqrt(v'Pv / redundancy): without unit if sigmas were given, else in mm; 0 where redundancy is 0
  long redundancy = 0;   ///< observations less unknowns; a point is one observation of a surface, two of a curve
  int unknowns = 0;
  std::size_t count = 0;                ///< points that took part
  std::vector<RejectedPoint> rejected;  ///< in the points' order
  std::vector<double> residuals_mm;     ///< distance of every point, rejected ones too, in the points' order
  std::vector<base::Warning> warnings;
  int iterations = 0;

  [[nodiscard]] Eigen::Matrix3d point_cov_mm2() const;       ///< of point or centre; across the axis, along the normal
  [[nodiscard]] Eigen::Matrix3d direction_cov_rad2() const;  ///< across the direction
  [[nodiscard]] double size_sigma_mm() const;                ///< of the radius or a cone's distance
  [[nodiscard]] double half_angle_sigma_rad() const;
};

template <typename Shape>
struct ShapeFit {
  Shape shape;
  ShapeQuality quality;
};

/// Least squares of orthogonal distances (geometric fits) without a guess from the caller.
///
/// Points are shifted to their centroid and scaled by a power of two, so that neither a far origin nor the unit matters.
/// Start values: principal axes (line, plane), Taubin's algebraic fit (circle, sphere; Taubin, IEEE PAMI 13(11), 1991), and for
/// cylinder and cone a search over all directions with algebraic fits from moments up to the fourth order, of which the most
/// promising are tried. Then Levenberg-Marquardt, then Gauss-Newton to rounding. The point of a line, plane, cylinder or cone is
/// the one nearest to the centroid of the points. The largest component of a direction is positive; a cone's points to where
/// it widens.
///
/// Robust: shapes through few points, drawn at random (the same ones every time), are compared a contrario (Moisan & Stival,
/// IJCV 57(3), 2004: no threshold is asked for; more than half of the points may be strays); then points go and come back by
/// their standardised residuals (Baarda's w, with the larger of a priori and a posteriori sigma) until nothing changes.
///
/// Errors: kBadInput for values that are not finite or covariances that are not positive; kNoUniqueSolution for too few points
/// (line 2, plane 3, circle 3, sphere 4, cylinder 5, cone 6; several cylinders or cones may pass through so few: then the one to
/// which most starts lead, and the warning several_solutions) and for points that do not determine the shape: in one place, on
/// one line, in one plane, or, as far as their scatter lets tell, on a simpler shape (a plane in place of a cylinder), a radius
/// or direction with a standard deviation above a third.
base::Result<ShapeFit<Line>> fit_line(std::span<const Eigen::Vector3d> points_mm, const ShapeFitOptions& options = {});
base::Result<ShapeFit<Plane>> fit_plane(std::span<const Eigen::Vector3d> points_mm, const ShapeFitOptions& options = {});
base::Result<ShapeFit<Circle>> fit_circle(std::span<const Eigen::Vector3d> points_mm, const ShapeFitOptions& options = {});
base::Result<ShapeFit<Sphere>> fit_sphere(std::span<const Eigen::Vector3d> points_mm, const ShapeFitOptions& options = {});
base::Result<ShapeFit<Cylinder>> fit_cylinder(std::span<const Eigen::Vector3d> points_mm, const ShapeFitOptions& options = {});
base::Result<ShapeFit<Cone>> fit_cone(std::span<const Eigen::Vector3d> points_mm, const ShapeFitOptions& options = {});

}  // namespace crosstie::math
