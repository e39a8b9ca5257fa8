// Real pairs of boards, from the images on: the board is found by OpenCV, its corners and the calibration are ours.
#include <cmath>

#include <gtest/gtest.h>

#include "calib/calibrate.h"
#include "calib/corners.h"
#include "tests/support/measured_data.h"

namespace crosstie::calib {
namespace {

BoardViews views_of(const std::filesystem::path& folder, const base::Board& board, const std::string& left,
                    const std::string& right) {
  std::vector<BoardPhoto> photos;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    const std::string name = entry.path().filename().string();
    if (entry.path().extension() != ".jpg") continue;
    photos.push_back({name, name.starts_with(left) ? "left" : "right", entry.path()});
    EXPECT_TRUE(name.starts_with(left) || name.starts_with(right));
  }
  std::sort(photos.begin(), photos.end(), [](const auto& a, const auto& b) { return a.image < b.image; });
  const auto images = find_corners(photos, board, Detector::kClassic, 0);
  EXPECT_TRUE(images);
  return {board, {"left", "right"}, images.value_or(std::vector<base::BoardImage>())};
}

TEST(RealImages, BumblebeeHasThePublishedBaseline) {
  const auto folder = tests::measured_data("stereo-boards");
  if (folder.empty()) GTEST_SKIP() << "no stereo-boards in CROSSTIE_DATA";
  base::Board board{.columns = 4, .rows = 6, .pitch_mm = 30.0};
  board = board.with_default_prior();
  const BoardViews views = views_of(folder / "bumblebee", board, "left", "right");
  const auto free = calibrate(views);
  ASSERT_TRUE(free) << free.error().message;
  EXPECT_EQ(free->views.size(), 22U);
  // Published: 120.05 (BoofCV, a plane), with free points 120.24.
  EXPECT_GT(free->rig->baseline_mm, 120.05 - 0.3);
  EXPECT_LT(free->rig->baseline_mm, 120.24 + 0.3);
  EXPECT_LT(free->rms_px, 0.03);  // with OpenCV's cornerSubPix 0.044
  // The reason for the difference: rows and columns are not equally far apart, which a plane grid puts into focal lengths and
  // distances. Its sigma says that the pitch alone leaves more than that open.
  BoardViews plane = views;
  plane.board.free = false;
  const auto rigid = calibrate(plane, {.lens = base::LensModel::kOpenCv5});
  ASSERT_TRUE(rigid) << rigid.error().message;
  EXPECT_NEAR(rigid->rig->baseline_mm, 120.15, 0.15);
  EXPECT_GT(rigid->rms_px, 1.5 * free->rms_px);
  const auto aspect =
      std::find_if(free->board.modes.begin(), free->board.modes.end(), [](const auto& mode) { return mode.name == "aspect"; });
  ASSERT_NE(aspect, free->board.modes.end());
  EXPECT_GT(std::abs(aspect->value), 3.0 * aspect->sigma);
}

TEST(RealImages, PlasterHeadBoardsAreSeenToATwentiethOfAPixel) {
  const auto folder = tests::measured_data("plaster-head");
  if (folder.empty()) GTEST_SKIP() << "no plaster-head in CROSSTIE_DATA";
  base::Board board{.columns = 11, .rows = 8, .pitch_mm = 19.0};
  board = board.with_default_prior();
  const auto result = calibrate(views_of(folder / "board", board, "Left", "Right"));
  ASSERT_TRUE(result) << result.error().message;
  EXPECT_EQ(result->rig->stations, 20);
  // With OpenCV's cornerSubPix 0.09.
  EXPECT_LE(result->rms_px, 0.05);
  EXPECT_LE(result->cameras[0].rms_heldout_px, 0.05);
  EXPECT_LE(result->cameras[1].rms_heldout_px, 0.05);
  EXPECT_NEAR(result->rig->baseline_mm, 120.97, 3.0 * result->rig->baseline_sigma_mm);  // its own calibration
}

}  // namespace
}  // namespace crosstie::calib
