#include "calib/board_views.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <utility>

#include <Eigen/Geometry>

#include "calib/detail/homography.h"

namespace crosstie::calib {
namespace {

std::optional<detail::Homography> homography_of(const base::BoardImage& view, const Eigen::Matrix3Xd& points) {
  const auto count = static_cast<Eigen::Index>(view.corners.size());
  Eigen::Matrix2Xd plane(2, count), pixels(2, count);
  for (Eigen::Index i = 0; i < count; ++i) {
    const base::BoardCorner& corner = view.corners[static_cast<std::size_t>(i)];
    if (corner.index < 0 || corner.index >= points.cols()) return {};
    plane.col(i) = points.col(corner.index).head<2>();
    pixels.col(i) = corner.px;
  }
  return detail::fit_homography(plane, pixels);
}

Eigen::Vector2d middle_of(const base::BoardImage& view) { return {0.5 * (view.width_px - 1), 0.5 * (view.height_px - 1)}; }

}  // namespace

ViewSpread spread_of(std::span<const base::Pose> board_from_camera) {
  ViewSpread spread;
  for (const base::Pose& a : board_from_camera) {
    for (const base::Pose& b : board_from_camera) {
      const Eigen::Vector3d normal_a = a.rotation.conjugate() * Eigen::Vector3d::UnitZ();
      const Eigen::Vector3d normal_b = b.rotation.conjugate() * Eigen::Vector3d::UnitZ();
      spread.tilt_rad = std::max(spread.tilt_rad, std::atan2(normal_a.cross(normal_b).norm(), normal_a.dot(normal_b)));
      const Eigen::Vector3d right_a = a.rotation * Eigen::Vector3d::UnitX();
      const Eigen::Vector3d right_b = b.rotation * Eigen::Vector3d::UnitX();
      const double turn = std::atan2(right_a.y(), right_a.x()) - std::atan2(right_b.y(), right_b.x());
      spread.roll_rad = std::max(spread.roll_rad, std::abs(std::remainder(turn, 2.0 * std::numbers::pi)));
    }
  }
  return spread;
}

std::vector<std::string_view> empty_corners(const base::CalibratedArea& area) {
  constexpr int kLast = base::CalibratedArea::kCells - 2;
  constexpr std::array<std::pair<std::array<int, 2>, std::string_view>, 4> kCorners = {
      {{{1, 1}, "upper left"}, {{kLast, 1}, "upper right"}, {{1, kLast}, "lower left"}, {{kLast, kLast}, "lower right"}}};
  std::vector<std::string_view> empty;
  for (const auto& [cell, name] : kCorners) {
    if (area.count(cell[0], cell[1]) == 0) empty.push_back(name);
  }
  return empty;
}

std::optional<base::Pose> coarse_pose(const base::BoardImage& view, const base::Board& board, double focal_px) {
  const auto homography = homography_of(view, board.nominal_points());
  return homography ? detail::plane_pose(homography->h, focal_px, middle_of(view)) : std::nullopt;
}

std::optional<double> coarse_focal_px(std::span<const base::BoardImage> views, const base::Board& board) {
  const Eigen::Matrix3Xd points = board.nominal_points();
  std::vector<Eigen::Matrix3d> homographies;
  for (const base::BoardImage& view : views) {
    if (const auto homography = homography_of(view, points)) homographies.push_back(homography->h);
  }
  return views.empty() ? std::nullopt : detail::focal_from_homographies(homographies, middle_of(views.front()));
}

}  // namespace crosstie::calib
