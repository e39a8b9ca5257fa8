// Centres against what is possible: the Cramer-Rao bound of the photograph's noise (docs/formulation.md, section 1), from the
// renderer's own finite differences, and against the eccentricity that a perspective scene tells exactly.

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <numbers>
#include <random>

#include <gtest/gtest.h>
#include <Eigen/Geometry>
#include <Eigen/LU>

#include "markers/detect.h"
#include "tests/markers/cramer_rao.h"
#include "tests/markers/rendered_marker.h"

namespace crosstie::markers {
namespace {

using tests::cramer_rao_bound;
using tests::MarkerScene;

struct Cell {
  double radius_px, tilt_deg, blur_px;
  bool dark;
};

MarkerScene scene_of(const Cell& cell, std::mt19937_64& random) {
  std::uniform_real_distribution<double> phase(-0.5, 0.5);
  MarkerScene scene;
  scene.family = *marker_family("aicon14");
  scene.coded = false;
  scene.radius_px = cell.radius_px;
  scene.tilt_rad = cell.tilt_deg * std::numbers::pi / 180.0;
  scene.tilt_axis_rad = 3.0 * phase(random);
  scene.blur_px = cell.blur_px;
  scene.dark_on_bright = cell.dark;
  scene.width_px = scene.height_px = static_cast<int>(2.0 * std::ceil(2.4 * cell.radius_px + 4.0));
  scene.centre_px = {0.5 * scene.width_px + phase(random), 0.5 * scene.height_px + phase(random)};
  return scene;
}

/// Errors at most 1.2 times the bound, sigmas that are true.
TEST(Accuracy, ReachesTheCramerRaoBoundWithTrueSigmas) {
  constexpr double kNoise = 3.0;
  std::mt19937_64 random(20);
  for (const Cell& cell :
       {Cell{5.0, 0.0, 0.5, false}, Cell{5.0, 0.0, 0.8, true}, Cell{5.0, 0.0, 1.2, false}, Cell{5.0, 30.0, 0.8, false},
        Cell{5.0, 60.0, 0.5, true}, Cell{5.0, 60.0, 0.8, false}, Cell{5.0, 60.0, 0.8, true}, Cell{5.0, 60.0, 1.2, false},
        Cell{8.0, 0.0, 0.8, false}, Cell{8.0, 30.0, 0.5, true}, Cell{8.0, 30.0, 1.2, false}, Cell{8.0, 60.0, 1.2, true},
        Cell{15.0, 0.0, 1.2, false}, Cell{15.0, 60.0, 0.5, true}, Cell{40.0, 0.0, 0.5, false}, Cell{40.0, 60.0, 1.2, true}}) {
    const MarkerScene scene = scene_of(cell, random);
    const std::string name = std::to_string(cell.radius_px) + " px, " + std::to_string(cell.tilt_deg) + " deg, blur " +
                             std::to_string(cell.blur_px) + (cell.dark ? ", dark" : "");
    const double bound2 = kNoise * kNoise * cramer_rao_bound(scene).trace();
    const std::vector<double> levels = tests::rendered(scene);
    const int seeds = cell.radius_px < 30.0 ? 250 : 100;
    double squares = 0.0;
    double normalised = 0.0;
    for (int seed = 1; seed <= seeds; ++seed) {
      const base::Image image =
          tests::photograph(levels, scene.width_px, scene.height_px, {kNoise, static_cast<std::uint64_t>(seed)});
      const auto found = detect(image.view(), scene.family);
      ASSERT_TRUE(found && found->observations.size() == 1U) << name << ", seed " << seed << ": " << found->observations.size();
      const Eigen::Vector2d e = found->observations[0].centre_px - scene.centre_px;
      squares += e.squaredNorm();
      normalised += 0.5 * e.dot(found->observations[0].cov_px2.inverse() * e);
    }
    const double ratio = std::sqrt(squares / seeds / bound2);
    RecordProperty(name, std::to_string(ratio));
    EXPECT_LT(ratio, 1.2) << name << ": error " << std::sqrt(squares / seeds) << " px, bound " << std::sqrt(bound2);
    EXPECT_GT(ratio, 0.85) << name << ": better than the bound, so the bound or the test is wrong";
    // 99.9 % bounds of chi-square with 2 seeds degrees of freedom, over them (normal approximation). Quantisation and what the
    // edge's power is never below 1 make sigmas of ideal dots some percent larger than the scatter.
    const double spread = 3.29 / std::sqrt(static_cast<double>(seeds));
    EXPECT_LT(normalised / seeds, 1.0 + spread) << name;
    EXPECT_GT(normalised / seeds, 0.8 - spread) << name;
  }
}

/// A coded marker whose centre is to be as good as its noise allows, or one that may not be read.
struct CodedCell {
  double radius_px, tilt_deg, blur_px;
};

MarkerScene coded_scene_of(const CodedCell& cell, const MarkerFamily& family, bool dark, std::mt19937_64& random) {
  std::uniform_real_distribution<double> phase(-0.5, 0.5);
  MarkerScene scene = scene_of({cell.radius_px, cell.tilt_deg, cell.blur_px, dark}, random);
  scene.family = family;
  scene.coded = true;
  const double place = 0.5 + phase(random);
  scene.code = family.codes[static_cast<std::size_t>(place * (static_cast<double>(family.codes.size()) - 1.0))].code;
  scene.roll_rad = 6.0 * phase(random);
  scene.samples_per_px = cell.radius_px < 30.0 ? 10 : 6;
  scene.width_px = scene.height_px = 2 * static_cast<int>(std::ceil(family.border_outer * cell.radius_px + 4.0));
  scene.centre_px = {0.5 * scene.width_px + phase(random), 0.5 * scene.height_px + phase(random)};
  return scene;
}

double narrowest_segment_px(const MarkerScene& scene) {
  const MarkerFamily& family = scene.family;
  return scene.radius_px * std::cos(scene.tilt_rad) *
         std::min(std::numbers::pi * (family.ring_inner + family.ring_outer) / family.bits,
                  family.ring_outer - family.ring_inner);
}

/// Bounds of the centre of a coded marker's dot for noise of unit sigma.
struct CodedBounds {
  double dot_and_gap;  ///< from these pixels, the ring's light known: that of a plain dot
  double all;          ///< from all pixels out to the ring's outer edge, its own place, size, turn and level unknown
};

/// The image is linear in the tones, so that the ring's share is that of the coded marker less that of the dot alone.
CodedBounds coded_bounds(MarkerScene scene) {
  scene.samples_per_px = scene.radius_px < 30.0 ? 6 : 4;
  const int size_px = 2 * static_cast<int>(std::ceil(scene.family.ring_outer * scene.radius_px + 2.0));
  scene.centre_px += Eigen::Vector2d::Constant(0.5 * (size_px - scene.width_px));
  scene.width_px = scene.height_px = size_px;
  constexpr double kStep = 0.1;
  const auto derivative = [&](bool coded, int k) {
    const auto changed = [&](double by) {
      MarkerScene s = scene;
      s.coded = coded;
      if (k < 2) s.centre_px[k] += by;
      if (k == 2) s.radius_px += by;
      if (k == 3) s.tilt_rad += by / s.radius_px;
      if (k == 4) s.tilt_axis_rad += by / s.radius_px;
      if (k == 5) s.roll_rad += by / s.radius_px;
      if (k == 6) s.blur_px += by;
      if (k == 7) s.dark_level += by;
      if (k == 8) s.bright_level += by;
      if (k >= 9) s.light_slope[k - 9] += 0.01 * by;
      const std::vector<double> levels = tests::rendered(s);
      return Eigen::VectorXd(Eigen::Map<const Eigen::VectorXd>(levels.data(), static_cast<Eigen::Index>(levels.size())));
    };
    return Eigen::VectorXd((changed(kStep) - changed(-kStep)) / (2.0 * kStep));
  };
  const bool tilted = scene.tilt_rad > 0.0;  // else tilt and its axis change nothing to first order
  std::vector<Eigen::VectorXd> plain, all;
  for (const int k : {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10}) {
    if ((k == 3 || k == 4) && !tilted) continue;
    const Eigen::VectorXd marker = derivative(true, k);
    const Eigen::VectorXd dot = derivative(false, k);
    if (k != 5) plain.push_back(dot);  // a dot has no roll
    if (k < 5 || k == 8) {
      all.push_back(dot);
      all.push_back(marker - dot);
    } else {
      all.push_back(marker);
    }
  }
  std::swap(all[1], all[2]);  // the dot's centre first
  const auto bound = [&](const std::vector<Eigen::VectorXd>& derivatives, double outer) {
    const auto n = static_cast<Eigen::Index>(derivatives.size());
    Eigen::MatrixXd information = Eigen::MatrixXd::Zero(n, n);
    const double c = std::cos(scene.tilt_axis_rad);
    const double s = std::sin(scene.tilt_axis_rad);
    for (int y = 0; y < size_px; ++y) {
      for (int x = 0; x < size_px; ++x) {
        const Eigen::Vector2d e = Eigen::Vector2d(x, y) - scene.centre_px;
        const double across = (c * e.y() - s * e.x()) / std::cos(scene.tilt_rad);
        if (std::hypot(c * e.x() + s * e.y(), across) > outer * scene.radius_px) continue;
        Eigen::VectorXd g(n);
        for (Eigen::Index k = 0; k < n; ++k) g[k] = derivatives[static_cast<std::size_t>(k)][y * size_px + x];
        information.selfadjointView<Eigen::Lower>().rankUpdate(g);
      }
    }
    const Eigen::MatrixXd full = information.selfadjointView<Eigen::Lower>();
    return std::sqrt(full.inverse().topLeftCorner<2, 2>().trace());
  };
  return {bound(plain, scene.family.ring_inner), bound(all, scene.family.ring_outer)};
}

/// Error and bias of the centre found in photographs of a scene that is read, over noise from seeds and without noise.
void expect_best_centre(const CodedCell& cell, const MarkerFamily& family, bool dark, std::mt19937_64& random) {
  constexpr double kNoise = 3.0;
  const MarkerScene scene = coded_scene_of(cell, family, dark, random);
  const std::string name = family.name + ", " + std::to_string(cell.radius_px) + " px, " + std::to_string(cell.tilt_deg) +
                           " deg, blur " + std::to_string(cell.blur_px) + (dark ? ", dark" : "");
  const std::vector<double> levels = tests::rendered(scene);
  const auto error_in = [&](const MarkerScene& s, const base::Image& image, Eigen::Matrix2d* cov_px2) {
    const auto found = detect(image.view(), family);
    EXPECT_TRUE(found) << name;
    int coded = 0;
    Eigen::Vector2d error(NAN, NAN);
    for (const base::Observation& o : found->observations) {
      if (o.status != base::ObservationStatus::kCoded) continue;
      ++coded;
      EXPECT_EQ(family.code_of(o.id), s.code) << name;
      error = o.centre_px - s.centre_px;
      if (cov_px2 != nullptr) *cov_px2 = o.cov_px2;
    }
    EXPECT_EQ(coded, 1) << name;
    return error;
  };
  const CodedBounds bounds = coded_bounds(scene);
  const int seeds = cell.radius_px < 30.0 ? 150 : 60;
  double squares = 0.0;
  double normalised = 0.0;
  for (int seed = 1; seed <= seeds; ++seed) {
    Eigen::Matrix2d cov_px2 = Eigen::Matrix2d::Identity();
    const Eigen::Vector2d e =
        error_in(scene, tests::photograph(levels, scene.width_px, scene.height_px, {kNoise, static_cast<std::uint64_t>(seed)}),
                 &cov_px2);
    squares += e.squaredNorm();
    normalised += 0.5 * e.dot(cov_px2.inverse() * e);
  }
  const double error_px = std::sqrt(squares / seeds);
  const double ratio = error_px / (kNoise * bounds.dot_and_gap);
  const double of_all = error_px / (kNoise * bounds.all);
  // 16 bits without noise: what remains is the method's own, at several places, turns and codes.
  const int phases = cell.radius_px < 30.0 ? 4 : 1;
  double bias_px = 0.0;
  for (int i = 0; i < phases; ++i) {
    const MarkerScene other = i == 0 ? scene : coded_scene_of(cell, family, dark, random);
    std::vector<double> finer = i == 0 ? levels : tests::rendered(other);
    for (double& level : finer) level *= 256.0;
    bias_px +=
        error_in(other, tests::photograph(finer, other.width_px, other.height_px, {}, 16, 65535.0), nullptr).norm() / phases;
  }
  testing::Test::RecordProperty(name, std::to_string(ratio) + " of the bound, bias " + std::to_string(bias_px) + " px");
  if (std::getenv("CROSSTIE_ACCURACY_TALK") != nullptr) {
    std::printf("%s: %.3f of the bound %.4f px, %.3f of all pixels' bound, sigmas %.2f, bias %.4f px\n", name.c_str(), ratio,
                kNoise * bounds.dot_and_gap, of_all, normalised / seeds, bias_px);
  }
  EXPECT_LT(ratio, 1.2) << name << ": error " << error_px << " px";
  EXPECT_GT(of_all, 0.85) << name << ": better than the bound, so the bound or the test is wrong";
  EXPECT_LT(bias_px, 0.005) << name;
  const double spread = 3.29 / std::sqrt(static_cast<double>(seeds));
  EXPECT_LT(normalised / seeds, 1.0 + spread) << name;
  EXPECT_GT(normalised / seeds, 0.8 - spread) << name;
}

/// The same for coded markers, whose ring shines into the gap, and through the blur onto the dot's edge.
TEST(Accuracy, OfCodedMarkersReachesTheBoundToo) {
  constexpr double kReadablePx = 2.5;
  std::mt19937_64 random(22);
  int cells = 0;
  int outside = 0;
  for (const CodedCell& cell :
       {CodedCell{5.0, 0.0, 0.5}, CodedCell{5.0, 0.0, 1.2}, CodedCell{5.0, 30.0, 1.2}, CodedCell{5.0, 45.0, 0.8},
        CodedCell{5.0, 45.0, 1.2}, CodedCell{5.0, 60.0, 0.5}, CodedCell{5.0, 60.0, 0.8}, CodedCell{5.0, 60.0, 1.2},
        CodedCell{8.0, 0.0, 0.8}, CodedCell{8.0, 30.0, 1.2}, CodedCell{8.0, 60.0, 0.8}, CodedCell{8.0, 60.0, 1.2},
        CodedCell{15.0, 45.0, 0.5}, CodedCell{15.0, 60.0, 1.2}, CodedCell{40.0, 0.0, 0.5}, CodedCell{40.0, 60.0, 1.2}}) {
    for (const bool dark : {false, true}) {
      // Each cell in both polarities, in two of three families by turns: ring10, whose ring is nearest, is always one of them.
      for (const char* name : {"ring10", "aicon14", "agisoft12"}) {
        const MarkerFamily family = *marker_family(name);
        MarkerScene scene = coded_scene_of(cell, family, dark, random);
        const double narrowest_px = narrowest_segment_px(scene);
        if (narrowest_px < 1.01 * kReadablePx) {
          // A 5 px dot at 60 degrees: segments of ring10 are 2.0 px wide and must be refused; those of aicon14 are 2.5 px wide,
          // at the very limit, where the noise of the size decides. Never may either be misread.
          ++outside;
          scene.samples_per_px = 5;
          for (std::uint64_t seed = 1; seed <= 20; ++seed) {
            const auto found = detect(tests::photograph(scene, {3.0, seed}).view(), family);
            ASSERT_TRUE(found);
            for (const base::Observation& o : found->observations) {
              if (o.status != base::ObservationStatus::kCoded) continue;
              EXPECT_GT(narrowest_px, 0.97 * kReadablePx) << family.name << " is read below the readable domain";
              EXPECT_EQ(family.code_of(o.id), scene.code);
            }
          }
          continue;
        }
        const bool turn = family.name == (dark ? "agisoft12" : "aicon14");
        if (cell.tilt_deg < 60.0 || cell.radius_px > 5.0) {
          if (family.name == "ring10" ? (cell.radius_px > 30.0 && dark) : (!turn || (cell.radius_px > 30.0 && !dark))) continue;
        }
        ++cells;
        expect_best_centre(cell, family, dark, random);
      }
    }
  }
  RecordProperty("cells", cells);
  RecordProperty("outside of the readable domain", outside);
}

/// A ring that is printed beside its place or at another scale says where it is itself, not where the dot is.
TEST(Accuracy, OfTheDotDoesNotDependOnWhereTheRingWasPrinted) {
  for (const double blur_px : {0.5, 1.0}) {
    MarkerScene scene;
    scene.family = *marker_family("ring10");
    scene.code = scene.family.codes[9].code;
    scene.radius_px = 6.0;
    scene.tilt_rad = 0.7;
    scene.tilt_axis_rad = 0.4;
    scene.blur_px = blur_px;
    scene.width_px = scene.height_px = 58;
    scene.centre_px = {28.3, 28.9};
    // Off by 5 % of the dot's radius and 2 % larger.
    MarkerScene ring = scene;
    ring.centre_px += Eigen::Vector2d(0.3, -0.2);
    ring.radius_px *= 1.02;
    const auto levels = [](MarkerScene s, bool coded) {
      s.coded = coded;
      return tests::rendered(s);
    };
    std::vector<double> image = levels(scene, false);
    const std::vector<double> with = levels(ring, true);
    const std::vector<double> without = levels(ring, false);
    for (std::size_t i = 0; i < image.size(); ++i) image[i] = 256.0 * (image[i] + with[i] - without[i]);
    const auto found = detect(tests::photograph(image, scene.width_px, scene.height_px, {}, 16, 65535.0).view(), scene.family);
    ASSERT_TRUE(found && found->observations.size() == 1U);
    EXPECT_EQ(found->observations[0].status, base::ObservationStatus::kCoded);
    EXPECT_LT((found->observations[0].centre_px - scene.centre_px).norm(), 0.005) << "blur " << blur_px;
  }
}

/// A circle on a tilted plane seen by a perspective camera; lengths of the target in dot radii.
struct PerspectiveScene {
  double focal_px, distance, tilt_rad, axis_rad, blur_px;
  Eigen::Vector2d principal_px;
  const MarkerFamily* family = nullptr;  ///< null: the dot alone
  std::uint64_t code = 0;

