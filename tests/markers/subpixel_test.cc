#include <cmath>
#include <numbers>
#include <random>

#include <gtest/gtest.h>
#include <Eigen/LU>

#include "markers/detect.h"
#include "tests/markers/rendered_marker.h"

namespace crosstie::markers {
namespace {

using tests::MarkerScene;

MarkerScene scene_of(double radius_px, double tilt_deg, double blur_px) {
  MarkerScene scene;
  scene.family = *marker_family("aicon14");
  scene.code = scene.family.codes[77].code;
  scene.radius_px = radius_px;
  scene.tilt_rad = tilt_deg * std::numbers::pi / 180.0;
  scene.tilt_axis_rad = 0.5;
  scene.blur_px = blur_px;
  scene.width_px = scene.height_px = static_cast<int>(2.0 * std::ceil(3.9 * radius_px + 4.0));
  scene.centre_px = {0.5 * scene.width_px, 0.5 * scene.height_px};
  return scene;
}

Eigen::Vector2d centre_in(const base::Image& image, const MarkerScene& scene) {
  const auto found = detect(image.view(), scene.family);
  EXPECT_TRUE(found && !found->observations.empty());
  if (!found) return {NAN, NAN};
  for (const base::Observation& observation : found->observations) {
    if ((observation.centre_px - scene.centre_px).norm() < 1.0) return observation.centre_px;
  }
  ADD_FAILURE() << "not found: radius " << scene.radius_px << ", tilt " << scene.tilt_rad << ", blur " << scene.blur_px;
  return {NAN, NAN};
}

/// The centre may not depend on where it lies relative to the pixels, nor on the ring, the light or the blur.
TEST(SubPixel, CentreHasNoBiasAtAnyPhase) {
  std::mt19937_64 random(5);
  std::uniform_real_distribution<double> phase(-0.5, 0.5);
  for (const double radius_px : {5.0, 8.0, 20.0}) {
    for (const double tilt_deg : {0.0, 45.0, 60.0}) {
      if (radius_px * std::cos(tilt_deg * std::numbers::pi / 180.0) < 3.0) continue;
      for (const double blur_px : {0.25, 0.7, 1.2}) {
        Eigen::Vector2d sum = Eigen::Vector2d::Zero();
        double largest = 0.0;
        constexpr int kPhases = 6;
        for (int i = 0; i < kPhases; ++i) {
          MarkerScene scene = scene_of(radius_px, tilt_deg, blur_px);
          scene.roll_rad = 0.9 * i;
          scene.centre_px += Eigen::Vector2d(phase(random), phase(random));
          // 16 bits without noise: only the method's own errors remain.
          std::vector<double> levels = tests::rendered(scene);
          for (double& level : levels) level *= 256.0;
          const Eigen::Vector2d error =
              centre_in(tests::photograph(levels, scene.width_px, scene.height_px, {}, 16, 65535.0), scene) - scene.centre_px;
          sum += error;
          largest = std::max(largest, error.norm());
        }
        EXPECT_LT((sum / kPhases).norm(), 0.005) << radius_px << " px, " << tilt_deg << " deg, blur " << blur_px;
        EXPECT_LT(largest, 0.012) << radius_px << " px, " << tilt_deg << " deg, blur " << blur_px;
      }
    }
  }
}

TEST(SubPixel, SaturationDoesNotMoveTheCentre) {
  for (int i = 0; i < 6; ++i) {
    MarkerScene scene = scene_of(8.0, 40.0, 0.8);
    scene.centre_px += Eigen::Vector2d(0.13 * i, -0.21 * i);
    scene.bright_level = 600.0;  // of a white level of 255
    scene.light_slope = {0.004, 0.0};
    const Eigen::Vector2d error =
        centre_in(tests::photograph(scene, {1.0, static_cast<std::uint64_t>(i)}), scene) - scene.centre_px;
    EXPECT_LT(error.norm(), 0.02);
  }
}

/// Cramer-Rao bound of the centre for white noise of unit sigma, from finite differences of the renderer. The unknowns are
/// centre, axes, direction, blur, dark and bright level, and the slope of the light: taken as even where it is not, it would
/// bias the centre by 1.8 blur times its relative change per radius.
Eigen::Matrix2d cramer_rao_bound(const MarkerScene& scene) {
  constexpr int kUnknowns = 10;
  const auto changed = [&](int k, double by) {
    MarkerScene s = scene;
    s.coded = false;
    if (k < 2) s.centre_px[k] += by;
    if (k == 2) s.radius_px += by;
    if (k == 3) s.tilt_rad += by / s.radius_px;
    if (k == 4) s.tilt_axis_rad += by / s.radius_px;
    if (k == 5) s.blur_px += by;
    if (k == 6) s.dark_level += by;
    if (k == 7) s.bright_level += by;
    if (k >= 8) s.light_slope[k - 8] += 0.01 * by;
    return tests::rendered(s);
  };
  Eigen::Matrix<double, kUnknowns, kUnknowns> information = Eigen::Matrix<double, kUnknowns, kUnknowns>::Zero();
  std::vector<std::vector<double>> derivatives;
  constexpr double kStep = 0.1;
  for (int k = 0; k < kUnknowns; ++k) {
    std::vector<double> up = changed(k, kStep);
    const std::vector<double> down = changed(k, -kStep);
    for (std::size_t i = 0; i < up.size(); ++i) up[i] = (up[i] - down[i]) / (2.0 * kStep);
    derivatives.push_back(up);
  }
  for (int a = 0; a < kUnknowns; ++a) {
    for (int b = 0; b < kUnknowns; ++b) {
      for (std::size_t i = 0; i < derivatives[0].size(); ++i) {
        const double dx = static_cast<double>(i % static_cast<std::size_t>(scene.width_px)) - scene.centre_px.x();
        const double dy = static_cast<double>(i / static_cast<std::size_t>(scene.width_px)) - scene.centre_px.y();
        if (std::hypot(dx, dy) > 2.0 * scene.radius_px) continue;  // only dot and gap are free of the code
        information(a, b) += derivatives[static_cast<std::size_t>(a)][i] * derivatives[static_cast<std::size_t>(b)][i];
      }
    }
  }
  return information.inverse().topLeftCorner<2, 2>();
}

struct Case {
  double radius_px, tilt_deg, blur_px, noise;
};

TEST(SubPixel, ReachesTheCramerRaoBound) {
  for (const Case& c :
       {Case{5.0, 30.0, 0.7, 3.0}, Case{8.0, 30.0, 0.7, 3.0}, Case{15.0, 50.0, 1.0, 3.0}, Case{8.0, 10.0, 0.5, 3.0}}) {
    MarkerScene scene = scene_of(c.radius_px, c.tilt_deg, c.blur_px);
    scene.coded = false;
    const double bound = std::sqrt(c.noise * c.noise * cramer_rao_bound(scene).trace());
    double squares = 0.0;
    constexpr int kSeeds = 200;
    const std::vector<double> levels = tests::rendered(scene);
    for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) {
      squares +=
          (centre_in(tests::photograph(levels, scene.width_px, scene.height_px, {c.noise, seed}), scene) - scene.centre_px)
              .squaredNorm();
    }
    const double ratio = std::sqrt(squares / kSeeds) / bound;
    RecordProperty("error_over_bound", std::to_string(ratio));
    EXPECT_LT(ratio, 1.2) << "radius " << c.radius_px << " px: error " << std::sqrt(squares / kSeeds) << " px, bound " << bound;
    EXPECT_GT(ratio, 0.85) << "radius " << c.radius_px << ": better than the bound, so the bound or the test is wrong";
  }
}

}  // namespace
}  // namespace crosstie::markers
