#include "edge/tool_path.h"

#include <cmath>
#include <numbers>
#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <Eigen/Geometry>

#include "edge/nominal_fit.h"
#include "tests/edge/synthetic_rim.h"

namespace crosstie::edge {
namespace {

using base::EdgeCurve;
using base::ErrorCode;
using base::PathSource;
using base::ToolPath;
using base::ToolPathPoint;
using std::numbers::pi;
using ::testing::HasSubstr;
using tests::measured_rim;
using tests::on_cylinder;
using tests::RimErrors;
using tests::some_pose;
using tests::true_ellipse;
using tests::TruePoint;
using tests::TrueRim;

constexpr double kDiameter_mm = 600.0;

NominalCurve circle(std::optional<Saddle> saddle = std::nullopt) {
  return *NominalCurve::make({NominalKind::kCircle, {kDiameter_mm}, 2.5, saddle});
}

/// A round hole whose rim stands into the opening by `into` and off the surface by `off`, functions of the way round.
TrueRim formed(std::function<double(double)> into, std::function<double(double)> off) {
  return [=](double u) {
    const double phi = 2.0 * pi * u;
    const double r = 0.5 * kDiameter_mm - into(u);
    return TruePoint{{r * std::cos(phi), r * std::sin(phi), off(u)}};
  };
}

std::function<double(double)> wave(double amplitude, double count) {
  return [=](double u) { return amplitude * std::sin(2.0 * pi * count * u); };
}

EdgeCurve noiseless(const TrueRim& rim, const base::Pose& pose = {}, int count = 3000, double from = 0.0, double to = 1.0) {
  std::mt19937_64 random(1);
  return measured_rim(rim, pose, count, {}, random, 0.0, from, to);
}

TEST(ToolPath, FollowsFormAndPassesHalfOfTheCutoff) {
  const double length = pi * kDiameter_mm;
  const auto amplitude_at = [&](double count) {
    const EdgeCurve edge = noiseless(formed(wave(0.5, count), wave(0.0, 1.0)));
    const auto path =
        tool_path(edge, circle(), {}, base::Matrix6d::Zero(), {.step_mm = 1.0, .cutoff_mm = length / 100.0, .max_slope = 1.0});
    EXPECT_TRUE(path.has_value()) << path.error().message;
    double sum = 0.0;  // the wave's own part of the correction
    for (std::size_t i = 0; i + 1 < path->points.size(); ++i) {
      const Eigen::Vector3d& p = path->points[i].point_mm;
      const double u = std::atan2(p.y(), p.x()) / (2.0 * pi);
      sum += 2.0 * path->points[i].correction_u_mm * std::sin(2.0 * pi * count * u);
    }
    return sum / static_cast<double>(path->points.size() - 1) / 0.5;
  };
  // (1 + y) exp(-y) with y = 1.67835 (cutoff / wavelength)^2
  EXPECT_NEAR(amplitude_at(100.0), 0.5, 0.01);
  EXPECT_NEAR(amplitude_at(10.0), 0.99986, 0.001);
  EXPECT_NEAR(amplitude_at(50.0), 0.93323, 0.005);
  EXPECT_NEAR(amplitude_at(200.0), 0.00936, 0.01);
}

TEST(ToolPath, LiesOnTheRimWhereverTheNominalWasPlaced) {
  base::Pose place = some_pose();
  base::Vector6d off;
  off << 2e-4, -1e-4, 3e-4, 0.4, -0.3, 0.5;
  place = base::perturbed(place, off * 0.3);
  const TrueRim rim = formed(wave(0.4, 3.0), wave(0.3, 2.0));
  const auto path = tool_path(noiseless(rim, some_pose()), circle(), place, base::Matrix6d::Zero());
  ASSERT_TRUE(path.has_value()) << path.error().message;
  EXPECT_TRUE(path->closed);
  EXPECT_NEAR((path->points.front().point_mm - path->points.back().point_mm).norm(), 0.0, 1e-9);
  EXPECT_TRUE(path->warnings.empty()) << path->warnings[0].message;
  double way = 0.0;
  for (std::size_t i = 0; i < path->points.size(); ++i) {
    const ToolPathPoint& p = path->points[i];
    const Eigen::Vector3d q = some_pose().inverse() * p.point_mm;
    const TruePoint truth = rim(std::atan2(q.y(), q.x()) / (2.0 * pi));
    EXPECT_LT((truth.point - q).norm(), 0.002);
    if (i > 0) way += (p.point_mm - path->points[i - 1].point_mm).norm();
    EXPECT_NEAR(p.s_mm, way, 1e-9);
    EXPECT_NEAR(p.time_s, way / 10.0, 1e-9);
    EXPECT_EQ(p.source, PathSource::kMeasured);
    EXPECT_NEAR(p.tangent.dot(p.normal), 0.0, 1e-12);
  }
  EXPECT_NEAR(path->length_mm, way, 1e-9);
}

TEST(ToolPath, SigmasAreTrueWithErrorsAloneAndShared) {
  base::Vector6d station;
  station << 2e-5, 3e-5, 1e-5, 0.03, 0.02, 0.04;
  RimErrors errors{.across_mm = 0.08, .normal_mm = 0.06, .station_sigmas = {station, station, station}, .scale = 2e-5};
  const TrueRim rim = formed(wave(0.4, 3.0), wave(0.3, 2.0));
  constexpr int kSeeds = 100;
  constexpr std::size_t kPlaces = 12;
  Eigen::Vector2d squares = Eigen::Vector2d::Zero();
  for (int seed = 0; seed < kSeeds; ++seed) {
    std::mt19937_64 random(static_cast<unsigned>(seed) + 500U);
    const EdgeCurve edge = measured_rim(rim, some_pose(), 700, errors, random);
    const auto path = tool_path(edge, circle(), some_pose(), base::Matrix6d::Zero(), {.step_mm = 20.0, .cutoff_mm = 30.0});
    ASSERT_TRUE(path.has_value()) << path.error().message;
    for (std::size_t k = 0; k < kPlaces; ++k) {
      const ToolPathPoint& p = path->points[(2 * k + 1) * path->points.size() / (2 * kPlaces)];
      const Eigen::Vector3d q = some_pose().inverse() * p.point_mm;
      const TruePoint truth = rim(std::atan2(q.y(), q.x()) / (2.0 * pi));
      squares(0) += std::pow((truth.point.head<2>().norm() - q.head<2>().norm()) / p.sigma_u_mm, 2);
      squares(1) += std::pow((truth.point.z() - q.z()) / p.sigma_v_mm, 2);
    }
  }
  squares /= static_cast<double>(kSeeds * kPlaces);
  // Places of one station share its error: about 3 stations by 2 independent parts a seed.
  const double bound = 4.0 * std::sqrt(2.0 / (kSeeds * 3.0));
  EXPECT_NEAR(squares(0), 1.0, bound);
  EXPECT_NEAR(squares(1), 1.0, bound);
}

TEST(ToolPath, TheTorchFollowsTheSurfaceAndItsSigmasAreTrue) {
  base::Vector6d station;
  station << 4e-4, 4e-4, 4e-4, 0.03, 0.02, 0.04;
  const RimErrors errors{
      .across_mm = 0.05, .normal_mm = 0.03, .tilt_rad = 4e-3, .depths_mm = 20.0, .station_sigmas = {station, station, station}};
  // A plate that the heat has bent: its normal leans by up to 10 mrad from that of the nominal, twice round the hole.
  const auto bent = [](double u) { return 0.01 * std::sin(4.0 * pi * u); };
  const TrueRim rim = [&](double u) {
    TruePoint p = formed(wave(0.4, 3.0), wave(0.3, 2.0))(u);
    const Eigen::Vector3d inwards(-std::cos(2.0 * pi * u), -std::sin(2.0 * pi * u), 0.0);
    p.normal = (Eigen::Vector3d::UnitZ() + bent(u) * inwards).normalized();
    return p;
  };
  constexpr int kSeeds = 60;
  constexpr std::size_t kPlaces = 24;
  Eigen::Vector2d squares = Eigen::Vector2d::Zero();
  double worst = 0.0;
  for (int seed = 0; seed < kSeeds; ++seed) {
    std::mt19937_64 random(static_cast<unsigned>(seed) + 900U);
    const EdgeCurve edge = measured_rim(rim, some_pose(), 300, errors, random);
    const auto path = tool_path(edge, circle(), some_pose(), base::Matrix6d::Zero(), {.max_slope = 1.0});
    ASSERT_TRUE(path.has_value()) << path.error().message;
    for (std::size_t k = 0; k < kPlaces; ++k) {
      const ToolPathPoint& p = path->points[(2 * k + 1) * path->points.size() / (2 * kPlaces)];
      const Eigen::Vector3d q = some_pose().inverse() * p.point_mm;
      const Eigen::Vector3d torch = some_pose().rotation.conjugate() * p.torch;
      const double phi = std::atan2(q.y(), q.x());
      const Eigen::Vector3d inwards(-std::cos(phi), -std::sin(phi), 0.0), ahead(-std::sin(phi), std::cos(phi), 0.0);
      const Eigen::Vector2d error(torch.dot(inwards) - bent(phi / (2.0 * pi)), torch.dot(ahead));
      squares += error.cwiseQuotient(p.sigma_torch_rad).cwiseAbs2();
      worst = std::max(worst, error.norm());
    }
  }
  squares /= static_cast<double>(kSeeds * kPlaces);
  const double bound = 4.0 * std::sqrt(2.0 / (kSeeds * 12.0));
  EXPECT_NEAR(squares(0), 1.0, bound) << "towards the opening";
  EXPECT_NEAR(squares(1), 1.0, bound) << "along the way";
  EXPECT_LT(worst, 0.02);
}

TEST(ToolPath, GapsKeepTheNominalAreMarkedAndNotSmoothedAway) {
  const double length = pi * kDiameter_mm;
  EdgeCurve edge = noiseless(formed([](double) { return 0.3; }, [](double) { return -0.2; }));
  // 40 mm are missing about a quarter of the way round.
  const double from = length / 4.0 - 20.0;
  std::erase_if(edge.points, [&](const base::EdgePoint& p) { return std::abs(p.s_mm - length / 4.0) < 20.0; });
  edge.shared_mm.resize(static_cast<Eigen::Index>(3 * edge.points.size()), 0);
  base::Matrix6d place_cov = base::Matrix6d::Zero();
  place_cov.bottomRightCorner<3, 3>() = 0.1 * 0.1 * Eigen::Matrix3d::Identity();
  const auto path = tool_path(edge, circle(), {}, place_cov);
  ASSERT_TRUE(path.has_value()) << path.error().message;
  ASSERT_EQ(path->gaps.size(), 1U);
  EXPECT_NEAR(path->gaps[0].from_mm, from, 4.0);
  EXPECT_NEAR(path->gaps[0].length_mm, 40.0, 5.0);
  ASSERT_EQ(path->warnings.size(), 1U);
  EXPECT_EQ(path->warnings[0].code, "gap");
  int nominal = 0;
  for (std::size_t i = 1; i < path->points.size(); ++i) {
    const ToolPathPoint& p = path->points[i];
    EXPECT_LT(std::abs(p.correction_u_mm - path->points[i - 1].correction_u_mm), 0.15) << "no step where the gap begins";
    if (p.source != PathSource::kNominal) continue;
    ++nominal;
    EXPECT_EQ(p.correction_u_mm, 0.0);
    EXPECT_NEAR(p.point_mm.norm(), 300.0, 1e-9);
    EXPECT_NEAR(p.sigma_u_mm, std::hypot(0.1, 0.3), 1e-6) << "the place's own and what the rim is off elsewhere";
    EXPECT_NEAR(p.sigma_v_mm, std::hypot(0.1, 0.2), 1e-6);
  }
  EXPECT_NEAR(nominal, 20.0 / 2.0, 2.0);
  const auto refused = tool_path(edge, circle(), {}, place_cov, {.max_gap_mm = 30.0});
  ASSERT_FALSE(refused.has_value());
  EXPECT_EQ(refused.error().code, ErrorCode::kBadInput);
  EXPECT_THAT(refused.error().message, HasSubstr("gap of 40"));
}

TEST(ToolPath, AGapThatTheRimNamesIsOneHoweverShort) {
  const double length = pi * kDiameter_mm;
  EdgeCurve edge = noiseless(formed([](double) { return 0.3; }, [](double) { return 0.0; }));
  std::erase_if(edge.points, [&](const base::EdgePoint& p) { return std::abs(p.s_mm - length / 4.0) < 3.0; });
  edge.shared_mm.resize(static_cast<Eigen::Index>(3 * edge.points.size()), 0);
  EXPECT_TRUE(tool_path(edge, circle(), {}, base::Matrix6d::Zero())->gaps.empty()) << "6 mm are less than the filter's 10";
  for (std::size_t i = 1; i < edge.points.size(); ++i) {
    const double step = edge.points[i].s_mm - edge.points[i - 1].s_mm;
    if (step > 5.0) edge.gaps.push_back({edge.points[i - 1].s_mm, step, "a magnet"});
  }
  ASSERT_EQ(edge.gaps.size(), 1U);
  const auto path = tool_path(edge, circle(), {}, base::Matrix6d::Zero());
  ASSERT_TRUE(path.has_value());
  ASSERT_EQ(path->gaps.size(), 1U);
  EXPECT_EQ(path->gaps[0].reason, "a magnet");
}

TEST(ToolPath, TheTorchLeansAsItIsTold) {
  const double bevel = 0.5;
  const double lead = 0.2;
  const EdgeCurve edge = noiseless(formed(wave(0.0, 1.0), wave(0.0, 1.0)));
  for (const bool counter_clockwise : {true, false}) {
    const auto path = tool_path(
        edge, circle(), {}, base::Matrix6d::Zero(),
        {.counter_clockwise = counter_clockwise, .bevel_rad = bevel, .lead_rad = lead, .standoff_mm = 4.0, .offset_mm = 1.5});
    ASSERT_TRUE(path.has_value()) << path.error().message;
    for (const ToolPathPoint& p : path->points) {
      const Eigen::Vector3d radial = Eigen::Vector3d(p.point_mm.x(), p.point_mm.y(), 0.0).normalized();
      const Eigen::Vector3d forward = (counter_clockwise ? 1.0 : -1.0) * Eigen::Vector3d::UnitZ().cross(radial);
      EXPECT_NEAR(p.torch.norm(), 1.0, 1e-12);
      EXPECT_NEAR(p.torch.dot(p.tangent), std::sin(lead), 1e-12);
      EXPECT_GT(p.tangent.dot(forward), 0.99);
      EXPECT_NEAR(p.torch.z(), std::cos(lead) * std::cos(bevel), 1e-9);
      const Eigen::Vector3d tip = p.point_mm - 4.0 * p.torch;
      EXPECT_NEAR(tip.head<2>().norm(), 298.5, 1e-4) << "1.5 mm into the opening";
      const Eigen::Matrix3d axes = p.frame_from_tool();
      EXPECT_NEAR((axes.transpose() * axes - Eigen::Matrix3d::Identity()).norm(), 0.0, 1e-12);
      EXPECT_NEAR(axes.determinant(), 1.0, 1e-12);
    }
    const ToolPathPoint& first = path->points.front();
    EXPECT_LT(first.torch.x(), 0.0) << "over the opening, whichever way it goes";
  }
}

TEST(ToolPath, NormalsAreTheSurfaces) {
  const EdgeCurve edge = noiseless(on_cylinder(true_ellipse(kDiameter_mm, kDiameter_mm), 2150.0), some_pose(), 1500);
  const auto path = tool_path(edge, circle(Saddle{2150.0}), some_pose(), base::Matrix6d::Zero());
  ASSERT_TRUE(path.has_value()) << path.error().message;
  for (const ToolPathPoint& p : path->points) {
    const Eigen::Vector3d q = some_pose().inverse() * p.point_mm;
    const Eigen::Vector3d truth = some_pose().rotation * Eigen::Vector3d(0.0, q.y(), q.z() + 2150.0).normalized();
    EXPECT_LT(std::acos(std::min(1.0, p.normal.dot(truth))), 1e-4);
  }
}

TEST(ToolPath, IsSlowerWhereTheTorchTurns) {
  const EdgeCurve edge = noiseless(formed(wave(0.0, 1.0), wave(0.0, 1.0)));
  const auto path = tool_path(edge, circle(), {}, base::Matrix6d::Zero(), {.speed_mm_per_s = 30.0, .max_turn_rad_per_s = 0.05});
  ASSERT_TRUE(path.has_value());
  // On a circle the torch turns by speed / radius.
  EXPECT_NEAR(path->points[10].speed_mm_per_s, 0.05 * 300.0, 0.01);
  EXPECT_NEAR(path->duration_s, 2.0 * pi / 0.05, 0.1);
}

TEST(ToolPath, StraightLinesKeepTheirCorners) {
  Nominal square{NominalKind::kPoints};
  square.points_mm = {{0, 0, 0}, {201, 0, 0}, {201, 101, 0}, {0, 101, 0}};
  square.spline = false;
  const NominalCurve nominal = *NominalCurve::make(square);
  const TrueRim rim = [&](double u) { return TruePoint{nominal.at(u * nominal.length_mm()).point_mm}; };
  const auto path =
      tool_path(noiseless(rim, {}, 1208), nominal, {}, base::Matrix6d::Zero(), {.step_mm = 7.0, .cutoff_mm = 3.0});
  ASSERT_TRUE(path.has_value()) << path.error().message;
  for (const Eigen::Vector3d& corner : square.points_mm) {
    double nearest = 1e9;
    for (const ToolPathPoint& p : path->points) nearest = std::min(nearest, (p.point_mm - corner).norm());
    EXPECT_LT(nearest, 1e-3);
  }
}

TEST(ToolPath, WhatMayNotBeCutIsRefused) {
  const auto message = [](const EdgeCurve& edge, const ToolPathOptions& options, const NominalCurve& nominal = circle()) {
    const auto path = tool_path(edge, nominal, {}, base::Matrix6d::Zero(), options);
    EXPECT_FALSE(path.has_value());
    return path ? std::string() : path.error().message;
  };
  const EdgeCurve good = noiseless(formed(wave(0.0, 1.0), wave(0.0, 1.0)));
  EXPECT_THAT(message(noiseless(formed([](double) { return 12.0; }, wave(0.0, 1.0))), {}),
              HasSubstr("12.00 mm from the nominal"));
  EXPECT_THAT(message(noiseless(formed(wave(1.0, 60.0), wave(0.0, 1.0))), {}), HasSubstr("mm per mm"));
  EXPECT_THAT(message(good, {.reach = Reach{{-500, -500, -500}, {500, 299, 500}}}), HasSubstr("y = 299."));
  EXPECT_THAT(message(good, {.reach = Reach{{-500, -500, -500}, {500, 500, 20}}, .retract_mm = 50.0}),
              HasSubstr("retracted by 50 mm"));
  EXPECT_THAT(message(good, {.offset_mm = 310.0}), HasSubstr("folds"));
  EXPECT_THAT(message(good, {.step_mm = 0.0}), HasSubstr("step_mm"));
  EXPECT_THAT(message(good, {.bevel_rad = 1.5}), HasSubstr("bevel"));
  EXPECT_THAT(message(good, {.reach = Reach{{0, 0, 0}, {1, 1, -1}}}), HasSubstr("low below high"));
  EdgeCurve two = good;
  two.points.resize(2);
  EXPECT_THAT(message(two, {}), HasSubstr("2 points of the rim"));
}

TEST(ToolPath, AnOpenNominalIsMarkedWhereTheRimEndsBeforeIt) {
  Nominal arc{NominalKind::kPoints};
  arc.closed = false;
  for (int i = 0; i <= 60; ++i) {
    const double phi = pi * i / 60.0;
    arc.points_mm.emplace_back(300.0 * std::cos(phi), 300.0 * std::sin(phi), 0.0);
    arc.normals.emplace_back(Eigen::Vector3d::UnitZ());
  }
  const NominalCurve nominal = *NominalCurve::make(arc);
  const auto path = tool_path(noiseless(formed([](double) { return 0.2; }, wave(0.0, 1.0)), {}, 2000, 0.02, 0.6), nominal, {},
                              base::Matrix6d::Zero());
  ASSERT_TRUE(path.has_value()) << path.error().message;
  EXPECT_FALSE(path->closed);
  ASSERT_EQ(path->gaps.size(), 1U);
  EXPECT_NEAR(path->gaps[0].length_mm, 0.02 * 600.0 * pi, 4.0);
  EXPECT_EQ(path->points.front().source, PathSource::kNominal);
  EXPECT_EQ(path->points.back().source, PathSource::kMeasured);
  EXPECT_NEAR(path->points.back().point_mm.norm(), 299.8, 2e-3)
      << "a natural spline leaves the circle by a micrometre at its end";
}

}  // namespace
}  // namespace crosstie::edge
