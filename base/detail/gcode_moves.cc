#include "base/detail/gcode_moves.h"

#include <array>
#include <cmath>
#include <numbers>
#include <optional>

#include <fmt/format.h>
#include <Eigen/Geometry>

namespace crosstie::base::detail {
namespace {

constexpr double kDegrees = 180.0 / std::numbers::pi;
constexpr double kAngleTolerance_deg = 0.05;  // of the torch on an arc, beside its proportional turn
constexpr double kMostRadius_mm = 1e5;
constexpr double kHalfTurn = 0.98 * std::numbers::pi;
constexpr std::size_t kLeastRun = 3;  // points after the first one, from which on an arc is worth it

/// First, second and third axis of a plane of arcs, right-handed.
std::array<int, 3> axes_of(int plane) {
  if (plane == 18) return {2, 0, 1};
  if (plane == 19) return {1, 2, 0};
  return {0, 1, 2};
}

double unwrapped(double angle_deg, double before_deg) {
  return angle_deg - 360.0 * std::round((angle_deg - before_deg) / 360.0);
}

struct Arc {
  Eigen::Vector2d centre = Eigen::Vector2d::Zero();
  double sweep = 0.0;  ///< counter-clockwise in the plane
};

class ArcFinder {
 public:
  ArcFinder(const ToolPath& path, int plane, double tolerance_mm)
      : path_(path), axes_(axes_of(plane)), tolerance_mm_(tolerance_mm), angles_(torch_angles(path)) {}

  [[nodiscard]] Eigen::Vector2d flat(std::size_t i) const {
    const Eigen::Vector3d& p = path_.points[i].point_mm;
    return {p(axes_[0]), p(axes_[1])};
  }

  /// The arc through both ends and the middle point, where it follows all points between.
  [[nodiscard]] std::optional<Arc> arc(std::size_t from, std::size_t to) const {
    const Eigen::Vector2d a = flat(from);
    const Eigen::Vector2d b = flat((from + to) / 2) - a;
    const Eigen::Vector2d c = flat(to) - a;
    const double twice_area = b.x() * c.y() - b.y() * c.x();
    if (std::abs(twice_area) < 1e-12 * (b.squaredNorm() + c.squaredNorm())) return std::nullopt;
    Arc arc;
    const Eigen::Vector2d to_centre =
        Eigen::Vector2d(c.y() * b.squaredNorm() - b.y() * c.squaredNorm(), b.x() * c.squaredNorm() - c.x() * b.squaredNorm()) /
        (2.0 * twice_area);
    arc.centre = a + to_centre;
    const double radius = to_centre.norm();
    if (!(radius < kMostRadius_mm)) return std::nullopt;
    std::vector<double> sweeps = {0.0};
    for (std::size_t i = from + 1; i <= to; ++i) {
      const Eigen::Vector2d r0 = flat(i - 1) - arc.centre;
      const Eigen::Vector2d r1 = flat(i) - arc.centre;
      if (std::abs(r1.norm() - radius) > tolerance_mm_) return std::nullopt;
      const double step = std::atan2(r0.x() * r1.y() - r0.y() * r1.x(), r0.dot(r1));
      if (step * twice_area <= 0.0) return std::nullopt;
      sweeps.push_back(sweeps.back() + step);
    }
    arc.sweep = sweeps.back();
    if (std::abs(arc.sweep) > kHalfTurn) return std::nullopt;
    for (std::size_t i = from + 1; i < to; ++i) {
      const double share = sweeps[i - from] / arc.sweep;
      const auto off = [&](double first, double here, double last) { return std::abs(first + share * (last - first) - here); };
      const int third = axes_[2];
      if (off(path_.points[from].point_mm(third), path_.points[i].point_mm(third), path_.points[to].point_mm(third)) >
          tolerance_mm_) {
        return std::nullopt;
      }
      if (off(angles_[from].a_deg, angles_[i].a_deg, angles_[to].a_deg) > kAngleTolerance_deg ||
          off(angles_[from].b_deg, angles_[i].b_deg, angles_[to].b_deg) > kAngleTolerance_deg ||
          off(angles_[from].tilt_deg, angles_[i].tilt_deg, angles_[to].tilt_deg) > kAngleTolerance_deg) {
        return std::nullopt;
      }
      if (path_.points[i].speed_mm_per_s != path_.points[to].speed_mm_per_s) return std::nullopt;
    }
    return arc;
  }

