// Two scans of a tower's shell: what markers and surface give together, against markers alone, over many draws of noise.

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "math/distributions.h"
#include "math/rigid_alignment.h"
#include "registration/stitch.h"
#include "tests/registration/synthetic_shell.h"
#include "tests/support/normalised_square.h"

namespace crosstie::registration {
namespace {

using testing::HasSubstr;

constexpr double kMarkerSigma_mm = 0.03;
constexpr double kSurfaceSigma_mm = 0.03;

/// CROSSTIE_STUDY=1: as many draws and points as the figures in the documentation were made with.
bool study() { return std::getenv("CROSSTIE_STUDY") != nullptr; }

struct Pair {
  std::vector<base::Pose> truth;
  StitchInput input;
};

Pair make_pair(std::uint64_t seed, bool hole, int points, bool markers = true) {
  const tests::Shell shell;
  tests::Scanner scanner(seed);
  const tests::Window windows[2] = {{.along_mm = -225.0}, {.along_mm = 225.0}};
  const auto material = [&](double along, double arc) { return !hole || std::hypot(along, arc) > 200.0; };
  std::vector<Eigen::Vector3d> places;
  while (markers && places.size() < 5) {
    const double along = scanner.uniform(-205.0, 205.0);
    const double arc = scanner.uniform(-330.0, 330.0);
    if (material(along, arc)) places.push_back(shell.at(along, arc));
  }
  Pair pair;
  for (int k = 0; k < 2; ++k) {
    pair.truth.push_back(scanner.pose(shell, windows[k]));
    StationScan& station = pair.input.stations.emplace_back();
    station.name = k == 0 ? "a" : "b";
    for (std::size_t i = 0; i < places.size(); ++i) {
      station.markers.push_back(scanner.sighting(static_cast<int>(i), places[i], pair.truth.back(), kMarkerSigma_mm));
    }
    auto surface = Surface::make(scanner.cloud(shell, windows[k], pair.truth.back(), points, kSurfaceSigma_mm, material));
    EXPECT_TRUE(surface) << surface.error().message;
    station.surface = *std::move(surface);
  }
  return pair;
}

/// Errors of the second scan's middle as the first sees it: axial, tangential, radial [mm], and the whole turn [rad].
Eigen::Vector4d errors(const base::Pose& a_from_b, const Pair& pair) {
  const base::Pose truth = pair.truth[0].inverse() * pair.truth[1];
  const Eigen::Vector3d& centre = pair.input.stations[1].surface->centre_mm();
  const Eigen::Vector3d shift = pair.truth[0].rotation * (a_from_b * centre - truth * centre);
  const double turn = base::rotation_log(a_from_b.rotation * truth.rotation.conjugate()).norm();
  return {shift.x(), shift.y(), shift.z(), turn};
}

base::Pose by_markers(const Pair& pair) {
  std::vector<math::AlignmentPair> pairs;
  for (std::size_t i = 0; i < pair.input.stations[0].markers.size(); ++i) {
    const Sighting& a = pair.input.stations[0].markers[i];
    const Sighting& b = pair.input.stations[1].markers[i];
    pairs.push_back({a.p_in_rig_mm, b.p_in_rig_mm, a.cov_mm2, b.cov_mm2});
  }
  const auto fit = math::align(pairs);
  EXPECT_TRUE(fit) << fit.error().message;
  return fit->a_from_b;
}

class ShellPair : public testing::TestWithParam<bool> {};

TEST_P(ShellPair, MarkersAndSurfaceTogetherAreBetterInEveryDirection) {
  const bool hole = GetParam();
  const int seeds = study() ? 100 : 30;
  const int points = 20000;
  Eigen::Vector4d joint = Eigen::Vector4d::Zero();
  Eigen::Vector4d markers = Eigen::Vector4d::Zero();
  double square = 0.0;
  double predicted = 0.0;
  std::size_t rounds = 0;
  for (int seed = 1; seed <= seeds; ++seed) {
    const Pair pair = make_pair(static_cast<std::uint64_t>(seed), hole, points);
    const auto result = stitch(pair.input);
    ASSERT_TRUE(result) << "seed " << seed << ": " << result.error().message;
    EXPECT_EQ(result->frame, "rig of a");
    EXPECT_EQ(result->segment.kind, base::Segment::Kind::kCylinder) << seed;
    const base::Pose a_from_b = result->stations[0].machine_from_rig.inverse() * result->stations[1].machine_from_rig;
    joint += errors(a_from_b, pair).cwiseAbs2() / seeds;
    markers += errors(by_markers(pair), pair).cwiseAbs2() / seeds;
    square += tests::normalised_square(a_from_b, pair.truth[0].inverse() * pair.truth[1], result->stations[1].cov);
    predicted += std::pow(result->stations[1].directions[2].sigma, 2) / seeds;
    rounds = std::max(rounds, result->iterations.size());
    const base::SourceShares axial = result->stations[1].directions[0].share;
    EXPECT_NEAR(axial.markers + axial.surface, 1.0, 1e-9);
    EXPECT_GT(axial.markers, axial.surface) << "a cylinder's surface says nothing along its axis; it helps by the yaw alone";
    EXPECT_GT(result->stations[1].directions[2].share.surface, 0.9) << "the radius is the surface's";
    EXPECT_EQ(result->overlaps.size(), 1U);
    EXPECT_THAT(result->overlaps[0].not_seen, testing::ElementsAre("axial", "roll"));
  }
  joint = joint.cwiseSqrt();
  markers = markers.cwiseSqrt();
  std::printf(
      "%s: joint axial %.4f tangential %.4f radial %.5f mm turn %.5f deg; markers %.4f %.4f %.4f mm %.5f deg; predicted "
      "radial %.5f; mean square %.2f of 6; at most %zu rounds\n",
      hole ? "hole" : "closed", joint(0), joint(1), joint(2), joint(3) * 180.0 / M_PI, markers(0), markers(1), markers(2),
      markers(3) * 180.0 / M_PI, std::sqrt(predicted), square / seeds, rounds);
  EXPECT_LE(joint(0), 1.05 * markers(0));
  EXPECT_LE(joint(1), 1.05 * markers(1));
  EXPECT_LE(joint(2), 1.05 * markers(2));
  EXPECT_LE(joint(2), 0.003);
  EXPECT_LE(joint(3), 0.2 * markers(3));
  EXPECT_GT(square, math::chi_square_quantile(0.0005, 6.0 * seeds));
  EXPECT_LT(square, math::chi_square_quantile(0.9995, 6.0 * seeds));
}

TEST_P(ShellPair, WithoutMarkersItIsRefusedAndTheFreeDirectionsAreNamed) {
  Pair pair = make_pair(7, GetParam(), 8000, false);
  pair.input.stations[0].start = pair.truth[0];
  pair.input.stations[1].start = pair.truth[1];
  const auto result = stitch(pair.input);
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().code, base::ErrorCode::kNoUniqueSolution);
  EXPECT_THAT(result.error().message, HasSubstr("axial and roll"));
  EXPECT_THAT(result.error().message, HasSubstr("cylinder"));
}

INSTANTIATE_TEST_SUITE_P(WithAndWithoutHole, ShellPair, testing::Bool(),
                         [](const auto& param) { return param.param ? "hole" : "closed"; });

TEST(ShellPair, TheNumberOfThreadsDoesNotMatter) {
  const Pair pair = make_pair(3, true, 8000);
  const auto one = stitch(pair.input, {.threads = 1});
  const auto four = stitch(pair.input, {.threads = 4});
  ASSERT_TRUE(one && four);
  for (std::size_t k = 0; k < 2; ++k) {
    EXPECT_EQ(one->stations[k].machine_from_rig.matrix(), four->stations[k].machine_from_rig.matrix());
    EXPECT_EQ(one->stations[k].cov, four->stations[k].cov);
  }
}

}  // namespace
}  // namespace crosstie::registration