  /// Whether a place on the target, in dot radii, is bright.
  [[nodiscard]] bool bright(const Eigen::Vector2d& place) const {
    const double rho = place.norm();
    if (rho <= 1.0 || family == nullptr) return rho <= 1.0;
    if (rho > family->disc_outer && rho <= family->border_outer) return true;
    if (rho < family->ring_inner || rho > family->ring_outer) return false;
    const double turns = std::atan2(place.y(), place.x()) / (2.0 * std::numbers::pi);
    const int segment = static_cast<int>((turns - std::floor(turns)) * family->bits) % family->bits;
    return (code >> (family->bits - 1 - segment) & 1U) != 0;
  }

  /// pixel = H target: rotation by the tilt about an axis in the plane, then the camera in front of it.
  [[nodiscard]] Eigen::Matrix3d pixel_from_target() const {
    const Eigen::Vector3d axis(std::cos(axis_rad), std::sin(axis_rad), 0.0);
    const Eigen::Matrix3d rotation = Eigen::AngleAxisd(tilt_rad, axis).toRotationMatrix();
    Eigen::Matrix3d plane = rotation;
    plane.col(2) = Eigen::Vector3d(0.0, 0.0, distance);
    Eigen::Matrix3d camera;
    camera << focal_px, 0.0, principal_px.x(), 0.0, focal_px, principal_px.y(), 0.0, 0.0, 1.0;
    return camera * plane;
  }
};

/// Centre of the ellipse { H p : p' diag(1, 1, -1) p = 0 }: the pole of the line at infinity.
Eigen::Vector2d ellipse_centre(const Eigen::Matrix3d& pixel_from_target) {
  const Eigen::Matrix3d target_from_pixel = pixel_from_target.inverse();
  const Eigen::Matrix3d conic =
      target_from_pixel.transpose() * Eigen::Vector3d(1.0, 1.0, -1.0).asDiagonal() * target_from_pixel;
  return conic.inverse().col(2).hnormalized();
}

/// Dot of 180 on a ground of 20 (times 256), 15 x 15 samples per pixel, each blurred by a Gaussian in both directions.
std::vector<double> photographed(const PerspectiveScene& scene, int size_px) {
  constexpr int kFine = 15;
  constexpr int kMargin = 6;
  const int fine = (size_px + 2 * kMargin) * kFine;
  const Eigen::Matrix3d target_from_pixel = scene.pixel_from_target().inverse();
  Eigen::MatrixXd cover(fine, fine);
  for (int y = 0; y < fine; ++y) {
    for (int x = 0; x < fine; ++x) {
      const Eigen::Vector3d pixel((x + 0.5) / kFine - 0.5 - kMargin, (y + 0.5) / kFine - 0.5 - kMargin, 1.0);
      cover(y, x) = scene.bright((target_from_pixel * pixel).hnormalized()) ? 1.0 : 0.0;
    }
  }
  Eigen::MatrixXd spread = Eigen::MatrixXd::Zero(size_px, fine);
  for (int row = 0; row < size_px; ++row) {
    for (int k = 0; k < fine; ++k) {
      // The Gaussian integrated over the pixel, as seen from the sample.
      const double at = (k + 0.5) / kFine - 0.5 - kMargin - row;
      const auto below = [&](double t) { return 0.5 * std::erfc(-t / (scene.blur_px * std::numbers::sqrt2)); };
      spread(row, k) = (below(at + 0.5) - below(at - 0.5)) / kFine;
    }
  }
  const Eigen::MatrixXd image = spread * cover * spread.transpose();
  std::vector<double> levels;
  for (int y = 0; y < size_px; ++y) {
    for (int x = 0; x < size_px; ++x) levels.push_back(256.0 * (20.0 + 160.0 * image(y, x)));
  }
  return levels;
}

TEST(Accuracy, IsTheImageOfTheCircleOnceItsEccentricityIsTakenOff) {
  std::mt19937_64 random(21);
  std::uniform_real_distribution<double> phase(-0.5, 0.5);
  for (const double radius_px : {6.0, 15.0, 40.0}) {
    for (const double tilt_deg : {0.0, 30.0, 45.0, 60.0}) {
      Eigen::Vector2d sum = Eigen::Vector2d::Zero();
      double eccentricity_px = 0.0;
      constexpr int kPhases = 4;
      for (int i = 0; i < kPhases; ++i) {
        const int size_px = static_cast<int>(5.0 * radius_px + 10.0);
        PerspectiveScene scene{.focal_px = 20.0 * radius_px,
                               .distance = 20.0,
                               .tilt_rad = tilt_deg * std::numbers::pi / 180.0,
                               .axis_rad = 1.3 * i,
                               .blur_px = 0.6 + 0.1 * i,
                               .principal_px = {0.5 * size_px + phase(random), 0.5 * size_px + phase(random)}};
        const Eigen::Matrix3d h = scene.pixel_from_target();
        const Eigen::Vector2d truth = h.col(2).hnormalized();
        const Eigen::Vector2d eccentricity = ellipse_centre(h) - truth;
        const auto found = detect(tests::photograph(photographed(scene, size_px), size_px, size_px, {}, 16, 65535.0).view(),
                                  *marker_family("aicon14"));
        ASSERT_TRUE(found && found->observations.size() == 1U) << radius_px << " " << tilt_deg;
        sum += found->observations[0].centre_px - eccentricity - truth;
        eccentricity_px = std::max(eccentricity_px, eccentricity.norm());
      }
      EXPECT_LT((sum / kPhases).norm(), 0.005) << radius_px << " px, " << tilt_deg << " deg, eccentricity " << eccentricity_px;
    }
  }
}

/// Perspective displaces the ring from the dot's ellipse, and makes its nearer half larger: where the blur mixes both, too.
TEST(Accuracy, OfBlurredCodedMarkersHoldsInPerspective) {
  for (const char* name : {"ring10", "agisoft12"}) {
    const MarkerFamily family = *marker_family(name);
    for (const double distance : {60.0, 200.0}) {  // in dot radii
      double sum = 0.0;
      constexpr int kPhases = 3;
      for (int i = 0; i < kPhases; ++i) {
        const int size_px = 2 * static_cast<int>(family.border_outer * 8.0 * 1.1 + 8.0);
        PerspectiveScene scene{.focal_px = 8.0 * distance,
                               .distance = distance,
                               .tilt_rad = std::numbers::pi / 3.0,
                               .axis_rad = 1.3 * i,
                               .blur_px = 1.2,
                               .principal_px = {0.5 * size_px + 0.1 * i, 0.5 * size_px - 0.13 * i},
                               .family = &family,
                               .code = family.codes[static_cast<std::size_t>(7 + 5 * i)].code};
        const auto found =
            detect(tests::photograph(photographed(scene, size_px), size_px, size_px, {}, 16, 65535.0).view(), family);
        ASSERT_TRUE(found);
        int coded = 0;
        for (const base::Observation& o : found->observations) {
          if (o.status != base::ObservationStatus::kCoded) continue;
          ++coded;
          sum += (o.centre_px - ellipse_centre(scene.pixel_from_target())).norm();
        }
        EXPECT_EQ(coded, 1) << name << ", distance " << distance;
      }
      EXPECT_LT(sum / kPhases, 0.005) << name << ", distance " << distance;
    }
  }
}

}  // namespace
}  // namespace crosstie::markers
