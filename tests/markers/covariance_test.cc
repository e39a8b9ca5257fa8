#include <cmath>
#include <numbers>

#include <gtest/gtest.h>
#include <Eigen/LU>

#include "markers/detect.h"
#include "tests/markers/rendered_marker.h"

namespace crosstie::markers {
namespace {

using tests::MarkerScene;

struct Case {
  const char* name;
  double radius_px, tilt_deg, blur_px, noise;
  bool dark_on_bright;
};

/// Mean of e^T Q^-1 e / 2 over the seeds: 1 where the covariance is the truth.
double normalised_squared_error(const MarkerScene& scene, double noise, int seeds) {
  const std::vector<double> levels = tests::rendered(scene);
  double sum = 0.0;
  for (int seed = 1; seed <= seeds; ++seed) {
    const base::Image image =
        tests::photograph(levels, scene.width_px, scene.height_px, {noise, static_cast<std::uint64_t>(seed)});
    const auto found = detect(image.view(), scene.family);
    EXPECT_TRUE(found && found->observations.size() == 1U);
    if (!found || found->observations.empty()) return NAN;
    const Eigen::Vector2d e = found->observations[0].centre_px - scene.centre_px;
    sum += 0.5 * e.dot(found->observations[0].cov_px2.inverse() * e);
  }
  return sum / seeds;
}

TEST(Covariance, IsTheScatterOverSeeds) {
  for (const Case& c : {Case{"small", 5.0, 20.0, 0.7, 3.0, false}, Case{"medium", 8.0, 45.0, 0.8, 2.0, false},
                        Case{"noisy", 8.0, 0.0, 0.6, 8.0, false}, Case{"dark dot", 9.0, 30.0, 0.7, 2.0, true},
                        Case{"large", 25.0, 55.0, 1.0, 4.0, false}}) {
    MarkerScene scene;
    scene.family = *marker_family("ring10");
    scene.code = scene.family.codes[9].code;
    scene.radius_px = c.radius_px;
    scene.tilt_rad = c.tilt_deg * std::numbers::pi / 180.0;
    scene.blur_px = c.blur_px;
    scene.dark_on_bright = c.dark_on_bright;
    scene.width_px = scene.height_px = static_cast<int>(2.0 * std::ceil(3.7 * c.radius_px + 3.0));
    scene.centre_px = {0.5 * scene.width_px + 0.21, 0.5 * scene.height_px - 0.37};
    constexpr int kSeeds = 200;
    const double mean = normalised_squared_error(scene, c.noise, kSeeds);
    // 99.9 % bounds of chi-square with 400 degrees of freedom over 400 (normal approximation): 1 +- 3.29 sqrt(2 / 400).
    EXPECT_GT(mean, 0.767) << c.name;
    EXPECT_LT(mean, 1.233) << c.name;
    RecordProperty(c.name, std::to_string(mean));
  }
}

/// A print with a rough edge scatters the centre more than the noise does; the sigma has to know.
TEST(Covariance, GrowsWithARoughEdge) {
  MarkerScene scene;
  scene.family = *marker_family("ring10");
  scene.coded = false;
  scene.radius_px = 10.0;
  const std::vector<double> clean = tests::rendered(scene);
  const auto smooth = detect(tests::photograph(clean, 96, 96, {1.0, 1}).view(), scene.family);
  ASSERT_TRUE(smooth && smooth->observations.size() == 1U);
  // The same dot whose edge waves with four and five periods round the circle by 0.15 px.
  std::vector<double> rough = clean;
  for (int y = 0; y < 96; ++y) {
    for (int x = 0; x < 96; ++x) {
      const Eigen::Vector2d e = Eigen::Vector2d(x, y) - scene.centre_px;
      const double phi = std::atan2(e.y(), e.x());
      const double shift = 0.15 * (std::sin(4.0 * phi) + std::cos(5.0 * phi));
      const double slope =
          160.0 / 0.75 * std::exp(-0.5 * std::pow((e.norm() - 10.0) / 0.75, 2)) / std::sqrt(2.0 * std::numbers::pi);
      rough[static_cast<std::size_t>(96 * y + x)] += slope * shift;
    }
  }
  const auto found = detect(tests::photograph(rough, 96, 96, {1.0, 1}).view(), scene.family);
  ASSERT_TRUE(found && found->observations.size() == 1U);
  EXPECT_GT(std::sqrt(found->observations[0].cov_px2.trace() / smooth->observations[0].cov_px2.trace()), 3.0);
}

}  // namespace
}  // namespace crosstie::markers
