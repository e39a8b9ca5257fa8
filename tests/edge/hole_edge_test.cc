// The rim of the twin's door from edge pixels and depths that are projected from the exact rim and wall, with noise of known size: nothing here comes
// from the code under test but what it answers.
#include "edge/hole_edge.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "edge/nominal_fit.h"
#include "tests/edge/door_rim.h"

namespace crosstie::edge {
namespace {

using base::ErrorCode;
using std::numbers::pi;
using ::testing::AnyOf;
using ::testing::HasSubstr;
using tests::Door;
using tests::DoorNoise;
using tests::RimStatistics;

const Door& door() {
  static const Door door;
  return door;
}

TEST(HoleEdge, ExactEdgesGiveTheTrueRim) {
  const auto stations = door().stations({.edge_px = 0.0, .depth_mm = 0.0}, 1);
  const auto found = find_hole_edge(door().views(stations), {});
  ASSERT_TRUE(found) << found.error().message;
  EXPECT_TRUE(found->curve.closed);
  EXPECT_TRUE(found->curve.gaps.empty());
  const RimStatistics errors = door().compare(found->curve);
  EXPECT_LT(
      errors.rms_u_mm,
      0.01);  // a tenth of what is asked for: the surface beside the rim is taken for a parabola, the rim in a cell for straight
  EXPECT_LT(errors.rms_v_mm, 0.01);
  EXPECT_LT(errors.most_turn_rad, 0.2 * pi / 180.0);
  EXPECT_GT(errors.covered, 0.99);
}

TEST(HoleEdge, SigmasAreTrue) {
  constexpr int kSeeds = 8;
  RimStatistics all;
  for (int seed = 0; seed < kSeeds; ++seed) {
    const auto stations = door().stations({.edge_px = 0.08, .depth_mm = 0.10}, 100 + static_cast<std::uint64_t>(seed));
    const auto found = find_hole_edge(door().views(stations), {});
    ASSERT_TRUE(found) << found.error().message;
    EXPECT_TRUE(found->curve.closed);
    all.add(door().compare(found->curve));
  }
  SCOPED_TRACE(testing::Message() << all.count << " points, u rms " << all.rms_u_mm << " mean " << all.mean_u_mm
                                  << " normalised " << all.normalised_u << ", v rms " << all.rms_v_mm << " mean "
                                  << all.mean_v_mm << " normalised " << all.normalised_v << ", tilt normalised "
                                  << all.normalised_tilt << ", farthest " << all.farthest_mm);
  EXPECT_LT(all.rms_u_mm, 0.1);
  EXPECT_NEAR(all.normalised_u, 1.0, 0.15);
  EXPECT_NEAR(all.normalised_v, 1.0, 0.15);
  EXPECT_NEAR(all.normalised_tilt, 1.0, 0.15);
  EXPECT_LT(std::abs(all.mean_u_mm), 0.005);
  EXPECT_LT(std::abs(all.mean_v_mm), 0.01);
  EXPECT_LT(all.farthest_mm, 0.6);
}

TEST(HoleEdge, FarRimShadowsPaintAndLedgesAreNotTaken) {
  DoorNoise noise;
  noise.far_rim = noise.shadows = noise.paint = noise.ledge = true;
  const auto stations = door().stations(noise, 7);
  const auto found = find_hole_edge(door().views(stations), {});
  ASSERT_TRUE(found) << found.error().message;
  const RimStatistics errors = door().compare(found->curve);
  for (const auto& gap : found->curve.gaps) ADD_FAILURE() << gap.from_mm << " + " << gap.length_mm << ": " << gap.reason;
  EXPECT_TRUE(found->curve.closed);
  EXPECT_LT(errors.farthest_mm, 0.6);
  EXPECT_NEAR(errors.normalised_u, 1.0, 0.25);
  EXPECT_GT(found->counts.shadow, 100);
  EXPECT_GT(found->counts.off_face + found->counts.no_surface, 100);
}

TEST(HoleEdge, CamerasThatMissEachOtherMeetHalfWay) {
  constexpr double kMiss_px = 0.3;
  auto stations = door().stations({}, 12);
  const auto plain = find_hole_edge(door().views(stations), {});
  ASSERT_TRUE(plain) << plain.error().message;
  EXPECT_TRUE(plain->warnings.empty()) << plain->warnings.front().message;
  // The base lies along the rows: across it the right camera's edges move along the columns.
  for (auto& station : stations) {
    for (base::EdgePixel& edge : station.edges[1].pixels) edge.at_px.y() += kMiss_px;
  }
  const auto found = find_hole_edge(door().views(stations), {});
  ASSERT_TRUE(found) << found.error().message;
  EXPECT_EQ(std::count_if(found->warnings.begin(), found->warnings.end(),
                          [](const base::Warning& warning) { return warning.code == "cameras_miss"; }),
            3);
  const auto apart_mm = [](const HoleEdge& edge) {
    double squares = 0.0;
    int count = 0;
    for (const RimPoint& point : edge.points) {
      if (point.pixels[0] == 0 || point.pixels[1] == 0) continue;
      squares += std::pow(point.off_mm[1] - point.off_mm[0], 2);
      ++count;
    }
    return std::sqrt(squares / count);
  };
  EXPECT_LT(apart_mm(*found), 1.3 * apart_mm(*plain)) << "as far apart as noise leaves them";
  EXPECT_TRUE(found->curve.closed);
  // The left camera is the true one here: half of the miss is left, as the shared part says.
  const RimStatistics errors = door().compare(found->curve);
  EXPECT_GT(errors.rms_u_mm, 2.0 * door().compare(plain->curve).rms_u_mm);
  double variance = 0.0;
  for (const base::EdgePoint& point : found->curve.points) variance += point.sigma_u_mm * point.sigma_u_mm;
  EXPECT_NEAR(errors.rms_u_mm / std::sqrt(variance / static_cast<double>(found->curve.points.size())), 1.0, 0.3);
}

TEST(HoleEdge, TextureTellsAMissThatTheRimTellsWrongly) {
  auto stations = door().stations({}, 12);
  const auto plain = find_hole_edge(door().views(stations), {});
  ASSERT_TRUE(plain) << plain.error().message;
  // The right camera's images lie lower, more so farther down, and below the hole it sees another edge of a chamfer.
  constexpr double kChamfer_px = 0.4;
  const double middle_px = 0.5 * door().views(stations)[0].head->left.height_px();
  const auto lower_px = [&](double row) { return 0.3 + 2e-4 * (row - middle_px); };
  for (auto& station : stations) {
    for (base::EdgePixel& edge : station.edges[1].pixels)
      edge.at_px.y() += lower_px(edge.at_px.y()) + (edge.out.y() < -0.3 ? kChamfer_px : 0.0);
  }
  std::vector<StationView> views = door().views(stations);
  const auto by_rim = find_hole_edge(views, {});
  ASSERT_TRUE(by_rim) << by_rim.error().message;
  std::mt19937_64 random(12);
  std::normal_distribution<double> normal;
  constexpr double kSigma_px = 0.03;
  for (StationView& view : views) {
    for (int row = 40; row < view.head->left.height_px(); row += 100) {
      for (int column = 40; column < view.head->left.width_px(); column += 100)
        view.off_curve.push_back({{column, row}, lower_px(row) + kSigma_px * normal(random), kSigma_px});
    }
    view.off_curve[7].off_px += 3.0;  // another texture
  }
  const auto by_texture = find_hole_edge(views, {});
  ASSERT_TRUE(by_texture) << by_texture.error().message;
  ASSERT_FALSE(by_texture->warnings.empty());
  EXPECT_THAT(by_texture->warnings[0].message, ::testing::HasSubstr("texture"));
  // Above the hole both cameras see one edge: there the mean distance of theirs tells what is left of the miss.
  const auto apart_mm = [&](const HoleEdge& edge) {
    double sum = 0.0, variance = 0.0, count = 0.0;
    for (std::size_t i = 0; i < edge.points.size(); ++i) {
      const RimPoint& point = edge.points[i];
      const auto& station = views[static_cast<std::size_t>(edge.curve.points[i].stations[0])];
      const base::EdgePoint& place = edge.curve.points[i];
      const Eigen::Vector3d out = station.frame_from_rig.rotation.inverse() * place.normal.cross(place.tangent);
      if (out.y() < 0.5 || point.pixels[0] == 0 || point.pixels[1] == 0) continue;
      sum += point.off_mm[1] - point.off_mm[0];
      variance += std::pow(point.sigma_mm[0], 2) + std::pow(point.sigma_mm[1], 2);
      count += 1.0;
    }
    EXPECT_GT(count, 10.0);
    return std::pair(sum / count, std::sqrt(variance) / count);
  };
  const auto [plain_mm, sigma_mm] = apart_mm(*plain);  // the same noise
  const double rim_mm = apart_mm(*by_rim).first;
  const double texture_mm = apart_mm(*by_texture).first;
  EXPECT_GT(std::abs(rim_mm - plain_mm), 4.0 * sigma_mm) << "the chamfer below turns what lies above";
  EXPECT_LT(std::abs(texture_mm - plain_mm), sigma_mm);
}

TEST(HoleEdge, ABandBesideAFewEdgesIsNotFollowed) {
  constexpr double kBand_px = 2.5;  // 6 mm
  auto stations = door().stations({}, 13);
  for (auto& station : stations) {
    auto& pixels = station.edges[0].pixels;
    for (std::size_t i = 0; i < pixels.size(); ++i) {
      if (i % 120 >= 20) continue;
      pixels[i].at_px -= kBand_px * pixels[i].out;
      pixels[i].band_px = kBand_px;
    }
  }
  const auto found = find_hole_edge(door().views(stations), {});
  ASSERT_TRUE(found) << found.error().message;
  EXPECT_TRUE(found->curve.closed);
  const RimStatistics errors = door().compare(found->curve);
  EXPECT_LT(errors.farthest_mm, 0.6);
  EXPECT_NEAR(errors.normalised_u, 1.0, 0.25);
}

TEST(HoleEdge, AVagueBandDoesNotPutItsNeighboursOnTheFarSide) {
  constexpr double kBand_px = 0.3;  // 0.7 mm
  auto stations = door().stations({}, 13);
  for (auto& station : stations) {
    auto& pixels = station.edges[1].pixels;
    for (std::size_t i = 0; i < pixels.size(); ++i) {
      if (i % 120 >= 12) continue;
      pixels[i].at_px -= kBand_px * pixels[i].out;
      pixels[i].band_px = kBand_px;
      pixels[i].sigma_px = kBand_px;
    }
  }
  const auto found = find_hole_edge(door().views(stations), {});
  ASSERT_TRUE(found) << found.error().message;
  EXPECT_TRUE(found->curve.closed);
  EXPECT_EQ(found->counts.inner, 0);
  const RimStatistics errors = door().compare(found->curve);
  EXPECT_LT(errors.farthest_mm, 0.4);
  EXPECT_NEAR(errors.normalised_u, 1.0, 0.25);
}

TEST(HoleEdge, MarkersAreMaskedAndTheirGapsNamed) {
  const auto stations = door().stations({}, 8);
  HoleEdgeOptions options;
  const Eigen::Vector3d at = door().rim(0.31).point_mm;
  options.masks.push_back({"magnet 5", at, 60.0});
  const auto found = find_hole_edge(door().views(stations), options);
  ASSERT_TRUE(found) << found.error().message;
  EXPECT_FALSE(found->curve.closed);
  ASSERT_EQ(found->curve.gaps.size(), 1U);
  EXPECT_NEAR(found->curve.gaps[0].length_mm, 120.0, 60.0);  // cells of some 26 mm
  EXPECT_THAT(found->curve.gaps[0].reason, HasSubstr("magnet 5"));
  EXPECT_GT(found->counts.masked, 5);
  for (const base::EdgePoint& point : found->curve.points) EXPECT_GT((point.point_mm - at).norm(), 60.0 - 26.0);
}

TEST(HoleEdge, StationsAreFusedWhereTheyOverlap) {
  const auto stations = door().stations({}, 9);
  const auto found = find_hole_edge(door().views(stations), {});
  ASSERT_TRUE(found) << found.error().message;
  ASSERT_EQ(found->curve.stations.size(), 3U);
  double alone = 0.0, together = 0.0;
  int count_alone = 0, count_together = 0;
  for (std::size_t i = 0; i < found->curve.points.size(); ++i) {
    const bool several = found->curve.points[i].stations.size() > 1;
    (several ? together : alone) += found->curve.points[i].sigma_u_mm;
    ++(several ? count_together : count_alone);
  }
  EXPECT_GT(count_alone, 10);
  EXPECT_GT(count_together, 10);
  EXPECT_LT(together / count_together, 0.85 * alone / count_alone);
}

TEST(HoleEdge, AStationSeesItsPartOnly) {
  const auto stations = door().stations({}, 10);
  const auto views = door().views(stations);
  HoleEdgeOptions options;
  const auto& head = *views[0].head;
  options.roi_px = {0.0, 0.0, head.left.width_px() - 1.0, head.left.height_px() - 1.0};
  const auto found = find_hole_edge(std::span(views).first(1), options);
  ASSERT_TRUE(found) << found.error().message;
  EXPECT_FALSE(found->curve.closed);
  ASSERT_EQ(found->curve.gaps.size(), 1U);
  EXPECT_GT(found->curve.gaps[0].length_mm, 300.0);
  const RimStatistics errors = door().compare(found->curve);
  EXPECT_NEAR(errors.normalised_u, 1.0, 0.3);
  EXPECT_LT(errors.farthest_mm, 0.6);
}

TEST(HoleEdge, PosesOfTheStationsAreShared) {
  const auto stations = door().stations({}, 11);
  auto views = door().views(stations);
  for (auto& view : views) {
    view.frame_from_rig_cov = base::Matrix6d::Zero();
    view.frame_from_rig_cov.bottomRightCorner<3, 3>() = 0.05 * 0.05 * Eigen::Matrix3d::Identity();
  }
  const auto found = find_hole_edge(views, {});
  ASSERT_TRUE(found) << found.error().message;
  ASSERT_EQ(found->curve.shared_mm.cols(), 9);
  // A point that one station saw moves with it; one that several saw with their weighted mean.
  for (std::size_t i = 0; i < found->curve.points.size(); ++i) {
    const Eigen::Matrix3d cov = found->curve.shared_mm.middleRows<3>(3 * static_cast<Eigen::Index>(i)) *
                                found->curve.shared_mm.middleRows<3>(3 * static_cast<Eigen::Index>(i)).transpose();
    const double most = 0.05 * 0.05;
    if (found->curve.points[i].stations.size() == 1)
      EXPECT_NEAR(cov.trace(), 3.0 * most, 1e-9);
    else
      EXPECT_LT(cov.trace(), 3.0 * most);
  }
}

TEST(HoleEdge, WithoutAHoleThereIsAnErrorThatSaysWhy) {
  auto stations = door().stations({}, 12);
  for (auto& station : stations) {
    for (auto& edges : station.edges) edges.pixels.clear();
  }
  const auto nothing = find_hole_edge(door().views(stations), {});
  ASSERT_FALSE(nothing);
  EXPECT_EQ(nothing.error().code, ErrorCode::kNoUniqueSolution);
  // Random edges on the face: no hole, whatever the number of edges.
  std::mt19937_64 random(3);
  std::uniform_real_distribution<double> u(0.0, 1.0);
  stations = door().stations({}, 12);
  for (auto& station : stations) {
    for (auto& edges : station.edges) {
      edges.pixels.clear();
      for (int i = 0; i < 2000; ++i) {
        const double turn = 2.0 * pi * u(random);
        base::EdgePixel pixel;
        pixel.at_px = {u(random) * (edges.width - 1), u(random) * (edges.height - 1)};
        pixel.out = {std::cos(turn), std::sin(turn)};
        pixel.sigma_px = pixel.noise_px = 0.1;
        edges.pixels.push_back(pixel);
      }
    }
  }
  const auto random_edges = find_hole_edge(door().views(stations), {});
  ASSERT_FALSE(random_edges);
  EXPECT_EQ(random_edges.error().code, ErrorCode::kNoUniqueSolution);
  EXPECT_THAT(random_edges.error().message, HasSubstr("region"));
}

TEST(HoleEdge, OptionsAreChecked) {
  const auto refused = [](const HoleEdgeOptions& options) {
    const auto found = find_hole_edge({}, options);
    return !found && found.error().code == ErrorCode::kUsage;
  };
  EXPECT_TRUE(refused({.roi_px = std::array<double, 4>{10.0, 10.0, 5.0, 20.0}}));
  EXPECT_TRUE(refused({.cell_mm = -1.0}));
  EXPECT_TRUE(refused({.surface_reach_px = 4.0}));
  EXPECT_TRUE(refused({.max_off_face_mm = 0.0}));
  EXPECT_TRUE(refused({.max_turn_rad = 2.0}));
  EXPECT_TRUE(refused({.max_w = 0.0}));
  EXPECT_TRUE(refused({.min_gap_cells = 0.5}));
}

}  // namespace
}  // namespace crosstie::edge
