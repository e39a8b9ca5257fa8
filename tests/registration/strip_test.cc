// A row of eight scans along a tower: how it drifts without reference coordinates of its markers, and that it does not with them.

#include <cmath>
#include <cstdio>
#include <cstdlib>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "math/distributions.h"
#include "registration/stitch.h"
#include "tests/registration/synthetic_shell.h"
#include "tests/support/normalised_square.h"

namespace crosstie::registration {
namespace {

constexpr int kScans = 8;
constexpr double kStep_mm = 350.0;
constexpr double kMarkerSigma_mm = 0.03;
constexpr double kReferenceSigma_mm = 0.015;
constexpr double kSurfaceSigma_mm = 0.05;

struct Strip {
  std::vector<base::Pose> truth;
  StitchInput input;
};

/// Eight windows of 500 mm x 400 mm; two columns of markers at a pitch of 80 mm.
Strip make_strip(std::uint64_t seed, bool reference, int points) {
  const tests::Shell shell;
  tests::Scanner scanner(seed);
  std::vector<std::pair<double, Eigen::Vector3d>> places;
  for (double along = -230.0; along < kStep_mm * (kScans - 1) + 240.0; along += 80.0) {
    places.emplace_back(along, shell.at(along, -150.0));  // the second column stands between the rows of the first
    places.emplace_back(along + 40.0, shell.at(along + 40.0, 150.0));
  }
  Strip strip;
  for (int k = 0; k < kScans; ++k) {
    const tests::Window window{.along_mm = kStep_mm * k, .length_mm = 500.0, .height_mm = 400.0};
    strip.truth.push_back(scanner.pose(shell, window));
    StationScan& station = strip.input.stations.emplace_back();
    station.name = fmt::format("s{}", k);
    for (std::size_t i = 0; i < places.size(); ++i) {
      if (std::abs(places[i].first - window.along_mm) > 249.0) continue;
      station.markers.push_back(scanner.sighting(static_cast<int>(i), places[i].second, strip.truth.back(), kMarkerSigma_mm));
    }
    auto surface = Surface::make(scanner.cloud(shell, window, strip.truth.back(), points, kSurfaceSigma_mm));
    EXPECT_TRUE(surface) << surface.error().message;
    station.surface = *std::move(surface);
  }
  // The directions are those of the true shell: a fit to a strip that drifts would name them otherwise in just the draws that drift most.
  const base::Pose frame_from_machine = reference ? base::Pose{} : strip.truth[0].inverse();
  strip.input.segment = base::Segment{base::Segment::Kind::kCylinder,
                                      frame_from_machine * Eigen::Vector3d::Zero(),
                                      frame_from_machine.rotation * Eigen::Vector3d::UnitX(),
                                      shell.radius_mm,
                                      0.0,
                                      0.0,
                                      true};
  if (reference) {
    base::ControlGroup& list = strip.input.reference.emplace().points;
    const auto size = 3 * static_cast<Eigen::Index>(places.size());
    list.xyz_mm.resize(size);
    for (std::size_t i = 0; i < places.size(); ++i) {
      list.ids.push_back(static_cast<int>(i));
      list.xyz_mm.segment<3>(3 * static_cast<Eigen::Index>(i)) = places[i].second + scanner.normal3(kReferenceSigma_mm);
    }
    list.cov_mm2 = kReferenceSigma_mm * kReferenceSigma_mm * Eigen::MatrixXd::Identity(size, size);
  }
  return strip;
}

struct Draws {
  Eigen::Vector3d square =
      Eigen::Vector3d::Zero();  ///< mean squared error of the last scan's middle: axial, tangential, radial
  Eigen::Vector3d predicted = Eigen::Vector3d::Zero();  ///< mean predicted variance
  Eigen::Vector3d drift = Eigen::Vector3d::Zero();      ///< mean variance that the report predicts without a reference
  double normalised = 0.0;                              ///< sum over draws of the joint error of the last pose
  double joint = 0.0;                                   ///< the same of all poses together
};

Draws draw(int count, bool reference, int points) {
  Draws draws;
  for (int seed = 1; seed <= count; ++seed) {
    const Strip strip = make_strip(static_cast<std::uint64_t>(seed), reference, points);
    const auto result = stitch(strip.input);
    EXPECT_TRUE(result) << "seed " << seed << ": " << result.error().message;
    if (!result) continue;
    EXPECT_TRUE(result->rejected.size() <= 1) << seed << ": " << result->rejected.size();
    // In the frame of the result: the machine's, or the first rig.
    const base::Pose frame_from_machine = reference ? base::Pose{} : strip.truth[0].inverse();
    const auto truth = [&](std::size_t k) { return frame_from_machine * strip.truth[k]; };
    const base::StitchedStation& last = result->stations.back();
    const Eigen::Vector3d& centre = strip.input.stations.back().surface->centre_mm();
    const Eigen::Vector3d off = last.machine_from_rig * centre - truth(kScans - 1) * centre;
    draws.square += (last.directions_in_machine.transpose() * off).cwiseAbs2() / count;
    for (int i = 0; i < 3; ++i) draws.predicted(i) += std::pow(last.directions[static_cast<std::size_t>(i)].sigma, 2) / count;
    for (const base::StitchDrift& drift : result->drift) {
      if (drift.to == kScans - 1) draws.drift += drift.free_sigma_mm.cwiseAbs2() / count;
    }
    draws.normalised += tests::normalised_square(last.machine_from_rig, truth(kScans - 1), last.cov);
    const int first = reference ? 0 : 1;
    Eigen::VectorXd error(6 * (kScans - first));
    for (int k = first; k < kScans; ++k) {
      error.segment<6>(6 * (k - first)) =
          base::difference(result->stations[static_cast<std::size_t>(k)].machine_from_rig, truth(static_cast<std::size_t>(k)));
    }
    const Eigen::MatrixXd cov = result->covariance.bottomRightCorner(error.size(), error.size());
    draws.joint += tests::normalised_square(error, cov);
  }
  draws.square = draws.square.cwiseSqrt();
  draws.predicted = draws.predicted.cwiseSqrt();
  draws.drift = draws.drift.cwiseSqrt();
  std::printf(
      "%s: error of the last scan axial %.4f tangential %.4f radial %.4f mm, predicted %.4f %.4f %.4f, drift without a "
      "reference %.3f %.3f %.3f; mean square %.2f of 6, %.1f of %d\n",
      reference ? "with reference" : "without", draws.square(0), draws.square(1), draws.square(2), draws.predicted(0),
      draws.predicted(1), draws.predicted(2), draws.drift(0), draws.drift(1), draws.drift(2), draws.normalised / count,
      draws.joint / count, 6 * (reference ? kScans : kScans - 1));
  return draws;
}

void expect_chi_square(double sum, double dof) {
  EXPECT_GT(sum, math::chi_square_quantile(0.0005, dof));
  EXPECT_LT(sum, math::chi_square_quantile(0.9995, dof));
}

constexpr int kDraws = 100;  // as many as the figures need that are compared to a fifth
constexpr int kPoints = 3000;

TEST(Strip, ReferenceCoordinatesHoldItsEnd) {
  const Draws draws = draw(kDraws, true, kPoints);
  for (int i = 0; i < 3; ++i) {
    EXPECT_LE(draws.square(i), 0.015) << i;
    EXPECT_NEAR(draws.predicted(i) / draws.square(i), 1.0, 0.2) << i;
  }
  EXPECT_GT(draws.drift(2), 0.3) << "the report says what it would be without them";
  EXPECT_LT(draws.drift(2), 2.0);
  expect_chi_square(draws.normalised, 6.0 * kDraws);
  expect_chi_square(draws.joint, 6.0 * kScans * kDraws);
}

TEST(Strip, WithoutThemItDriftsAsPredicted) {
  const Draws draws = draw(kDraws, false, kPoints);
  EXPECT_GT(draws.predicted(2), 0.3);
  EXPECT_LT(draws.predicted(2), 2.0);
  for (int i = 0; i < 3; ++i) {
    EXPECT_NEAR(draws.predicted(i) / draws.square(i), 1.0, 0.2) << i;
    EXPECT_NEAR(draws.drift(i) / draws.predicted(i), 1.0, 0.05) << "both are the same question";
  }
  expect_chi_square(draws.normalised, 6.0 * kDraws);
  expect_chi_square(draws.joint, 6.0 * (kScans - 1) * kDraws);
}

}  // namespace
}  // namespace crosstie::registration
