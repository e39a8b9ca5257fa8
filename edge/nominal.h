#pragma once

#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "base/pose.h"
#include "base/result.h"

namespace crosstie::edge {

enum class NominalKind {
  kCircle,        ///< sizes: diameter
  kEllipse,       ///< sizes: length, width (its full axes)
  kOval,          ///< two half circles joined by straights ("stadium"); sizes: length over all, width; length >= width
  kSuperellipse,  ///< |2x / length|^n + |2y / width|^n = 1, n >= 2; sizes: length, width
  kPoints,        ///< a list of points; no sizes
};

/// "circle", "ellipse", "oval", "superellipse", "points".
[[nodiscard]] std::string_view name_of(NominalKind kind);
/// The outline of that name; nothing for other words, such as a file's name.
[[nodiscard]] std::optional<NominalKind> outline_of(std::string_view name);
/// What Nominal::size_mm holds: "diameter", or "length" and "width".
[[nodiscard]] std::vector<std::string> size_names(NominalKind kind);

/// The tower (cylinder or cone) that the outline's prism is cut into, as the hole's frame sees it. The surface passes through the
/// frame's origin with its normal along z, so the tower's generator through the origin lies in the plane of x and y.
struct Saddle {
  double radius_mm = 0.0;  ///< from the tower's axis to the origin, across the axis; negative: the head is inside the tower
  double half_angle_rad = 0.0;  ///< of the cone, which widens along the generator; 0: a cylinder
  double direction_rad = 0.0;   ///< of the generator, from x towards y
};

/// What a hole should be. An outline lies in the hole's frame: origin in its centre, length along x, z towards the head; with a
/// saddle it is the curve in which the prism over the outline, along z, cuts the tower. A list of points has the frame of its file.
struct Nominal {
  NominalKind kind = NominalKind::kCircle;
  std::vector<double> size_mm = {};  ///< empty: not known before the fit
  double exponent = 2.5;             ///< of a superellipse
  std::optional<Saddle> saddle = std::nullopt;
  /// Of a list: in order along the curve; the first one is not repeated at the end.
  std::vector<Eigen::Vector3d> points_mm = {};
  std::vector<Eigen::Vector3d> normals = {};  ///< of the surface, towards the head; empty: not known
  bool closed = true;
  bool spline = true;  ///< a cubic spline through the points (C2, over the chords' lengths); false: straight lines
};

/// A place of a curve.
struct CurvePoint {
  double s_mm = 0.0;  ///< arc length from the curve's start
  Eigen::Vector3d point_mm = Eigen::Vector3d::Zero();
  Eigen::Vector3d tangent = Eigen::Vector3d::UnitX();  ///< along growing s, unit length
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();   ///< of the surface, unit length, across the tangent
};

namespace detail {
class Curve;
}

/// A nominal hole to be asked for its points, in the hole's frame. It begins on the x axis and runs counter-clockwise as seen from
/// the head; a list of points begins and runs as it is written. Where a list has no normals, they are those of its best plane, about
/// which a closed list runs counter-clockwise. Copies share their tables.
class NominalCurve {
 public:
  /// Errors: kBadInput for sizes that are absent, not positive or contradict each other, for an outline that does not meet the
  /// tower, for less than three points or two in one place, and for a list that crosses itself.
  static base::Result<NominalCurve> make(const Nominal& nominal);

  [[nodiscard]] double length_mm() const;
  [[nodiscard]] bool closed() const;
  /// By arc length to 1e-9 mm; closed curves go round, open ones end.
  [[nodiscard]] CurvePoint at(double s_mm) const;
  /// The nearest of its points.
  [[nodiscard]] CurvePoint nearest(const Eigen::Vector3d& p_in_hole) const;
  /// Where its direction changes by jumps (vertices of straight lines), as arc lengths.
  [[nodiscard]] const std::vector<double>& corners_mm() const;

 private:
  explicit NominalCurve(std::shared_ptr<const detail::Curve> curve) : curve_(std::move(curve)) {}
  std::shared_ptr<const detail::Curve> curve_;
};

/// The nominal as a mirror shows it: y becomes -y.
[[nodiscard]] Nominal mirrored(const Nominal& nominal);

/// Whether a chain of points crosses itself as seen along `normal`: the indices of the two segments, each that of its first point.
[[nodiscard]] std::optional<std::pair<std::size_t, std::size_t>> self_crossing(const std::vector<Eigen::Vector3d>& points_mm,
                                                                               bool closed, const Eigen::Vector3d& normal);

}  // namespace crosstie::edge
