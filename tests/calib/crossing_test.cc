// Corners of a chessboard by the image of two crossing lines, against images that are integrated over pixels by brute force.
#include "calib/detail/crossing.h"

#include <cmath>
#include <numbers>
#include <random>

#include <gtest/gtest.h>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "math/distributions.h"

namespace crosstie::calib::detail {
namespace {

using Eigen::Vector2d;

constexpr int kSide = 25;
constexpr double kMean = 120.0, kContrast = 80.0;

struct Scene {
  Vector2d corner_px = {12.0, 12.0};
  double first_rad = 0.1;
  double second_rad = 0.1 + 0.5 * std::numbers::pi;
  double blur_px = 0.55;          ///< of the lens alone; a pixel is a square
  double curvature_per_px = 0.0;  ///< of the first line
};

/// Light on each pixel: the sign of the board over pixel and Gaussian. A sample's weight is their convolution, by its closed form.
std::vector<double> light(const Scene& scene) {
  constexpr int kPerPixel = 24;
  const double reach = 0.5 + 4.5 * scene.blur_px;
  const auto window = [&](double d) {
    return 0.5 * (std::erf((d + 0.5) / (scene.blur_px * std::numbers::sqrt2)) -
                  std::erf((d - 0.5) / (scene.blur_px * std::numbers::sqrt2)));
  };
  const int samples = (kSide + 8) * kPerPixel;
  std::vector<float> sign(static_cast<std::size_t>(samples) * static_cast<std::size_t>(samples));
  const auto place = [&](int i) { return -4.5 + (i + 0.5) / kPerPixel; };
  const Vector2d along(std::cos(scene.first_rad), std::sin(scene.first_rad));
  for (int y = 0; y < samples; ++y) {
    for (int x = 0; x < samples; ++x) {
      const Vector2d d = Vector2d(place(x), place(y)) - scene.corner_px;
      const double s = along.dot(d);
      const double a = Vector2d(-along.y(), along.x()).dot(d) - 0.5 * scene.curvature_per_px * s * s;
      const double b = Vector2d(-std::sin(scene.second_rad), std::cos(scene.second_rad)).dot(d);
      sign[static_cast<std::size_t>(y * samples + x)] = (a > 0.0) == (b > 0.0) ? 1.0F : -1.0F;
    }
  }
  std::vector<double> weights;
  const int half = static_cast<int>(reach * kPerPixel);
  for (int k = -half; k < half; ++k) weights.push_back(window((k + 0.5) / kPerPixel) / kPerPixel);
  // Rows first, then columns, at the pixels' centres alone.
  const auto first_of = [&](int pixel) { return (pixel + 4) * kPerPixel + kPerPixel / 2 - half; };
  std::vector<double> across(static_cast<std::size_t>(samples) * kSide, 0.0);
  for (int y = 0; y < samples; ++y) {
    for (int x = 0; x < kSide; ++x) {
      double sum = 0.0;
      for (std::size_t k = 0; k < weights.size(); ++k)
        sum += weights[k] * static_cast<double>(sign[static_cast<std::size_t>(y * samples + first_of(x)) + k]);
      across[static_cast<std::size_t>(y * kSide + x)] = sum;
    }
  }
  std::vector<double> levels;
  for (int y = 0; y < kSide; ++y) {
    for (int x = 0; x < kSide; ++x) {
      double sum = 0.0;
      for (std::size_t k = 0; k < weights.size(); ++k)
        sum += weights[k] * across[(static_cast<std::size_t>(first_of(y)) + k) * kSide + static_cast<std::size_t>(x)];
      levels.push_back(kMean + kContrast * sum + 0.4 * x - 0.2 * y);
    }
  }
  return levels;
}

/// In sixteen bits, of which 256 are a grey level; `noise` in grey levels.
base::Image image_of(const std::vector<double>& levels, double noise, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  base::Image image(kSide, kSide, 16);
  for (int i = 0; i < kSide * kSide; ++i) {
    image.row<std::uint16_t>(0)[i] =
        static_cast<std::uint16_t>(std::lround(256.0 * (levels[static_cast<std::size_t>(i)] + noise * normal(random))));
  }
  return image;
}

/// As a first search leaves it: half a pixel off, directions by three degrees.
CrossingSearch roughly(const Scene& scene, double radius_px) {
  return {.start_px = scene.corner_px + Vector2d(0.4, -0.3),
          .first = {scene.first_rad + 0.05, scene.curvature_per_px},
          .second = {scene.second_rad - 0.05, 0.0},
          .radius_px = radius_px};
}

TEST(Crossing, IsFreeOfBiasAtEveryPlaceOfAPixel) {
  for (const double blur_px : {0.4, 0.55, 1.2}) {
    for (const double angle_rad : {0.5 * std::numbers::pi, 1.0}) {
      double worst = 0.0;
      for (int k = 0; k < 8; ++k) {
        Scene scene{.corner_px = {11.5 + 0.125 * k, 12.5 - 0.11 * k}, .blur_px = blur_px};
        scene.second_rad = scene.first_rad + angle_rad;
        const base::Image image = image_of(light(scene), 0.0, 1);
        const auto found = find_crossing(image.view(), roughly(scene, 7.0));
        ASSERT_TRUE(found) << blur_px << " " << k;
        worst = std::max(worst, (found->centre_px - scene.corner_px).norm());
        EXPECT_NEAR(found->blur_px, std::hypot(blur_px, std::sqrt(1.0 / 12.0)), 0.04);
        EXPECT_NEAR(std::abs(found->contrast), 256.0 * kContrast, 0.02 * 256.0 * kContrast);
      }
      std::printf("blur %.2f px, lines at %.2f rad: at most %.5f px off\n", blur_px, angle_rad, worst);
      EXPECT_LT(worst, 0.002) << blur_px << " " << angle_rad;
    }
  }
}

TEST(Crossing, WeightedGradientsAreDrawnToTheBordersOfPixels) {
  // What OpenCV makes of the same corners; the reason for a fit of our own.
  double worst = 0.0;
  double worst_of_gradients = 0.0;
  for (int k = 0; k < 8; ++k) {
    const Scene scene{.corner_px = {11.5 + 0.125 * k, 12.5 - 0.11 * k}};
    const std::vector<double> levels = light(scene);
    const base::Image image = image_of(levels, 0.0, 1);
    const auto found = find_crossing(image.view(), roughly(scene, 7.0));
    ASSERT_TRUE(found);
    worst = std::max(worst, (found->centre_px - scene.corner_px).norm());
    cv::Mat grey(kSide, kSide, CV_8U);
    for (int i = 0; i < kSide * kSide; ++i)
      grey.data[i] = static_cast<unsigned char>(std::lround(levels[static_cast<std::size_t>(i)]));
    std::vector<cv::Point2f> corner = {
        {static_cast<float>(scene.corner_px.x() + 0.4), static_cast<float>(scene.corner_px.y() - 0.3)}};
    cv::cornerSubPix(grey, corner, {6, 6}, {-1, -1}, {cv::TermCriteria::COUNT + cv::TermCriteria::EPS, 100, 1e-4});
    worst_of_gradients = std::max(worst_of_gradients, std::hypot(static_cast<double>(corner[0].x) - scene.corner_px.x(),
                                                                 static_cast<double>(corner[0].y) - scene.corner_px.y()));
  }
  std::printf("blur 0.55 px: at most %.5f px off, cornerSubPix %.5f px\n", worst, worst_of_gradients);
  EXPECT_GT(worst_of_gradients, 10.0 * worst);
}

TEST(Crossing, ALinesCurvatureDoesNotMoveIt) {
  const Scene scene{.corner_px = {12.3, 11.8}, .curvature_per_px = 5e-3};
  const base::Image image = image_of(light(scene), 0.0, 1);
  CrossingSearch search = roughly(scene, 9.0);
  const auto bent = find_crossing(image.view(), search);
  search.first.curvature_per_px = 0.0;
  const auto straight = find_crossing(image.view(), search);
  ASSERT_TRUE(bent && straight);
  EXPECT_LT((bent->centre_px - scene.corner_px).norm(), 0.003);
  EXPECT_GT((straight->centre_px - scene.corner_px).norm(), 0.03) << "a straight line lies in the middle of the bend";
}

TEST(Crossing, ItsSigmaIsTrue) {
  constexpr int kSeeds = 400;
  const Scene scene{.corner_px = {12.21, 11.63}};
  const std::vector<double> levels = light(scene);
  double squares = 0.0;
  double errors = 0.0;
  for (int seed = 0; seed < kSeeds; ++seed) {
    const base::Image image = image_of(levels, 2.0, static_cast<std::uint64_t>(seed));
    const auto found = find_crossing(image.view(), roughly(scene, 7.0));
    ASSERT_TRUE(found) << seed;
    errors += (found->centre_px - scene.corner_px).squaredNorm();
    squares += (found->centre_px - scene.corner_px).squaredNorm() / (found->sigma_px * found->sigma_px);
  }
  std::printf("noise of 2 of 160 levels: %.4f px, over sigma %.3f\n", std::sqrt(errors / (2.0 * kSeeds)),
              std::sqrt(squares / (2.0 * kSeeds)));
  EXPECT_GT(squares, math::chi_square_quantile(0.001, 2.0 * kSeeds));
  EXPECT_LT(squares, math::chi_square_quantile(0.999, 2.0 * kSeeds));
}

TEST(Crossing, NothingWhereThereIsNone) {
  Scene scene;
  const base::Image image = image_of(light(scene), 0.0, 1);
  CrossingSearch search = roughly(scene, 7.0);
  search.start_px = {2.0, 12.0};
  EXPECT_FALSE(find_crossing(image.view(), search)) << "the disc leaves the image";
  search = roughly(scene, 5.0);
  search.start_px = {17.0, 17.0};
  EXPECT_FALSE(find_crossing(image.view(), search)) << "the corner lies outside of the disc";
  search = roughly(scene, 7.0);
  search.second.direction_rad = search.first.direction_rad + 0.2;
  EXPECT_FALSE(find_crossing(image.view(), search)) << "lines that are nearly parallel";
  const base::Image noise = image_of(std::vector<double>(kSide * kSide, kMean), 5.0, 3);
  EXPECT_FALSE(find_crossing(noise.view(), roughly(scene, 7.0)));
}

}  // namespace
}  // namespace crosstie::calib::detail
