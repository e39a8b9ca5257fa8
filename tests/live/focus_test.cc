// The twin's irradiance is rendered with a stated defocus, so the blur is known from outside.

#include "live/focus.h"

#include <array>
#include <cmath>
#include <cstdint>
#include <optional>
#include <random>

#include <gtest/gtest.h>

#include "fixtures/render.h"
#include "fixtures/scene.h"

namespace crosstie::live {
namespace {

fixtures::Scene cross_scene() { return fixtures::drawn(*fixtures::make_scene("segment"), 1); }

std::size_t station_view(const fixtures::Scene& scene) {
  for (std::size_t i = 0; i < scene.views.size(); ++i) {
    if (scene.views[i].purpose == fixtures::Purpose::kStation) return i;
  }
  return 0;
}

/// A bright square with edges through a Gaussian, at a sub-pixel place.
base::Image square(double sigma_px, double low, double high, double noise, std::uint64_t seed) {
  base::Image image(240, 200, 8);
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  const double slant = 0.12;  // so that edges lie anywhere within their pixels
  const auto step = [&](double d) { return 0.5 * (1.0 + std::erf(d / (sigma_px * std::sqrt(2.0)))); };
  for (int y = 0; y < 200; ++y) {
    for (int x = 0; x < 240; ++x) {
      const double u = (x - 120.0) + slant * (y - 100.0), v = (y - 100.0) - slant * (x - 120.0);
      const double cover = step(60.0 - std::abs(u)) * step(50.0 - std::abs(v));
      const double grey = low + (high - low) * cover + noise * normal(random);
      image.row<std::uint8_t>(y)[x] = static_cast<std::uint8_t>(std::clamp(std::lround(grey), 0L, 255L));
    }
  }
  return image;
}

double formula(double s) {
  const double r = std::erf(1.0 / (s * std::sqrt(2.0))) / std::erf(3.0 / (s * std::sqrt(2.0)));
  return 0.5 * (3.0 * r - 1.0);
}

TEST(Focus, FollowsItsFormulaOnGaussianEdges) {
  for (const double sigma : {0.6, 0.8, 1.0, 1.5, 2.0, 3.0, 4.0}) {
    const auto focus = focus_number(square(sigma, 20.0, 200.0, 0.0, 1).view());
    ASSERT_TRUE(focus) << sigma;
    EXPECT_NEAR(*focus, formula(sigma), 0.05) << sigma;
  }
}

TEST(Focus, HardlyDependsOnExposureAndNoise) {
  for (const double sigma : {0.6, 1.0, 2.0}) {
    const double bright = *focus_number(square(sigma, 10.0, 240.0, 1.0, 2).view());
    const double dim = *focus_number(square(sigma, 5.0, 65.0, 1.0, 3).view());
    const double lifted = *focus_number(square(sigma, 120.0, 240.0, 1.0, 4).view());
    EXPECT_NEAR(dim, bright, 0.04) << sigma;
    EXPECT_NEAR(lifted, bright, 0.04) << sigma;
  }
}

TEST(Focus, NothingWhereNoEdgeTellsIt) {
  EXPECT_FALSE(focus_number(base::Image(200, 200, 8).view()));
  EXPECT_FALSE(focus_number(base::Image(5, 5, 8).view()));
  EXPECT_FALSE(focus_number(square(1.0, 100.0, 115.0, 1.0, 5).view())) << "a contrast below the domain";
  EXPECT_FALSE(focus_number(square(0.6, 20.0, 400.0, 0.0, 6).view())) << "clipped edges look sharper than they are";
}

TEST(Focus, SixteenBitsAreTheSame) {
  const base::Image eight = square(1.0, 20.0, 200.0, 0.0, 7);
  base::Image sixteen(eight.width(), eight.height(), 16);
  sixteen.set_white_level(4095.0);
  for (int y = 0; y < eight.height(); ++y) {
    for (int x = 0; x < eight.width(); ++x) {
      sixteen.row<std::uint16_t>(y)[x] = static_cast<std::uint16_t>(16 * eight.view().row<std::uint8_t>(y)[x]);
    }
  }
  EXPECT_NEAR(*focus_number(sixteen.view()), *focus_number(eight.view()), 0.01);
}

TEST(Focus, FallsWithDefocusOfTheTwinAtAnyExposure) {
  fixtures::Scene scene = cross_scene();
  const std::size_t view = station_view(scene);
  const auto camera = static_cast<std::size_t>(scene.views[view].camera);
  const fixtures::Sensor sensor = scene.cameras[camera].sensor;
  double before = 1.0;
  for (const double defocus_px : {0.0, 0.5, 1.0, 1.5, 2.0, 3.0}) {
    scene.views[view].defocus_sigma_px = defocus_px;
    const auto light = fixtures::render_irradiance(scene, view, 2);
    ASSERT_TRUE(light);
    const double usual = scene.cameras[camera].exposure;
    const auto full = focus_number(fixtures::expose(*light, sensor, usual, 1).view());
    const auto half = focus_number(fixtures::expose(*light, sensor, 0.5 * usual, 2).view());
    ASSERT_TRUE(full && half) << defocus_px;
    EXPECT_LT(*full, before - 0.01) << defocus_px;
    EXPECT_NEAR(*half, *full, 0.05) << defocus_px;
    before = *full;
    RecordProperty("focus_" + std::to_string(static_cast<int>(10 * defocus_px)), std::to_string(*full));
    std::printf("defocus %.1f px: focus %.3f, at half the exposure %.3f\n", defocus_px, *full, *half);
  }
}

}  // namespace
}  // namespace crosstie::live