  [[nodiscard]] std::string words(std::size_t from, std::size_t to, const Arc& arc) const {
    const Eigen::Vector3d& end = path_.points[to].point_mm;
    const Eigen::Vector2d to_centre = arc.centre - flat(from);
    Eigen::Vector3d offset = Eigen::Vector3d::Zero();
    offset(axes_[0]) = to_centre.x();
    offset(axes_[1]) = to_centre.y();
    std::string text = fmt::format("{} X{} Y{} Z{}", arc.sweep > 0.0 ? "G3" : "G2", gcode_number(end.x()),
                                   gcode_number(end.y()), gcode_number(end.z()));
    for (int axis = 0; axis < 3; ++axis) {
      if (axis != axes_[2]) text += fmt::format(" {}{}", "IJK"[axis], gcode_number(offset(axis)));
    }
    return text;
  }

 private:
  const ToolPath& path_;
  std::array<int, 3> axes_;
  double tolerance_mm_;
  std::vector<TorchAngles> angles_;
};

}  // namespace

std::string gcode_number(double value) {
  std::string text = fmt::format("{:.5f}", value);
  return text == "-0.00000" ? "0.00000" : text;
}

std::vector<TorchAngles> torch_angles(const ToolPath& path) {
  std::vector<TorchAngles> all;
  for (const ToolPathPoint& p : path.points) {
    const Eigen::Vector3d& t = p.torch;
    TorchAngles angles;
    angles.b_deg = kDegrees * std::asin(std::clamp(t.x(), -1.0, 1.0));
    angles.a_deg = kDegrees * std::atan2(-t.y(), t.z());
    angles.tilt_deg = kDegrees * std::acos(std::clamp(t.z(), -1.0, 1.0));
    angles.azimuth_deg = kDegrees * std::atan2(t.y(), t.x());
    if (!all.empty()) {
      angles.a_deg = unwrapped(angles.a_deg, all.back().a_deg);
      angles.azimuth_deg = unwrapped(angles.azimuth_deg, all.back().azimuth_deg);
    }
    all.push_back(angles);
  }
  return all;
}

int arc_plane(const ToolPath& path) {
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();
  for (const ToolPathPoint& p : path.points) normal += p.normal;
  Eigen::Index axis = 2;
  normal.cwiseAbs().maxCoeff(&axis);
  return axis == 2 ? 17 : (axis == 1 ? 18 : 19);
}

std::vector<GcodeMove> gcode_moves(const ToolPath& path, int plane, double arc_tolerance_mm) {
  const ArcFinder finder(path, plane, arc_tolerance_mm);
  std::vector<GcodeMove> moves;
  std::size_t at = 0;
  const std::size_t last = path.points.size() - 1;
  while (at < last) {
    std::optional<Arc> best;
    std::size_t to = at + 1;
    if (arc_tolerance_mm > 0.0) {
      for (std::size_t next = at + kLeastRun; next <= last; ++next) {
        const auto longer = finder.arc(at, next);
        if (!longer) break;
        best = longer;
        to = next;
      }
    }
    if (best) {
      moves.push_back({to, finder.words(at, to, *best)});
    } else {
      const Eigen::Vector3d& p = path.points[to].point_mm;
      moves.push_back({to, fmt::format("G1 X{} Y{} Z{}", gcode_number(p.x()), gcode_number(p.y()), gcode_number(p.z()))});
    }
    at = to;
  }
  return moves;
}

}  // namespace crosstie::base::detail
