// Corners from pixels, files and tags, and which images belong together.
#include "calib/corners.h"

#include <cmath>
#include <functional>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <Eigen/Geometry>
#include <Eigen/LU>

#include "calib/pairing.h"
#include "tests/support/temporary_folder.h"

namespace crosstie::calib {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

/// An image of the plane z = 0 of the board under a homography, each pixel the mean of samples over two pixels' width, as a lens blurs it.
base::Image draw(const Eigen::Matrix3d& pixel_from_board, bool deep, int samples,
                 const std::function<bool(const Eigen::Vector2d&)>& is_white) {
  constexpr int kWidth = 640;
  constexpr int kHeight = 480;
  base::Image image(kWidth, kHeight, deep ? 16 : 8);
  const Eigen::Matrix3d board_from_pixel = pixel_from_board.inverse();
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      int white = 0;
      for (int i = 0; i < samples * samples; ++i) {
        const Eigen::Vector2d at(x - 1.0 + 2.0 * (i % samples + 0.5) / samples, y - 1.0 + 2.0 * (i / samples + 0.5) / samples);
        white += is_white((board_from_pixel * at.homogeneous()).hnormalized()) ? 1 : 0;
      }
      const int level = 30 + 190 * white / (samples * samples);
      if (deep) {
        image.row<std::uint16_t>(y)[x] = static_cast<std::uint16_t>(16 * level);
      } else {
        image.row<std::uint8_t>(y)[x] = static_cast<std::uint8_t>(level);
      }
    }
  }
  return image;
}

Eigen::Matrix3d tilted_view() { return (Eigen::Matrix3d() << 1.5, 0.1, 322.3, -0.12, 1.6, 238.7, 2e-4, 3e-4, 1.0).finished(); }

double rms_px(const std::vector<base::BoardCorner>& corners, const base::Board& board, const Eigen::Matrix3d& view,
              bool turned) {
  const Eigen::Matrix3Xd points = board.nominal_points();
  double sum = 0.0;
  for (const auto& corner : corners) {
    const int index = turned ? board.count() - 1 - corner.index : corner.index;
    const Eigen::Vector2d at = (view * Eigen::Vector2d(points.col(index).head<2>()).homogeneous()).hnormalized();
    sum += (corner.px - at).squaredNorm();
  }
  return std::sqrt(sum / static_cast<double>(corners.size()));
}

TEST(Corners, OfAChessboardBothDetectorsAndDepths) {
  const base::Board board{.columns = 9, .rows = 6, .pitch_mm = 25.0};
  const auto is_white = [](const Eigen::Vector2d& at) {
    const double x = at.x() / 25.0 + 5.0;  // squares from the board's outer edge
    const double y = at.y() / 25.0 + 3.5;
    if (x < 0.0 || y < 0.0 || x > 10.0 || y > 7.0) return true;
    return (static_cast<int>(x) + static_cast<int>(y)) % 2 != 0;
  };
  for (const bool deep : {false, true}) {
    const base::Image image = draw(tilted_view(), deep, 10, is_white);
    for (const Detector detector : {Detector::kClassic, Detector::kSectors}) {
      const auto corners = find_corners(image.view(), board, detector);
      ASSERT_TRUE(corners) << corners.error().message;
      ASSERT_TRUE(*corners) << detector_name(detector);
      ASSERT_EQ((*corners)->size(), 54U);
      EXPECT_LT(std::min(rms_px(**corners, board, tilted_view(), false), rms_px(**corners, board, tilted_view(), true)), 0.1)
          << detector_name(detector);
    }
  }
}

TEST(Corners, OfCircleGrids) {
  for (const bool shifted : {false, true}) {
    for (const bool bright : {false, true}) {
      base::Board board{.pattern = shifted ? base::BoardPattern::kAsymmetricCircles : base::BoardPattern::kCircles,
                        .columns = shifted ? 4 : 8,
                        .rows = shifted ? 7 : 5,
                        .pitch_mm = shifted ? 22.0 : 30.0};
      const Eigen::Matrix3Xd points = board.nominal_points();
      const base::Image image = draw(tilted_view(), false, 4, [&](const Eigen::Vector2d& at) {
        const bool in_a_dot = (points.topRows<2>().colwise() - at).colwise().norm().minCoeff() < 8.0;
        return in_a_dot == bright;
      });
      const auto corners = find_corners(image.view(), board);
      ASSERT_TRUE(corners) << corners.error().message;
      ASSERT_TRUE(*corners) << shifted << bright;
      // Centres of blobs are not the images of the circles' centres; a few hundredths at this tilt.
      EXPECT_LT(std::min(rms_px(**corners, board, tilted_view(), false), rms_px(**corners, board, tilted_view(), true)), 0.3);
    }
  }
}

TEST(Corners, NothingWhereThereIsNoBoard) {
  const base::Board board{.columns = 9, .rows = 6, .pitch_mm = 25.0};
  const base::Image image = draw(tilted_view(), false, 4, [](const Eigen::Vector2d& at) { return at.x() > 0.0; });
  const auto corners = find_corners(image.view(), board);
  ASSERT_TRUE(corners);
  EXPECT_FALSE(*corners);
  EXPECT_FALSE(find_corners(base::ImageView{}, board));
  base::Board tags = board;
  tags.pattern = base::BoardPattern::kAprilGrid;
  EXPECT_EQ(find_corners(image.view(), tags).error().code, base::ErrorCode::kUsage);
}

