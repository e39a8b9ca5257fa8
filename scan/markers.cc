#include "scan/markers.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <numbers>
#include <optional>
#include <utility>

#include <fmt/format.h>
#include <Eigen/Geometry>

#include "math/head_point.h"
#include "math/median.h"
#include "math/triangulate.h"
#include "scan/detail/calibration_part.h"
#include "scan/detail/marker_surface.h"
#include "scan/detail/rectification.h"

namespace crosstie::scan {
namespace {

using base::ImageObservations;
using base::Observation;
using base::ObservationStatus;
using base::ScannedMarker;

/// An ellipse in an image, larger by a factor and a margin.
class Disc {
 public:
  Disc(const Observation& seen, double factor, double margin_px)
      : centre_px_(seen.centre_px),
        along_(std::cos(seen.angle_rad), std::sin(seen.angle_rad)),
        a_px_(factor * seen.semi_major_px + margin_px),
        b_px_(factor * seen.semi_minor_px + margin_px) {}

  [[nodiscard]] bool holds(const Eigen::Vector2d& pixel) const {
    const Eigen::Vector2d d = pixel - centre_px_;
    const double u = d.dot(along_) / a_px_;
    const double v = (d.y() * along_.x() - d.x() * along_.y()) / b_px_;
    return u * u + v * v <= 1.0;
  }
  /// Calls `visit(column, row)` for every pixel of an image of this size that it holds.
  template <typename Visit>
  void each(int width, int height, Visit&& visit) const {
    const int left = std::max(0, static_cast<int>(std::ceil(centre_px_.x() - a_px_)));
    const int right = std::min(width - 1, static_cast<int>(std::floor(centre_px_.x() + a_px_)));
    const int top = std::max(0, static_cast<int>(std::ceil(centre_px_.y() - a_px_)));
    const int bottom = std::min(height - 1, static_cast<int>(std::floor(centre_px_.y() + a_px_)));
    for (int row = top; row <= bottom; ++row) {
      for (int column = left; column <= right; ++column) {
        if (holds(Eigen::Vector2d(column, row))) visit(column, row);
      }
    }
  }

