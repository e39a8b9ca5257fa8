#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "base/cloud.h"
#include "base/progress.h"
#include "base/result.h"

namespace crosstie::registration {

struct SurfaceOptions {
  double cell_mm = 0.0;  ///< edge of the cells; 0: chosen so that `points_per_cell` hold, but no more than `max_pieces` cells
  double points_per_cell = 16.0;  ///< mean number of points in a cell that has some
  int max_pieces = 20000;
  /// Sigma of a point along the surface's normal. Nothing: the cloud's field sigma_mm (along the viewing ray) or, where it is larger
  /// or there is no such field, the scatter round the pieces.
  std::optional<double> sigma_mm = {};

  /// kUsage where a value is out of its range.
  [[nodiscard]] base::Result<> validate() const;
};

/// A small piece of a scanned surface: the plane through the points of one cell, in the scan's own frame.
struct SurfacePiece {
  Eigen::Vector3d point_mm = Eigen::Vector3d::Zero();  ///< mean of its points
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();
  double sigma_mm = 0.0;  ///< of point_mm along the normal, its points taken as independent
  double tilt_rad =
      0.0;  ///< sigma of the normal of its own points in either direction; neighbours steady it, but then err together
  int count = 0;
  bool border = false;  ///< the surface ends here: it has no neighbours on one side
};

/// A scan as the alignment needs it: a few thousand pieces in place of a million points, with a search tree.
///
/// A piece of a curved surface: the mean of its points lies below the surface, by half of trace(K C) with K the curvature (how the normals of
/// the neighbouring pieces change) and C the second moments of the points in the piece; and where points lie to one side the fitted plane
/// tilts. Both are taken away. The neighbours' normals, carried over with K, steady the normal.
///
/// The cells are cubes of a grid that is turned against the axes, so that no flat part lies along its walls. A cell whose points do not
/// span a plane (on a line, thick, fewer than six) gives no piece. Pieces of one scan share no points, so their noise is independent
/// as far as that of the points is.
class Surface {
 public:
  /// Errors: kUsage for options; kBadInput for clouds with fewer than 100 points, values that are not finite, or without surface.
  static base::Result<Surface> make(const base::Cloud& cloud, const SurfaceOptions& options = {});

  [[nodiscard]] const std::vector<SurfacePiece>& pieces() const { return pieces_; }
  [[nodiscard]] double cell_mm() const { return cell_mm_; }
  /// Sigma of a single point along the normal: median.
  [[nodiscard]] double noise_mm() const { return noise_mm_; }
  /// Normals point to the head; false: their sign is arbitrary.
  [[nodiscard]] bool oriented() const { return oriented_; }
  [[nodiscard]] std::size_t points() const { return points_; }
  [[nodiscard]] const Eigen::Vector3d& centre_mm() const { return centre_mm_; }
  [[nodiscard]] const Eigen::Vector3d& least_mm() const { return least_mm_; }
  [[nodiscard]] const Eigen::Vector3d& most_mm() const { return most_mm_; }
  /// A number that equal clouds share, and no others.
  [[nodiscard]] std::uint64_t fingerprint() const { return fingerprint_; }
  /// Index of the piece nearest to `point_mm`, -1 where none lies within `radius_mm`.
  [[nodiscard]] int nearest(const Eigen::Vector3d& point_mm, double radius_mm) const;

 private:
  struct Tree;
  Surface() = default;
  struct Moments;
  void find_borders();
  void unbend(std::vector<Moments>& moments);
  void build_tree();

  std::vector<SurfacePiece> pieces_;
  double cell_mm_ = 0.0;
  double noise_mm_ = 0.0;
  bool oriented_ = false;
  std::size_t points_ = 0;
  Eigen::Vector3d centre_mm_ = Eigen::Vector3d::Zero();
  Eigen::Vector3d least_mm_ = Eigen::Vector3d::Zero();
  Eigen::Vector3d most_mm_ = Eigen::Vector3d::Zero();
  std::uint64_t fingerprint_ = 0;
  std::shared_ptr<const Tree> tree_;
};

}  // namespace crosstie::registration