TEST(Corners, OfTagsThatAreOnTheBoard) {
  const base::Board board{
      .pattern = base::BoardPattern::kAprilGrid, .columns = 4, .rows = 4, .pitch_mm = 13.0, .tag_mm = 10.0, .first_id = 20};
  std::vector<TagInImage> tags = {{23, {{{1, 1}, {2, 1}, {2, 2}, {1, 2}}}, 0.02}};
  tags.push_back(tags.front());
  tags.back().id = 24;  // is not on it
  const auto corners = tag_corners(board, tags);
  ASSERT_EQ(corners.size(), 4U);
  EXPECT_EQ(corners[0].index, 10);
  EXPECT_EQ(corners[0].px, Eigen::Vector2d(1, 1));
  EXPECT_EQ(corners[3].index, 15);
  EXPECT_EQ(corners[3].px, Eigen::Vector2d(2, 2));
  EXPECT_EQ(corners[3].sigma_px, 0.02);
}

TEST(Vnl, ReadsCornersAndLevels) {
  const tests::TemporaryFolder folder;
  const auto path = folder.write("a.vnl",
                                 "# filename x y level\nb.jpg 1 2 0\nb.jpg 3 4.5 2\r\nb.jpg - - -\nb.jpg 5 6 -1\n\nc.jpg - -\n"
                                 "d.jpg 1 2\n");
  const auto images = read_vnl(path);
  ASSERT_TRUE(images) << images.error().message;
  ASSERT_EQ(images->size(), 3U);
  EXPECT_EQ((*images)[0].corners_px.size(), 4U);
  EXPECT_EQ((*images)[0].corners_px[1], Eigen::Vector2d(3, 4.5));
  base::Board board{.columns = 2, .rows = 2, .pitch_mm = 10.0};
  const auto found = board_images(std::span(*images).first(2), board, "left", 640, 480);
  ASSERT_TRUE(found) << found.error().message;
  ASSERT_EQ((*found)[0].corners.size(), 2U);  // neither "-" nor a negative level is used
  EXPECT_EQ((*found)[0].corners[1].index, 1);
  EXPECT_EQ((*found)[0].corners[1].sigma_px, 4.0 * (*found)[0].corners[0].sigma_px);
  EXPECT_TRUE((*found)[1].corners.empty());
  const auto wrong = board_images(*images, board, "left", 640, 480);
  ASSERT_FALSE(wrong);
  EXPECT_THAT(wrong.error().message, HasSubstr("image d.jpg has 1 corners"));
}

TEST(Vnl, RefusesWithTheLine) {
  const tests::TemporaryFolder folder;
  const auto refused = [&](const std::string& text, const std::string& words) {
    const auto images = read_vnl(folder.write("a.vnl", text));
    ASSERT_FALSE(images) << text;
    EXPECT_THAT(images.error().message, HasSubstr(words));
  };
  refused("b.jpg 1 2 0\nb.jpg 1\n", "a.vnl:2");
  refused("b.jpg 1 2 0 4\n", "a.vnl:1");
  refused("b.jpg 1 nan 0\n", "not numbers");
  refused("b.jpg 1 2,5 0\n", "not numbers");
  refused("b.jpg 1 2 99\n", "level");
  refused("b.jpg 1 2\nc.jpg 1 2\nb.jpg 3 4\n", "a.vnl:3: image b.jpg comes back");
  refused("# nothing\n", "no corners");
  EXPECT_EQ(read_vnl(folder / "absent").error().code, base::ErrorCode::kFileSystem);
}

std::vector<base::BoardImage> named(const std::vector<std::pair<std::string, std::string>>& names) {
  std::vector<base::BoardImage> images;
  for (const auto& [camera, image] : names) images.push_back({image, camera, 640, 480, {}});
  return images;
}

TEST(Pairing, ByTheNumbersInTheNames) {
  const auto images = named({{"l", "left01.png"},
                             {"l", "left02.png"},
                             {"l", "left10.png"},
                             {"r", "right_2.png"},
                             {"r", "right_1.png"},
                             {"r", "right_3.png"}});
  const auto stations = pair_by_name(images, {"l", "r"});
  ASSERT_TRUE(stations) << stations.error().message;
  ASSERT_EQ(stations->size(), 4U);
  EXPECT_THAT((*stations)[0].images, ElementsAre(0, 4));
  EXPECT_THAT((*stations)[1].images, ElementsAre(1, 3));
  EXPECT_THAT((*stations)[2].images, ElementsAre(5));
  EXPECT_THAT((*stations)[3].images, ElementsAre(2));
}

TEST(Pairing, WhereTheCamerasNumberStandsInFrontOrBehind) {
  const auto images = named(
      {{"l", "cam0_0007"}, {"l", "cam0_0008"}, {"r", "cam1_0007"}, {"r", "cam1_0008"}, {"l", "cam0_0017"}, {"r", "cam1_0017"}});
  const auto stations = pair_by_name(images, {"l", "r"});
  ASSERT_TRUE(stations) << stations.error().message;
  ASSERT_EQ(stations->size(), 3U);
  EXPECT_THAT((*stations)[0].images, ElementsAre(0, 2));
  EXPECT_THAT((*stations)[2].images, ElementsAre(4, 5));
  const auto behind = pair_by_name(named({{"l", "x0850_l"}, {"l", "x1100_l"}, {"r", "x0850_r"}, {"r", "x1100_r"}}), {"l", "r"});
  ASSERT_TRUE(behind) << behind.error().message;
  ASSERT_EQ(behind->size(), 2U);
  EXPECT_THAT((*behind)[0].images, ElementsAre(0, 2));
  EXPECT_EQ((*behind)[0].name, "0850");
}

TEST(Pairing, TwoImagesOfOneNumberAreRefused) {
  EXPECT_FALSE(pair_by_name(named({{"l", "left1"}, {"l", "left01"}}), {"l"}));
  EXPECT_FALSE(pair_by_name(named({{"x", "left1"}}), {"l"}));
}

}  // namespace
}  // namespace crosstie::calib
