// Wrong heads: what a scan says of a calibration that is not its head's, against how wrong it was made.
#include "scan/head_test.h"

#include <array>
#include <cmath>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "scan/decode.h"
#include "scan/detail/rectification.h"
#include "tests/scan/synthetic_scan.h"

namespace crosstie::scan {
namespace {

using testing::HasSubstr;
using tests::SyntheticScan;

struct Captured {
  std::array<base::PhaseMap, 2> maps;
};

/// Speckles of a rough wall, finer than a patch: by projector coordinates, so that they stand still on the wall.
double speckles(double u, double v) {
  return 0.7 + 0.1 * std::sin(160.0 * u + 20.0 * std::sin(35.0 * v)) + 0.1 * std::sin(170.0 * v + 9.0 * std::sin(50.0 * u)) +
         0.05 * std::sin(230.0 * (u + v));
}

Captured captured(const SyntheticScan& scene, bool both, std::uint64_t seed) {
  const auto sequence = tests::gray_and_fringes(24.0, 6, false, both);
  Captured result;
  for (int camera = 0; camera < 2; ++camera) {
    std::mt19937_64 random(2 * seed + static_cast<std::uint64_t>(camera));
    auto decoder = Decoder::make(sequence, scene.width, scene.height, {});
    for (std::size_t i = 0; i < sequence.patterns.size(); ++i) {
      EXPECT_TRUE(decoder->add(static_cast<int>(i), scene.image(camera, sequence, sequence.patterns[i], random)));
    }
    auto map = decoder->finish();
    EXPECT_TRUE(map) << map.error().message;
    result.maps[static_cast<std::size_t>(camera)] = *std::move(map);
  }
  return result;
}

/// The head with the right camera turned about its own axes by this.
base::Head turned(const base::Head& head, const Eigen::Vector3d& by_rad) {
  base::Head result = head;
  base::Vector6d delta = base::Vector6d::Zero();
  delta.head<3>() = by_rad;
  result.right_from_left = base::perturbed(head.right_from_left, delta);
  return result;
}

/// The right camera moved in the left one's frame.
base::Head moved(const base::Head& head, const Eigen::Vector3d& by_mm) {
  base::Head result = head;
  result.right_from_left.translation_mm -= head.right_from_left.rotation * by_mm;
  return result;
}

base::HeadTest test_of(const Captured& scan, const base::Head& head, const std::string& source) {
  const auto depths = match(scan.maps[0], scan.maps[1], head, {});
  EXPECT_TRUE(depths) << depths.error().message;
  if (source == "phases") return test_head(head, phase_samples(*depths, head), source);
  const auto samples = texture_samples(scan.maps[0], scan.maps[1], *depths, head);
  EXPECT_TRUE(samples);
  return test_head(head, *samples, source);
}

const base::HeadTest::Term& most(const base::HeadTest& test) {
  return *std::max_element(test.terms.begin(), test.terms.end(),
                           [](const auto& a, const auto& b) { return a.explained < b.explained; });
}

struct WrongHead {
  const char* name;  ///< of the term that is to be named
  Eigen::Vector3d turned_rad;
  Eigen::Vector3d moved_mm;
  double value_rad;  ///< the head is wrong by this, the true one against it by its opposite
};

TEST(HeadTest, WrongHeadsAreNamed) {
  const SyntheticScan plain;
  SyntheticScan rough;
  rough.albedo = speckles;
  const Captured both = captured(plain, true, 300);
  const Captured one = captured(rough, false, 301);
  const Eigen::Vector3d none = Eigen::Vector3d::Zero();
  const std::vector<WrongHead> cases = {{"pitch", {1e-3, 0.0, 0.0}, none, 1e-3},
                                        {"pitch", {-1e-3, 0.0, 0.0}, none, -1e-3},
                                        {"roll", {0.0, 0.0, 6e-3}, none, 6e-3},
                                        {"yaw", {0.0, 25e-3, 0.0}, none, 25e-3},
                                        {"baseline up", none, {0.0, 1.5, 0.0}, 1.5 / 300.0}};
  for (const WrongHead& wrong : cases) {
    const base::Head head = moved(turned(plain.head, wrong.turned_rad), wrong.moved_mm);
    SCOPED_TRACE(testing::Message() << wrong.name << " " << wrong.value_rad);
    const base::HeadTest test = test_of(both, head, "phases");
    const auto judged = judge_head(test, 0.25);
    ASSERT_FALSE(judged) << test.off_px;
    EXPECT_THAT(judged.error().message, HasSubstr("the calibration is not that of this head"));
    if (std::string(wrong.name) == "yaw")
      continue;  // the wall is nearly flat: a yaw looks as a roll and a turned baseline together
    if (std::string(wrong.name) == "baseline up") continue;  // and that as a pitch
    EXPECT_EQ(most(test).name, wrong.name);
    EXPECT_NEAR(std::abs(most(test).value_rad / wrong.value_rad), 1.0, 0.15);
    const base::HeadTest by_texture = test_of(one, head, "texture");
    EXPECT_GT(by_texture.samples, 8);
    ASSERT_FALSE(judge_head(by_texture, 0.25)) << by_texture.off_px;
    EXPECT_EQ(most(by_texture).name, wrong.name);
    EXPECT_NEAR(most(by_texture).value_rad / most(test).value_rad, 1.0, 0.3);
  }
}

/// What a calibration leaves of a head: a hundredth of a pixel of the epipolar curves.
Eigen::MatrixXd calibration_covariance(const base::Head& head) {
  const Eigen::Index lens = base::parameter_count(head.left.model());
  Eigen::VectorXd sigma(2 * lens + 6);
  for (const Eigen::Index first : {Eigen::Index{0}, lens}) {
    sigma.segment(first, lens).setConstant(1e-5);  // distortion
    sigma.segment(first, 4).setConstant(0.005);    // px
  }
  sigma.tail<6>() << 1e-5, 1e-5, 1e-5, 0.005, 0.005, 0.005;  // rad, mm
  return sigma.cwiseAbs2().asDiagonal();
}

TEST(HeadTest, SmallTurnsAreNamedWhereTheCalibrationIsKnown) {
  const SyntheticScan plain;
  const Captured both = captured(plain, true, 302);
  for (const auto& [name, turned_rad] :
       {std::pair{"roll", Eigen::Vector3d(0.0, 0.0, 1e-3)}, std::pair{"roll", Eigen::Vector3d(0.0, 0.0, -1e-3)},
        std::pair{"pitch", Eigen::Vector3d(2e-4, 0.0, 0.0)}, std::pair{"yaw", Eigen::Vector3d(0.0, 5e-3, 0.0)}}) {
    SCOPED_TRACE(testing::Message() << name << " " << turned_rad.transpose());
    base::Head head = turned(plain.head, turned_rad);
    EXPECT_TRUE(judge_head(test_of(both, head, "phases"), 0.25));  // nothing says how well the head is known
    head.cov = calibration_covariance(head);
    const base::HeadTest test = test_of(both, head, "phases");
    const auto judged = judge_head(test, 0.25);
    ASSERT_FALSE(judged) << test.off_px;
    EXPECT_THAT(judged.error().message, HasSubstr(std::string("changed by ") + name));
    EXPECT_NEAR(std::abs(most(test).value_rad), turned_rad.norm(), 0.1 * turned_rad.norm());
    head.cov *= 1e4;  // a calibration that does not know the head so well
    EXPECT_TRUE(judge_head(test_of(both, head, "phases"), 0.25));
  }
}

TEST(HeadTest, TrueHeadIsNotAccused) {
  SyntheticScan plain;
  plain.head.cov = calibration_covariance(plain.head);
  SyntheticScan rough;
  rough.albedo = speckles;
  for (std::uint64_t seed = 0; seed < 8; ++seed) {
    const base::HeadTest phases = test_of(captured(plain, true, 310 + seed), plain.head, "phases");
    EXPECT_LT(phases.off_px, 0.02);
    EXPECT_TRUE(judge_head(phases, 0.25));
    const base::HeadTest texture = test_of(captured(rough, false, 320 + seed), plain.head, "texture");
    EXPECT_GT(texture.samples, 8);
    EXPECT_LT(texture.off_px, 0.1);
    EXPECT_TRUE(judge_head(texture, 0.25));
  }
}

TEST(HeadTest, FlatWallTellsNothingByTexture) {
  const SyntheticScan plain;
  const base::HeadTest test = test_of(captured(plain, false, 330), plain.head, "texture");
  EXPECT_LT(test.samples, 6);
}

TEST(HeadTest, MarkersTellAPitchedHead) {
  const SyntheticScan scene;
  const base::Head head = turned(scene.head, {1e-3, 0.0, 0.0});
  const auto frame = detail::rectify(head.right_from_left);
  std::vector<base::ScannedMarker> markers;
  std::mt19937_64 random(7);
  std::normal_distribution<double> normal(0.0, 0.02);
  for (const double x : {-200.0, 0.0, 200.0}) {
    for (const double y : {-150.0, 150.0}) {
      const Eigen::Vector3d point(x + 60.0, y, 1200.0);
      const Eigen::Vector2d left = *scene.head.left.project(point) + Eigen::Vector2d(normal(random), normal(random));
      const Eigen::Vector2d right =
          *scene.head.right.project(scene.head.right_from_left * point) + Eigen::Vector2d(normal(random), normal(random));
      const Eigen::Matrix2d cov = 4e-4 * Eigen::Matrix2d::Identity();
      const auto off = detail::off_curve(head, *frame, left, cov, right, cov);
      base::ScannedMarker marker;
      marker.p_in_rig_mm = point;
      marker.off_curve_px = off->distance_px;
      marker.off_curve_sigma_px = off->sigma_px;
      markers.push_back(marker);
    }
  }
  const base::HeadTest test = test_head(head, marker_samples(markers, head), "markers");
  const auto judged = judge_head(test, 0.25);
  ASSERT_FALSE(judged);
  EXPECT_EQ(most(test).name, "pitch");
  EXPECT_THAT(judged.error().message, HasSubstr("markers"));
  EXPECT_FALSE(test_head(head, {}, "markers").done());
}

}  // namespace
}  // namespace crosstie::scan
