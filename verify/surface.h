#pragma once

#include <optional>
#include <vector>

#include "base/cloud.h"
#include "base/edge_curve.h"
#include "base/mesh.h"
#include "base/progress.h"
#include "base/result.h"
#include "base/surface_verification.h"
#include "math/shape_fit.h"
#include "math/shapes.h"

namespace crosstie::verify {

struct SurfaceOptions {
  double tolerance_mm = 0.3;  ///< whose share is told
  /// Points farther from the reference than this are no points of it and take no part; 0.3 % of 1.5 m, as far as a scan and a shell
  /// that were brought together by markers may ever be apart.
  double gate_mm = 5.0;
  base::Pose reference_from_measured = {};  ///< brings the cloud to the reference
  /// True: the cloud is first laid onto the reference by point-to-plane least squares (an ICP). Directions that the surface does not
  /// determine (a cylinder slides and turns) are held and told.
  bool best_fit = false;
  std::size_t max_points = 200000;  ///< of a larger cloud every so many points are compared

  [[nodiscard]] base::Result<> validate() const;
};

/// Points against a mesh (distance from the nearest place of its triangles) or, without triangles, a cloud (from the surface of
/// second order through the nearest twenty points). Signs: triangles are counter-clockwise as seen from outside; a reference cloud's
/// normals, else the measured points' normals, else away from the origin of the reference. Points whose nearest place is on the reference's border, where it
/// says nothing, are left out and counted.
///
/// Errors: kUsage for options out of their domain; kBadInput for clouds without points, or where nothing is within the gate.
base::Result<base::SurfaceDeviations> compare_surface(const base::Cloud& measured, const base::Mesh& reference,
                                                      const SurfaceOptions& options, const base::Progress& progress = {});

/// Points against a nominal cylinder or cone; signs: positive outside.
base::Result<base::SurfaceDeviations> compare_surface(const base::Cloud& measured, const math::Cylinder& reference,
                                                      const SurfaceOptions& options);
base::Result<base::SurfaceDeviations> compare_surface(const base::Cloud& measured, const math::Cone& reference,
                                                      const SurfaceOptions& options);

/// What a shell should be; the reference's frame.
struct NominalShell {
  Eigen::Vector3d axis_point_mm = Eigen::Vector3d::Zero();
  Eigen::Vector3d axis_direction = Eigen::Vector3d::UnitZ();  ///< to where a cone widens
  double radius_mm = 0.0;                                     ///< at axis_point_mm, across the axis
  double half_angle_rad = 0.0;                                ///< 0: a cylinder
};

struct ShellFitOptions {
  bool cone = true;       ///< false: a cylinder
  bool robust = true;     ///< strays (mounts, cables, the far side of the hole) are found and left out; false: all points count
  double sigma_mm = 0.0;  ///< of a point along the normal, where the cloud carries no covariance; 0: from the residuals
  std::size_t max_points = 20000;  ///< a fit of more says no more: neighbouring points are not independent
  /// Points within one patch of so many millimetres count as one observation of the surface's form: sigmas are those of the number of
  /// patches and of the larger of noise and form. 0: points are independent.
  double correlation_mm = 50.0;
};

/// A cone or cylinder through a shell's points.
struct ShellFit {
  bool is_cone = true;
  Eigen::Vector3d point_mm = Eigen::Vector3d::Zero();    ///< of the axis, nearest to the points' centroid
  Eigen::Vector3d direction = Eigen::Vector3d::UnitZ();  ///< of the axis; of a cone to where it widens
  double distance_mm = 0.0;                              ///< radius, or a cone's distance of the point from its surface
  double half_angle_rad = 0.0;
  /// Its covariance is that of the larger of noise and form, for as many observations as there are patches.
  math::ShapeQuality quality = {};
  double noise_mm = 0.0;                        ///< a priori, of a point
  std::vector<Eigen::Vector3d> points_mm = {};  ///< that took part
  std::size_t strays = 0;

  /// Across the axis at a place along it, from `point_mm`.
  [[nodiscard]] double radius_mm(double along_mm) const;
  [[nodiscard]] double radius_sigma_mm(double along_mm) const;
};
base::Result<ShellFit> fit_shell(const base::Cloud& measured, const ShellFitOptions& options);

/// The same (robust, math/shape_fit.h), its diameters at both ends and its apex angle with sigmas, held
/// against the nominal where one is given.
base::Result<base::ShapeDeviations> compare_shell(const base::Cloud& measured, const std::optional<NominalShell>& nominal,
                                                  const ShellFitOptions& options = {});

/// A rim against a reference rim (a point list or another measurement, both in one frame): distances of its points from the reference's
/// polygon, u in the surface and v along its normal, with their sigmas over which they are told.
base::Result<base::EdgeVerification> compare_edge(const base::EdgeCurve& measured, const base::EdgeCurve& reference,
                                                  double gate_mm = 5.0);

}  // namespace crosstie::verify
