// Boards are placed in front of two pinholes by their true poses; what the guide says is held against these.

#include "live/board_guide.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <set>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <Eigen/Geometry>

#include "calib/calibrate.h"
#include "fixtures/sampled.h"
#include "fixtures/scene.h"

namespace crosstie::live {
namespace {

using ::testing::HasSubstr;

constexpr double kDegree = std::numbers::pi / 180.0;
constexpr double kFocal = 1060.0;

base::Board board() {
  base::Board result;
  result.columns = 14;
  result.rows = 10;
  result.pitch_mm = 20.0;
  result.free = false;
  return result;
}

/// How a board is held in front of one camera: where its middle is seen, its tilt (a vector in the image, [deg]: the side that goes away)
/// and its roll.
struct Held {
  Eigen::Vector2d at_px{611.5, 511.5};
  Eigen::Vector2d away_deg{0.0, 0.0};
  double roll_deg = 0.0;
  double distance_mm = 1000.0;
};

base::BoardImage seen(const Held& held) {
  // Turned about an axis across the direction that goes away: for the left side, z grows with -x.
  const double tilt = held.away_deg.norm() * kDegree;
  Eigen::Matrix3d turn = Eigen::Matrix3d::Identity();
  if (tilt > 0.0) {
    const Eigen::Vector3d axis(held.away_deg.y(), -held.away_deg.x(), 0.0);
    turn = Eigen::AngleAxisd(tilt, axis.normalized()).toRotationMatrix();
  }
  turn = turn * Eigen::AngleAxisd(held.roll_deg * kDegree, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  const Eigen::Vector3d sight((held.at_px.x() - 611.5) / kFocal, (held.at_px.y() - 511.5) / kFocal, 1.0);
  // Against the line of sight.
  const Eigen::Matrix3d facing = Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d::UnitZ(), sight).toRotationMatrix();
  const Eigen::Matrix3Xd points = facing * turn * board().nominal_points();
  base::BoardImage image{.image = "board", .camera = {}, .width_px = 1224, .height_px = 1024, .corners = {}};
  for (Eigen::Index i = 0; i < points.cols(); ++i) {
    const Eigen::Vector3d p = points.col(i) + held.distance_mm * sight;
    image.corners.push_back({static_cast<int>(i), kFocal * p.hnormalized() + Eigen::Vector2d(611.5, 511.5), 0.0});
  }
  return image;
}

BoardSight sight(const Held& left) { return {{seen(left), seen(left)}}; }

const BoardGuideOptions kOptions{.board = board(), .focal_px = {kFocal, kFocal}};

TEST(BoardGuide, TellsTiltAndRoll) {
  const struct {
    Eigen::Vector2d away_deg;
    BoardTilt tilt;
  } cases[] = {{{-35.0, 0.0}, BoardTilt::kLeft},
               {{35.0, 0.0}, BoardTilt::kRight},
               {{0.0, -35.0}, BoardTilt::kUp},
               {{0.0, 35.0}, BoardTilt::kDown}};
  for (const auto& one : cases) {
    for (const double roll_deg : {0.0, 90.0, 180.0, 10.0}) {
      for (const Eigen::Vector2d& at : {Eigen::Vector2d(611.5, 511.5), Eigen::Vector2d(250.0, 800.0)}) {
        const base::BoardImage image = seen({at, one.away_deg, roll_deg});
        // The side that goes away is seen smaller: lengths of opposite sides, from the pixels alone.
        const auto pose = board_pose(image, board(), kFocal);
        ASSERT_TRUE(pose && pose->tilt);
        EXPECT_EQ(*pose->tilt, one.tilt) << one.away_deg.transpose() << ", " << roll_deg;
        EXPECT_NEAR(pose->tilt_rad / kDegree, 35.0, 0.5);
      }
    }
  }
  const auto flat = board_pose(seen({.away_deg = {15.0, 0.0}, .roll_deg = 90.0}), board(), kFocal);
  EXPECT_FALSE(flat->tilt);
  EXPECT_NEAR(std::abs(flat->roll_rad) / kDegree, 90.0, 3.0);
}

TEST(BoardGuide, BeginsInTheMiddleAndGoesToTheCorners) {
  const auto none = guide_board({}, kOptions);
  ASSERT_TRUE(none) << none.error().message;
  ASSERT_TRUE(none->wanted);
  EXPECT_EQ(none->poses, 0);
  EXPECT_THAT(none->wanted->words, HasSubstr("in the middle of the left image"));
  const auto one = guide_board({sight({.away_deg = {-35.0, 0.0}})}, kOptions);
  EXPECT_EQ(one->poses, 1);
  EXPECT_EQ(one->tilts[0], 1);
  EXPECT_EQ(one->coverage[0][3 * 8 + 4], 1);
  EXPECT_EQ(one->coverage[1][0], 0);
  EXPECT_EQ(one->wanted->words,
            "Hold the board in the upper left corner of the left image, its right side 30 to 45 degrees farther away.");
  EXPECT_EQ(one->wanted->cell, (std::array<int, 2>{0, 0}));
}

TEST(BoardGuide, SaysWhatCalibrateWouldWarnOf) {
  std::vector<BoardSight> sights(12, sight({}));
  const auto guide = guide_board(sights, kOptions);
  std::set<std::string> codes;
  for (const base::Warning& warning : guide->missing) codes.insert(warning.code);
  EXPECT_EQ(codes, (std::set<std::string>{"little_tilt", "not_rolled", "poor_coverage"}));
  EXPECT_EQ(guide->rolled, 0);
  EXPECT_TRUE(guide->wanted->rolled);
  EXPECT_THAT(guide->wanted->words, HasSubstr("Turn the board by 90 degrees about the line of sight and hold it"));
  EXPECT_THAT(guide_board({}, kOptions)->missing, ::testing::Contains(::testing::Field(&base::Warning::code, "few_views")));
}

/// An operator who does what is said: the guide ends, and calibrate would have nothing to say.
TEST(BoardGuide, WhoFollowsItIsDoneAfterSomeThirtyPoses) {
  std::vector<BoardSight> sights;
  int asked = 0;
  for (; asked < 60; ++asked) {
    const auto guide = guide_board(sights, kOptions);
    ASSERT_TRUE(guide);
    if (!guide->wanted) break;
    const WantedPose& wanted = *guide->wanted;
    const std::array<Eigen::Vector2d, 4> away = {{{-36.0, 0.0}, {36.0, 0.0}, {0.0, -36.0}, {0.0, 36.0}}};
    Held held{.away_deg = away[static_cast<std::size_t>(wanted.tilt)], .roll_deg = wanted.rolled ? 90.0 : 0.0};
    // Its middle as near to the cell as the image holds the whole board; a second camera sees the same, a little shifted.
    const Eigen::Vector2d to((wanted.cell[0] + 0.5) * 1224 / 8, (wanted.cell[1] + 0.5) * 1024 / 6);
    base::BoardImage image;
    for (double share = 1.0; share > -0.01; share -= 0.01) {
      held.at_px = Eigen::Vector2d(611.5, 511.5) + share * (to - Eigen::Vector2d(611.5, 511.5));
      image = seen(held);
      const auto inside = [](const base::BoardCorner& corner) {
        return corner.px.x() > 6.0 && corner.px.y() > 6.0 && corner.px.x() < 1217.0 && corner.px.y() < 1017.0;
      };
      if (std::all_of(image.corners.begin(), image.corners.end(), inside)) break;
    }
    BoardSight now{{image, image}};
    const std::size_t other = wanted.camera == devices::Side::kLeft ? 1 : 0;
    if (wanted.cell[0] % 7 == 0 && wanted.cell[1] % 5 == 0) now.views[other].corners.clear();  // corners: one camera sees it
    sights.push_back(now);
  }
  const auto guide = guide_board(sights, kOptions);
  EXPECT_FALSE(guide->wanted) << guide->wanted->words;
  EXPECT_TRUE(guide->missing.empty());
  EXPECT_GE(guide->poses, 25);
  EXPECT_LE(asked, 34);
  EXPECT_GE(*std::min_element(guide->tilts.begin(), guide->tilts.end()), 4);
  EXPECT_GE(guide->rolled, 5);
  // Undo: a shorter list wants again what is missing.
  sights.resize(sights.size() - 8);
  EXPECT_TRUE(guide_board(sights, kOptions)->wanted);
}

/// Codes and cameras of what calibrate() warns of about views.
std::set<std::string> about_views(const std::vector<base::Warning>& warnings) {
  std::set<std::string> found;
  for (const base::Warning& warning : warnings) {
    for (const char* code : {"few_views", "little_tilt", "not_rolled", "poor_coverage"}) {
      if (warning.code == code) found.insert(warning.code + " " + warning.subject);
    }
  }
  return found;
}

/// The poses with which the twin is calibrated, through its real lenses, without a stated focal length: all of them, too few, and those
/// that are not turned.
TEST(BoardGuide, WarnsOfWhatCalibrateWarnsOf) {
  const fixtures::Scene scene = fixtures::drawn(*fixtures::make_scene("segment"), 1);
  const base::Board& twin_board = scene.board->board;
  const std::vector<base::BoardImage> images = fixtures::sampled_boards(scene, 0.03, 1);
  const auto number_of = [](const base::BoardImage& image) {
    return static_cast<std::size_t>(std::stoi(image.image.substr(image.image.rfind('_') + 1)) - 1);
  };
  const auto upright = [&](const base::BoardImage& image) {
    const Eigen::Vector2d row = image.corners[static_cast<std::size_t>(twin_board.columns - 1)].px - image.corners[0].px;
    return std::abs(row.y()) < 0.4 * row.x();
  };
  std::set<std::string> all;
  for (const int choice : {0, 1, 2}) {
    std::vector<BoardSight> sights(scene.board->rig_from_board.size());
    calib::BoardViews views{twin_board, {scene.head->left, scene.head->right}, {}};
    for (const base::BoardImage& image : images) {
      if ((choice == 1 && number_of(image) > 6) || (choice == 2 && !upright(image))) continue;
      sights.at(number_of(image)).views[image.camera == scene.head->left ? 0 : 1] = image;
      views.images.push_back(image);
    }
    const auto guide = guide_board(sights, {.board = twin_board});
    ASSERT_TRUE(guide) << guide.error().message;
    const auto calibration =
        calib::calibrate(views, {.lens = base::LensModel::kOpenCv5, .cross_validate = false, .threads = 2});
    ASSERT_TRUE(calibration) << calibration.error().message;
    EXPECT_EQ(about_views(guide->missing), about_views(calibration->warnings)) << choice;
    all.merge(about_views(guide->missing));
  }
  EXPECT_THAT(all, ::testing::IsSupersetOf({"few_views left", "not_rolled left", "poor_coverage right"}));
}

TEST(BoardGuide, Refuses) {
  BoardSight other = sight({});
  other.views[0].width_px = 800;
  EXPECT_EQ(guide_board({sight({}), other}, kOptions).error().code, base::ErrorCode::kBadInput);
  BoardGuideOptions options = kOptions;
  options.each_tilt = 10;
  EXPECT_EQ(guide_board({}, options).error().code, base::ErrorCode::kUsage);
}

}  // namespace
}  // namespace crosstie::live
