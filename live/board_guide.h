#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "base/board.h"
#include "base/result.h"
#include "devices/camera_pair.h"

namespace crosstie::live {

/// The board at one moment, as the cameras' corners show it: left, right. A view without corners: that camera does not see it.
struct BoardSight {
  std::array<base::BoardImage, 2> views;
};

struct BoardGuideOptions {
  base::Board board;
  /// [px] Of left, right, to a tenth; 0: as the perspective of the poses tells it, until then that of a lens 60 degrees wide.
  std::array<double, 2> focal_px = {};
  int poses = 25;     ///< that are wanted (docs/commissioning.md, section 3)
  int each_tilt = 4;  ///< of these, tilted to each of the four sides
  int rolled = 5;     ///< of these, turned by 90 degrees about the line of sight

  [[nodiscard]] base::Result<> validate() const;
};

/// To which side the board's front faces, past the camera: kLeft is a board whose left side, as the camera sees it, is farther away.
enum class BoardTilt { kLeft, kRight, kUp, kDown };

/// How a board is held.
struct BoardPose {
  std::optional<BoardTilt> tilt;  ///< nothing below 20 degrees between its normal and the line of sight
  double tilt_rad = 0.0;
  double roll_rad = 0.0;  ///< of its rows against the image's, -pi/2..pi/2: half a turn cannot be told
};

/// The pose that is wanted next.
struct WantedPose {
  BoardTilt tilt = BoardTilt::kLeft;
  bool rolled = false;  ///< turned by 90 degrees against most poses
  devices::Side camera = devices::Side::kLeft;
  std::array<int, 2> cell = {};  ///< column and row in BoardGuide's grid of that camera
  std::string words;             ///< for people
};

struct BoardGuide {
  static constexpr int kColumns = 8;
  static constexpr int kRows = 6;
  /// For each camera and cell, row by row: in how many poses corners lie in it.
  std::array<std::array<int, 48>, 2> coverage = {};
  int poses = 0;                          ///< that at least one camera sees
  std::array<int, 4> tilts = {};          ///< counted by BoardTilt
  int rolled = 0;                         ///< by 60 degrees or more against most poses
  std::optional<WantedPose> wanted = {};  ///< nothing: enough was taken
  /// What calib::calibrate would warn of with these poses: few_views, little_tilt, not_rolled, poor_coverage; `subject` is the camera.
  std::vector<base::Warning> missing = {};
};

/// What board poses were taken, and which one is wanted next: tilted by 30 to 45 degrees in both directions, turned by 90 degrees in some,
/// into every corner of both images. Pure: the same poses give the same guide, so that undo is a shorter list.
/// First the middle, then the corners of both images, then the emptiest cells; each with the tilt that was taken least often, and every
/// fifth pose turned. Poses are those of a pinhole without distortion (calib::coarse_pose), good to a few degrees.
/// Errors: kUsage for options; kBadInput for views of different sizes.
[[nodiscard]] base::Result<BoardGuide> guide_board(const std::vector<BoardSight>& sights, const BoardGuideOptions& options);

/// How a camera sees the board; nothing where it does not.
[[nodiscard]] std::optional<BoardPose> board_pose(const base::BoardImage& view, const base::Board& board, double focal_px);

}  // namespace crosstie::live
