// Dots of all sizes: from what the blur leaves of the smallest to hundreds of pixels, seen as flat as 70 degrees.

#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "markers/detect.h"

namespace crosstie::markers {
namespace {

struct Dot {
  double x, y, radius_px, tilt_deg, axis_rad;
};

/// Dark dots on a bright ground, or the other way round; 6 x 6 samples per pixel and no other blur.
base::Image picture(int width, int height, const std::vector<Dot>& dots, bool dark) {
  constexpr int kFine = 6;
  base::Image image(width, height, 8);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) image.row<std::uint8_t>(y)[x] = dark ? 190 : 30;
  }
  for (const Dot& dot : dots) {
    const double c = std::cos(dot.axis_rad) / dot.radius_px;
    const double s = std::sin(dot.axis_rad) / dot.radius_px;
    const double stretch = 1.0 / std::cos(dot.tilt_deg * std::numbers::pi / 180.0);
    const int reach = static_cast<int>(dot.radius_px) + 2;
    for (int y = static_cast<int>(dot.y) - reach; y <= static_cast<int>(dot.y) + reach; ++y) {
      for (int x = static_cast<int>(dot.x) - reach; x <= static_cast<int>(dot.x) + reach; ++x) {
        int inside = 0;
        for (int i = 0; i < kFine * kFine; ++i) {
          const double ex = x + (i % kFine + 0.5) / kFine - 0.5 - dot.x;
          const double ey = y + (i / kFine + 0.5) / kFine - 0.5 - dot.y;
          inside += std::hypot(c * ex + s * ey, stretch * (c * ey - s * ex)) <= 1.0 ? 1 : 0;
        }
        const double level = 30.0 + 160.0 * (dark ? 1.0 - inside / 36.0 : inside / 36.0);
        if (inside > 0) image.row<std::uint8_t>(y)[x] = static_cast<std::uint8_t>(std::lround(level));
      }
    }
  }
  return image;
}

TEST(Sizes, DotsFromFourToTwoHundredPixelsAreFoundOnce) {
  std::vector<Dot> dots;
  double left = 20.0;
  for (const double radius_px : {4.0, 5.0, 6.5, 9.0, 13.0, 19.0, 28.0, 40.0, 60.0, 90.0, 130.0, 200.0}) {
    left += 1.7 * radius_px;
    // The smallest ones as flat as a semi-minor axis of 2.2 px lets them be.
    const double flattest = radius_px < 6.5 ? std::acos(2.2 / radius_px) * 180.0 / std::numbers::pi : 70.0;
    dots.push_back({left + 0.3, 350.2, radius_px, flattest, 0.3});
    dots.push_back({left - 0.1, 1010.4, radius_px, 0.0, 0.0});
    left += 1.7 * radius_px + 12.0;
  }
  for (const bool dark : {false, true}) {
    const base::Image image = picture(static_cast<int>(left) + 100, 1400, dots, dark);
    const auto found = detect(image.view(), *marker_family("ring10"));
    ASSERT_TRUE(found);
    EXPECT_EQ(found->observations.size(), dots.size());
    for (const Dot& dot : dots) {
      int matches = 0;
      for (const base::Observation& observation : found->observations) {
        if ((observation.centre_px - Eigen::Vector2d(dot.x, dot.y)).norm() > 1.0) continue;
        ++matches;
        EXPECT_LT((observation.centre_px - Eigen::Vector2d(dot.x, dot.y)).norm(), 0.03) << dot.radius_px << " " << dot.tilt_deg;
        EXPECT_NEAR(observation.semi_major_px, dot.radius_px, 0.1);
      }
      EXPECT_EQ(matches, 1) << dot.radius_px << " px, " << dot.tilt_deg << " deg, dark " << dark;
    }
  }
}

}  // namespace
}  // namespace crosstie::markers