 private:
  Eigen::Vector2d centre_px_;
  Eigen::Vector2d along_;
  double a_px_;
  double b_px_;
};

bool was_read(const Observation& seen) {
  return seen.status == ObservationStatus::kCoded || seen.status == ObservationStatus::kAmbiguous ||
         seen.status == ObservationStatus::kRefused;
}

/// What hides the wall in one image.
std::vector<Observation> plates(const ImageObservations& image) {
  constexpr double kAlike = 2.0;
  std::vector<double> sizes;
  for (const Observation& seen : image.observations) {
    if (seen.status == ObservationStatus::kCoded && seen.semi_major_px > 0.0) sizes.push_back(seen.semi_major_px);
  }
  const double usual = sizes.empty() ? 0.0 : math::median(sizes);
  std::vector<Observation> found;
  for (const Observation& seen : image.observations) {
    if (!(seen.semi_major_px > 0.0)) continue;
    const bool alike = seen.semi_major_px < kAlike * usual && seen.semi_major_px * kAlike > usual;
    if (was_read(seen) || alike) found.push_back(seen);
  }
  return found;
}

const std::vector<double>& field(const base::Cloud& cloud, const char* name) {
  return std::find_if(cloud.fields.begin(), cloud.fields.end(), [&](const auto& one) { return one.name == name; })->values;
}

/// The coded observations of an image by id, without those that occur twice.
std::map<int, Observation> by_id(const ImageObservations& image) {
  std::map<int, Observation> found;
  std::map<int, int> counts;
  for (const Observation& seen : image.observations) {
    if (seen.status != ObservationStatus::kCoded) continue;
    found[seen.id] = seen;
    ++counts[seen.id];
  }
  std::erase_if(found, [&](const auto& entry) { return counts[entry.first] > 1; });
  return found;
}

/// A circle about `centre`, both in a camera's frame: from the image of the centre to the middle of the circle's ellipse. The dual
/// conic of the image is X X' - r^2 (I - n n') (Hartley & Zisserman, Multiple View Geometry, 2nd ed., ch. 8.2).
std::optional<Eigen::Vector2d> eccentricity_px(const base::Camera& camera, const Eigen::Vector3d& centre,
                                               const Eigen::Vector3d& normal, double radius_mm) {
  const Eigen::Matrix3d circle = radius_mm * radius_mm * (Eigen::Matrix3d::Identity() - normal * normal.transpose());
  const auto of_ellipse = camera.project((centre * centre.transpose() - circle).col(2));
  const auto of_circle = camera.project(centre);
  if (!of_ellipse || !of_circle) return {};
  return *of_ellipse - *of_circle;
}

/// Radius of the circle about `centre` that appears with this major semi-axis.
double radius_mm_of(const base::Camera& camera, const Eigen::Vector3d& centre, const Eigen::Vector3d& normal, double major_px) {
  Eigen::Matrix<double, 2, 3> by_point;
  if (!camera.project(centre, &by_point)) return 0.0;
  const Eigen::Matrix2d square = by_point * (Eigen::Matrix3d::Identity() - normal * normal.transpose()) * by_point.transpose();
  const double half = 0.5 * square.trace();
  return major_px / std::sqrt(half + std::sqrt(std::max(0.0, half * half - square.determinant())));
}

/// How much the calibration's uncertainty moves the distance from the epipolar curve: by differences over the head's parameters.
double calibration_off_curve_px(const base::Head& head, const math::HeadSight& sight) {
  constexpr double kStep = 0.1;  // of a parameter's sigma
  if (head.cov.size() == 0) return 0.0;
  const Eigen::Matrix2d none = Eigen::Matrix2d::Zero();
  Eigen::VectorXd slope = Eigen::VectorXd::Zero(head.cov.cols());
  for (Eigen::Index i = 0; i < head.cov.cols(); ++i) {
    const double step = kStep * std::sqrt(std::max(0.0, head.cov(i, i)));
    if (step == 0.0) continue;
    std::array<double, 2> ends = {};
    for (const std::size_t side : {0U, 1U}) {
      const auto moved = math::moved_head(head, i, side == 0 ? -step : step);
      const auto frame = moved ? detail::rectify(moved->right_from_left) : base::fail(base::ErrorCode::kBadInput, "");
      const auto off = frame ? detail::off_curve(*moved, *frame, sight.pixel[0], none, sight.pixel[1], none) : std::nullopt;
      if (!off) return 0.0;
      ends[side] = off->distance_px;
    }
    slope(i) = (ends[1] - ends[0]) / (2.0 * step);
  }
  return std::sqrt(std::max(0.0, slope.dot(head.cov * slope)));
}

}  // namespace

base::Result<> MarkerOptions::validate() const {
  const auto bad = [](const std::string& what) { return base::fail(base::ErrorCode::kUsage, "marker options: " + what); };
  if (!(mask_radii >= 1.0 && mask_radii < 100.0)) return bad(fmt::format("mask_radii is {}, not in 1..100", mask_radii));
  if (!(mask_margin_px >= 0.0 && mask_margin_px <= 100.0))
    return bad(fmt::format("mask_margin_px is {}, not in 0..100", mask_margin_px));
  if (!(surface_radii > mask_radii && surface_radii < 1000.0))
    return bad(fmt::format("surface_radii is {}, it must be more than mask_radii", surface_radii));
  if (!(thickness_mm >= 0.0 && std::isfinite(thickness_mm)))
    return bad(fmt::format("thickness_mm is {}, it must be 0 or more", thickness_mm));
  if (!(dot_radius_mm >= 0.0 && std::isfinite(dot_radius_mm)))
    return bad(fmt::format("dot_radius_mm is {}, it must be 0 or more", dot_radius_mm));
  return {};
}

std::int64_t mask_markers(ScanCloud& scan, const base::Head& head, const ImageObservations& left,
                          const ImageObservations& right, const MarkerOptions& options) {
  const int width = head.left.width_px();
  const int height = head.left.height_px();
  std::vector<char> masked(scan.depth_mm.size(), 0);
  for (const Observation& plate : plates(left)) {
    Disc(plate, options.mask_radii, options.mask_margin_px).each(width, height, [&](int column, int row) {
      masked[static_cast<std::size_t>(row) * static_cast<std::size_t>(width) + static_cast<std::size_t>(column)] = 1;
    });
  }
  const std::map<int, Observation> seen_left = by_id(left);
  std::vector<Disc> right_alone;
  for (const Observation& plate : plates(right)) {
    if (plate.status == ObservationStatus::kCoded && seen_left.contains(plate.id)) continue;
    right_alone.emplace_back(plate, options.mask_radii, options.mask_margin_px);
  }

  base::Cloud& cloud = scan.cloud;
  const std::vector<double>& column = field(cloud, "column");
  const std::vector<double>& row = field(cloud, "row");
  std::vector<char> keep(cloud.points.size(), 1);
  for (std::size_t i = 0; i < keep.size(); ++i) {
    const auto at = static_cast<std::size_t>(row[i]) * static_cast<std::size_t>(width) + static_cast<std::size_t>(column[i]);
    bool hidden = masked[at] != 0;
    if (!hidden && !right_alone.empty()) {
      const auto pixel = head.right.project(head.right_from_left * cloud.points[i]);
      hidden =
          pixel && std::any_of(right_alone.begin(), right_alone.end(), [&](const Disc& disc) { return disc.holds(*pixel); });
    }
    if (!hidden) continue;
    keep[i] = 0;
    scan.depth_mm[at] = std::numeric_limits<float>::quiet_NaN();
  }
  const auto count = std::count(keep.begin(), keep.end(), 0);
  if (count == 0) return 0;
  const auto thin = [&](auto& list) {
    if (list.empty()) return;
    std::size_t to = 0;
    for (std::size_t from = 0; from < keep.size(); ++from) {
      if (keep[from]) list[to++] = list[from];
    }
    list.resize(to);
  };
  thin(cloud.points);
  thin(cloud.normals);
  thin(cloud.cov_mm2);
  for (base::CloudField& one : cloud.fields) thin(one.values);
  return count;
}

base::Result<std::vector<ScannedMarker>> marker_points(const ScanCloud& scan, const base::Head& head,
                                                       const ImageObservations& left, const ImageObservations& right,
                                                       int filter_radius_px, const MarkerOptions& options) {
  if (auto ok = options.validate(); !ok) return base::fail(std::move(ok));
  const auto frame = detail::rectify(head.right_from_left);
  if (!frame) return tl::unexpected(frame.error());
  const std::map<int, Observation> lefts = by_id(left);
  const std::map<int, Observation> rights = by_id(right);
  const detail::PixelIndex index(scan, head.left.width_px());
  const double correlated = std::pow(2.0 * filter_radius_px + 1.0, 2);  // points that share their noise
  std::vector<ScannedMarker> found;
  for (const auto& [id, seen] : lefts) {
    const auto other = rights.find(id);
    if (other == rights.end()) continue;
    math::HeadSight sight{{seen.centre_px, other->second.centre_px}, {seen.cov_px2.inverse(), other->second.cov_px2.inverse()}};
    if (!sight.weight[0].allFinite() || !sight.weight[1].allFinite()) continue;
    const auto start = math::point_of_left_ray(head.left, head.right, head.right_from_left, sight.pixel[0], sight.pixel[1]);
    auto point = start && start->z() > 0.0 ? math::triangulate(head, sight, *start) : std::nullopt;
    if (!point) continue;

    std::vector<detail::SurfaceSample> samples;
    Disc(seen, options.surface_radii, 0.0).each(head.left.width_px(), head.left.height_px(), [&](int column, int row) {
      if (const auto at = index.at(column, row)) samples.push_back({scan.cloud.points[*at], index.sigma_mm()[*at]});
    });
    auto wall = detail::surface_beneath(samples, point->p_in_rig_mm);
    if (wall) {
      // With the normal the observations become those of the circle's centre.
      const double radius_mm = options.dot_radius_mm > 0.0
                                   ? options.dot_radius_mm
                                   : radius_mm_of(head.left, point->p_in_rig_mm, wall->normal, seen.semi_major_px);
      const auto shift_left = eccentricity_px(head.left, point->p_in_rig_mm, wall->normal, radius_mm);
      const auto shift_right = eccentricity_px(head.right, head.right_from_left * point->p_in_rig_mm,
                                               head.right_from_left.rotation * wall->normal, radius_mm);
      if (shift_left && shift_right) {
        sight.pixel[0] -= *shift_left;
        sight.pixel[1] -= *shift_right;
        if (const auto again = math::triangulate(head, sight, point->p_in_rig_mm)) point = again;
        wall = detail::surface_beneath(samples, point->p_in_rig_mm);
      }
    }
    ScannedMarker marker;
    marker.id = id;
    marker.p_in_rig_mm = point->p_in_rig_mm;
    marker.cov_mm2 = point->cov_mm2;
    marker.calibration_cov_mm2 = detail::calibration_covariance(head, point->p_in_rig_mm);
    if (const auto off = detail::off_curve(head, *frame, sight.pixel[0], seen.cov_px2, sight.pixel[1], other->second.cov_px2)) {
      marker.off_curve_px = off->distance_px;
      marker.off_curve_sigma_px = off->sigma_px;
      marker.off_curve_calibration_px = calibration_off_curve_px(head, sight);
    }
    if (wall) {
      marker.normal = wall->normal;
      marker.wall_in_rig_mm = marker.p_in_rig_mm - options.thickness_mm * wall->normal;
      marker.height_mm = wall->height_mm;
      marker.height_sigma_mm = std::sqrt(correlated * wall->variance_mm2 + wall->normal.dot(marker.cov_mm2 * wall->normal));
    }
    found.push_back(std::move(marker));
  }
  return found;
}

}  // namespace crosstie::scan
