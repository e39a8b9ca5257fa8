#include "live/board_guide.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <numbers>
#include <string_view>
#include <utility>

#include <fmt/format.h>
#include <Eigen/Geometry>

#include "base/calibrated_area.h"
#include "calib/board_views.h"

namespace crosstie::live {
namespace {

constexpr int kColumns = BoardGuide::kColumns;
constexpr int kRows = BoardGuide::kRows;
constexpr std::array<std::string_view, 2> kCameras = {"left", "right"};
constexpr std::array<std::string_view, 4> kSides = {"left", "right", "upper", "lower"};

std::size_t cell_of(const base::BoardImage& view, const Eigen::Vector2d& px) {
  const auto along = [](double at, int size, int cells) {
    return std::clamp(static_cast<int>((at + 0.5) / size * cells), 0, cells - 1);
  };
  return static_cast<std::size_t>(along(px.y(), view.height_px, kRows) * kColumns + along(px.x(), view.width_px, kColumns));
}

std::array<bool, 48> touched(const base::BoardImage& view) {
  std::array<bool, 48> cells = {};
  for (const base::BoardCorner& corner : view.corners) cells[cell_of(view, corner.px)] = true;
  return cells;
}

std::vector<base::BoardImage> views_of(const std::vector<BoardSight>& sights, std::size_t side) {
  std::vector<base::BoardImage> views;
  for (const BoardSight& sight : sights) {
    if (!sight.views[side].corners.empty()) views.push_back(sight.views[side]);
  }
  return views;
}

/// As stated, as the views tell where that can be a lens, or of 60 degrees.
double focal_of(const std::vector<base::BoardImage>& views, std::size_t side, const BoardGuideOptions& options) {
  constexpr std::size_t kEnough = 5;  // views before their perspective is asked
  if (options.focal_px[side] > 0.0 || views.empty()) return options.focal_px[side] > 0.0 ? options.focal_px[side] : 1000.0;
  const double width_px = std::max(views.front().width_px, views.front().height_px);
  const double usual_px = 0.5 * width_px / std::tan(std::numbers::pi / 6.0);
  const auto told_px = views.size() < kEnough ? std::nullopt : calib::coarse_focal_px(views, options.board);
  return told_px && *told_px > 0.5 * usual_px && *told_px < 4.0 * usual_px ? *told_px : usual_px;
}

/// Between two directions of rows, 0..pi/2: half a turn cannot be told.
double turn_between(double a_rad, double b_rad) { return std::abs(std::remainder(a_rad - b_rad, std::numbers::pi)); }

/// The roll of most poses: the one that most others are within 60 degrees of, the first of equals.
double usual_roll(const std::vector<double>& rolls) {
  double usual = 0.0;
  std::ptrdiff_t most = -1;
  for (const double roll : rolls) {
    const auto near =
        std::count_if(rolls.begin(), rolls.end(), [&](double other) { return turn_between(roll, other) < calib::kRolled_rad; });
    if (near <= most) continue;
    most = near;
    usual = roll;
  }
  return usual;
}

/// The pose of each sight, of the left camera where it sees the board; without those whose corners show none.
std::vector<BoardPose> poses_of(const std::vector<BoardSight>& sights, const std::array<double, 2>& focal_px,
                                const base::Board& board) {
  std::vector<BoardPose> poses;
  for (const BoardSight& sight : sights) {
    for (const std::size_t side : {0U, 1U}) {
      if (sight.views[side].corners.empty()) continue;
      if (const auto pose = board_pose(sight.views[side], board, focal_px[side])) {
        poses.push_back(*pose);
        break;
      }
    }
  }
  return poses;
}

std::vector<double> rolls_of(const std::vector<BoardPose>& poses) {
  std::vector<double> rolls;
  std::transform(poses.begin(), poses.end(), std::back_inserter(rolls), [](const BoardPose& pose) { return pose.roll_rad; });
  return rolls;
}

/// What calibrate() would say of one camera.
void add_missing(const std::vector<base::BoardImage>& views, std::size_t side, double focal_px, const base::Board& board,
                 const base::CalibratedArea& area, BoardGuide& guide) {
  const std::string name(kCameras[side]);
  std::vector<base::Pose> poses;
  for (const base::BoardImage& view : views) {
    if (const auto pose = calib::coarse_pose(view, board, focal_px)) poses.push_back(pose->inverse());
  }
  const auto warn = [&](const char* code, std::string message) { guide.missing.push_back({code, name, std::move(message)}); };
  if (static_cast<int>(views.size()) < calib::kFewViews) {
    warn("few_views", fmt::format("{} camera: {} poses so far, {} at least", name, views.size(), calib::kFewViews));
  }
  const auto [tilt_rad, roll_rad] = calib::spread_of(poses);
  if (tilt_rad < calib::kLittleTilt_rad) warn("little_tilt", fmt::format("{} camera: the board was not tilted", name));
  if (roll_rad < calib::kRolled_rad) warn("not_rolled", fmt::format("{} camera: the board was not turned", name));
  const auto corners = calib::empty_corners(area);
  if (area.inner_share() < calib::kPoorCoverage || !corners.empty()) {
    warn("poor_coverage",
         fmt::format("{} camera: the board was seen in {:.0f} % of the image{}{}", name, 100.0 * area.inner_share(),
                     corners.empty() ? "" : ", never in the corners ", fmt::join(corners, ", ")));
  }
}

struct Place {
  std::size_t side = 0;
  std::array<int, 2> cell = {};
};

/// Where the next pose is wanted: the middle, then corners, then the emptiest cell, the outermost of equals.
Place next_place(const BoardGuide& guide, const std::array<base::CalibratedArea, 2>& areas) {
  if (guide.poses == 0) return {0, {kColumns / 2, kRows / 2}};
  constexpr int kLast = base::CalibratedArea::kCells - 2;
  for (const int corner : {0, 1, 2, 3}) {
    const int right = corner % 2, low = corner / 2;
    for (const std::size_t side : {0U, 1U}) {
      if (areas[side].count(right ? kLast : 1, low ? kLast : 1) == 0) {
        return {side, {right ? kColumns - 1 : 0, low ? kRows - 1 : 0}};
      }
    }
  }
  Place best;
  double least = std::numeric_limits<double>::infinity();
  for (const std::size_t side : {0U, 1U}) {
    for (int row = 0; row < kRows; ++row) {
      for (int column = 0; column < kColumns; ++column) {
        const double x = (column + 0.5) / kColumns - 0.5, y = (row + 0.5) / kRows - 0.5;
        const double count = guide.coverage[side][static_cast<std::size_t>(row * kColumns + column)] - 0.5 * (x * x + y * y);
        if (count >= least) continue;
        least = count;
        best = {side, {column, row}};
      }
    }
  }
  return best;
}

std::string words_of_place(const Place& place) {
  const auto third = [](int at, int cells) { return 3 * at / cells; };
  const int across = third(place.cell[0], kColumns), down = third(place.cell[1], kRows);
  const char* const row = down == 0 ? "upper" : down == 2 ? "lower" : "";
  const char* const column = across == 0 ? "left" : across == 2 ? "right" : "";
  const std::string image = fmt::format("of the {} image", kCameras[place.side]);
  if (down != 1 && across != 1) return fmt::format("in the {} {} corner {}", row, column, image);
  if (down == 1 && across == 1) return fmt::format("in the middle {}", image);
  return fmt::format("at the {} edge {}", down != 1 ? row : column, image);
}

WantedPose next_pose(const BoardGuide& guide, const std::array<base::CalibratedArea, 2>& areas) {
  constexpr int kEvery = 5;  // one of so many is turned
  const Place place = next_place(guide, areas);
  WantedPose wanted;
  wanted.tilt = static_cast<BoardTilt>(std::min_element(guide.tilts.begin(), guide.tilts.end()) - guide.tilts.begin());
  wanted.rolled = guide.poses >= 2 && kEvery * guide.rolled < guide.poses;
  wanted.camera = static_cast<devices::Side>(place.side);
  wanted.cell = place.cell;
  wanted.words = fmt::format("{}old the board {}, its {} side 30 to 45 degrees farther away.",
                             wanted.rolled ? "Turn the board by 90 degrees about the line of sight and h" : "H",
                             words_of_place(place), kSides[static_cast<std::size_t>(wanted.tilt)]);
  if (wanted.rolled) wanted.words.replace(wanted.words.find("hold the board"), 14, "hold it");
  return wanted;
}

}  // namespace

base::Result<> BoardGuideOptions::validate() const {
  if (auto valid = board.validate(); !valid) return valid;
  for (const double focal : focal_px) {
    if (!(focal >= 0.0 && std::isfinite(focal))) {
      return base::fail(base::ErrorCode::kUsage, fmt::format("board guide: a focal length of {} px", focal));
    }
  }
  if (poses < 1 || each_tilt < 0 || rolled < 0 || 4 * each_tilt > poses || rolled > poses) {
    return base::fail(
        base::ErrorCode::kUsage,
        fmt::format("board guide: {} poses cannot hold {} of each tilt and {} turned ones", poses, each_tilt, rolled));
  }
  return {};
}

std::optional<BoardPose> board_pose(const base::BoardImage& view, const base::Board& board, double focal_px) {
  const auto camera_from_board = calib::coarse_pose(view, board, focal_px);
  if (!camera_from_board) return {};
  const Eigen::Vector3d towards = -camera_from_board->translation_mm.normalized();
  const Eigen::Vector3d normal = -(camera_from_board->rotation * Eigen::Vector3d::UnitZ());
  const Eigen::Vector3d row = camera_from_board->rotation * Eigen::Vector3d::UnitX();
  BoardPose pose;
  pose.tilt_rad = std::atan2(normal.cross(towards).norm(), normal.dot(towards));
  pose.roll_rad = std::remainder(std::atan2(row.y(), row.x()), std::numbers::pi);
  if (pose.tilt_rad < calib::kLittleTilt_rad) return pose;
  const Eigen::Vector3d across = normal - normal.dot(towards) * towards;
  if (std::abs(across.x()) >= std::abs(across.y())) {
    pose.tilt = across.x() < 0.0 ? BoardTilt::kLeft : BoardTilt::kRight;
  } else {
    pose.tilt = across.y() < 0.0 ? BoardTilt::kUp : BoardTilt::kDown;
  }
  return pose;
}

base::Result<BoardGuide> guide_board(const std::vector<BoardSight>& sights, const BoardGuideOptions& options) {
  if (auto valid = options.validate(); !valid) return base::fail(std::move(valid));
  BoardGuide guide;
  std::array<base::CalibratedArea, 2> areas;
  std::array<double, 2> focal_px = {};
  for (const std::size_t side : {0U, 1U}) {
    const std::vector<base::BoardImage> views = views_of(sights, side);
    focal_px[side] = focal_of(views, side, options);
    if (!views.empty()) areas[side] = base::CalibratedArea(views.front().width_px, views.front().height_px);
    for (const base::BoardImage& view : views) {
      if (view.width_px != views.front().width_px || view.height_px != views.front().height_px || view.width_px <= 0 ||
          view.height_px <= 0) {
        return base::fail(
            base::ErrorCode::kBadInput,
            fmt::format("board poses: image {} of the {} camera has {} x {} px, not {} x {}", view.image, kCameras[side],
                        view.width_px, view.height_px, views.front().width_px, views.front().height_px));
      }
      const auto cells = touched(view);
      for (std::size_t i = 0; i < cells.size(); ++i) guide.coverage[side][i] += cells[i] ? 1 : 0;
      for (const base::BoardCorner& corner : view.corners) areas[side].add(corner.px);
    }
    add_missing(views, side, focal_px[side], options.board, areas[side], guide);
  }
  const std::vector<BoardPose> poses = poses_of(sights, focal_px, options.board);
  const double usual = usual_roll(rolls_of(poses));
  guide.poses = static_cast<int>(poses.size());
  for (const BoardPose& pose : poses) {
    if (pose.tilt) ++guide.tilts[static_cast<std::size_t>(*pose.tilt)];
    guide.rolled += turn_between(pose.roll_rad, usual) >= calib::kRolled_rad ? 1 : 0;
  }
  const bool enough = guide.poses >= options.poses && guide.rolled >= options.rolled && guide.missing.empty() &&
                      *std::min_element(guide.tilts.begin(), guide.tilts.end()) >= options.each_tilt;
  if (!enough) guide.wanted = next_pose(guide, areas);
  return guide;
}

}  // namespace crosstie::live
