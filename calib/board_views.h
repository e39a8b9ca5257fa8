#pragma once

#include <numbers>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "base/board.h"
#include "base/calibrated_area.h"
#include "base/pose.h"

namespace crosstie::calib {

/// What views of the board a calibration asks for, of each camera; below it warns (few_views, little_tilt, not_rolled, poor_coverage).
inline constexpr int kFewViews = 10;
inline constexpr double kLittleTilt_rad = std::numbers::pi / 9.0;  ///< 20 degrees between the normals of two views
inline constexpr double kRolled_rad = std::numbers::pi / 3.0;      ///< 60 degrees about the line of sight between two views
inline constexpr double kPoorCoverage = 0.7;  ///< of CalibratedArea's inner cells; and none of its corners empty

/// How differently views show the board: the largest angles between any two of them.
struct ViewSpread {
  double tilt_rad = 0.0;  ///< between the board's normals in the camera's frame
  double roll_rad = 0.0;  ///< between the directions of the image's rows on the board
};
[[nodiscard]] ViewSpread spread_of(std::span<const base::Pose> board_from_camera);

/// Corners of the image (the outermost inner cells) in which no observation lies: "upper left", "upper right", "lower left", "lower right".
[[nodiscard]] std::vector<std::string_view> empty_corners(const base::CalibratedArea& area);

/// camera_from_board as a pinhole of that focal length with its principal point in the image's middle sees it: to some degrees, without
/// any calibration. Nothing for fewer than four corners, corners of no plane, or a pose behind the camera.
[[nodiscard]] std::optional<base::Pose> coarse_pose(const base::BoardImage& view, const base::Board& board, double focal_px);

/// The focal length that the views' perspective tells (Zhang 2000); nothing where they are too few or too little tilted.
[[nodiscard]] std::optional<double> coarse_focal_px(std::span<const base::BoardImage> views, const base::Board& board);

}  // namespace crosstie::calib
