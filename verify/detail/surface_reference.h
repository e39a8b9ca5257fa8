#pragma once

#include <memory>
#include <optional>

#include "base/mesh.h"

namespace crosstie::verify::detail {

/// The nearest place of a reference surface.
struct SurfaceFoot {
  Eigen::Vector3d point = Eigen::Vector3d::Zero();
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();  ///< unit length; positive side
  double signed_mm = 0.0;                             ///< of the point asked for, along it
  bool on_border = false;
};

/// A surface to measure distances from.
class SurfaceReference {
 public:
  SurfaceReference() = default;
  SurfaceReference(const SurfaceReference&) = delete;
  SurfaceReference& operator=(const SurfaceReference&) = delete;
  virtual ~SurfaceReference() = default;
  /// Nothing where the surface is farther than the gate. `side` is a direction that is known to be outside, or zero.
  [[nodiscard]] virtual std::optional<SurfaceFoot> foot(const Eigen::Vector3d& p, const Eigen::Vector3d& side,
                                                        double gate_mm) const = 0;
};

/// Of triangles; the mesh must outlive it.
[[nodiscard]] std::unique_ptr<SurfaceReference> mesh_reference(const base::Mesh& mesh);
/// Of points, by the surface of second order through the nearest twenty (moving least squares).
[[nodiscard]] std::unique_ptr<SurfaceReference> cloud_reference(const base::Cloud& cloud);

}  // namespace crosstie::verify::detail
