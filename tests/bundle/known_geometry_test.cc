// Rigs, control points and datums: what is known beforehand is used as it is meant, and contradictions are said.
#include <algorithm>
#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "bundle/adjust.h"
#include "tests/bundle/synthetic_network.h"

namespace crosstie::bundle {
namespace {

bool warns(const base::AdjustedNetwork& result, const std::string& code) {
  return std::any_of(result.warnings.begin(), result.warnings.end(), [&](const auto& warning) { return warning.code == code; });
}

/// Control points one by one, each with the same sigma.
std::vector<base::ControlGroup> control_of(const tests::SyntheticNetwork& synthetic, std::initializer_list<std::size_t> which,
                                           double sigma_mm) {
  std::vector<base::ControlGroup> groups;
  for (const std::size_t i : which) {
    groups.push_back({{synthetic.ids[i]}, synthetic.points[i], sigma_mm * sigma_mm * Eigen::Matrix3d::Identity()});
  }
  return groups;
}

TEST(Rig, IsFoundAndSharedByAllStations) {
  const auto synthetic = tests::make_synthetic({.cameras = 2, .rig = true, .images = 12});
  const auto rig = adjust(synthetic.network);
  ASSERT_TRUE(rig) << rig.error().message;
  ASSERT_EQ(rig->rigs.size(), 1U);
  EXPECT_EQ(rig->rigs[0].stations, 6);
  ASSERT_EQ(rig->rigs[0].mounts.size(), 2U);
  EXPECT_EQ(rig->unknowns, 2 * 9 + 6 + 6 * 6 + 30 * 3);
  const double baseline = synthetic.rig_from_camera[1].translation_mm.norm();
  EXPECT_NEAR(rig->rigs[0].baseline_mm(), baseline, 4.0 * rig->rigs[0].baseline_sigma_mm());
  EXPECT_GT(rig->rigs[0].baseline_sigma_mm(), 1e-4);
  for (std::size_t i = 0; i < rig->images.size(); i += 2) {
    const base::Pose rig_from_camera = rig->images[i].network_from_camera.inverse() * rig->images[i + 1].network_from_camera;
    EXPECT_LT(base::difference(rig_from_camera, rig->rigs[0].mounts[1].rig_from_camera).norm(), 1e-9);
  }
  // The bar is further knowledge: no point is worse known than with cameras that move freely, some are better.
  auto free_network = synthetic.network;
  free_network.rigs.clear();
  const auto free = adjust(free_network);
  ASSERT_TRUE(free);
  double better = 0.0;
  for (std::size_t p = 0; p < free->points.size(); ++p) {
    const double ratio =
        std::sqrt(rig->points[p].cov_mm2.trace() / free->points[p].cov_mm2.trace()) / (rig->sigma0 / free->sigma0);
    EXPECT_LT(ratio, 1.0 + 1e-6);
    better = std::max(better, 1.0 - ratio);
  }
  EXPECT_GT(better, 0.02);
}

TEST(Rig, CarriesAnImageWithOneMarker) {
  auto synthetic = tests::make_synthetic({.cameras = 2, .rig = true, .images = 12});
  synthetic.network.images[5].observations.resize(1);
  const auto result = adjust(synthetic.network);
  ASSERT_TRUE(result) << result.error().message;
  ASSERT_EQ(result->images.size(), 12U);
  EXPECT_EQ(result->images[5].rays, 1);
  EXPECT_LT(base::difference(result->rigs[0].mounts[1].rig_from_camera, synthetic.rig_from_camera[1]).tail<3>().norm(), 0.5);
}

TEST(Rig, ThatCannotBeIsNamed) {
  const auto synthetic = tests::make_synthetic({.cameras = 2, .rig = true, .images = 8});
  const auto refused = [&](auto change, const char* word) {
    base::Network network = synthetic.network;
    change(network.rigs[0]);
    const auto result = adjust(network);
    ASSERT_FALSE(result);
    EXPECT_EQ(result.error().code, base::ErrorCode::kBadInput);
    EXPECT_THAT(result.error().message, testing::HasSubstr(word));
  };
  refused([](base::NetworkRig& rig) { rig.cameras = {"c0"}; }, "two cameras");
  refused([](base::NetworkRig& rig) { rig.cameras = {"c0", "c7"}; }, "c7");
  refused([](base::NetworkRig& rig) { rig.stations[1] = {"i02", "i99"}; }, "i99");
  refused([](base::NetworkRig& rig) { rig.stations[1] = {"i00", "i03"}; }, "two stations");
  refused(
      [](base::NetworkRig& rig) {
        rig.stations[0] = {"i00", "i02"};
        rig.stations[1] = {};
      },
      "same camera");
}

TEST(Control, DefinesFrameAndScale) {
  auto synthetic = tests::make_synthetic({.bars = false});
  synthetic.network.control = control_of(synthetic, {0, 5, 24, 29}, 0.005);
  const auto result = adjust(synthetic.network);
  ASSERT_TRUE(result) << result.error().message;
  EXPECT_EQ(result->conditions, 0);
  EXPECT_EQ(result->datum, "control points");
  EXPECT_EQ(result->scale, "control points");
  ASSERT_EQ(result->control.size(), 4U);
  for (const auto& point : result->points) EXPECT_LT((point.xyz_mm - synthetic.point(point.id)).norm(), 0.08) << point.id;
  for (const auto& control : result->control) EXPECT_LT(control.w, 4.0) << control.id;
}

TEST(Control, WithoutVarianceIsHeld) {
  auto synthetic = tests::make_synthetic({.bars = false});
  synthetic.network.control = control_of(synthetic, {0, 5, 24, 29}, 0.0);
  synthetic.network.control[1].cov_mm2(2, 2) = 1e-4;  // of one coordinate something less is known
  const auto result = adjust(synthetic.network);
  ASSERT_TRUE(result) << result.error().message;
  const auto& held = result->points.front();
  ASSERT_EQ(held.id, synthetic.ids[0]);
  EXPECT_EQ(held.xyz_mm, synthetic.points[0]);
  EXPECT_EQ(held.cov_mm2, Eigen::Matrix3d::Zero().eval());
  const auto& partly = result->points[5];
  EXPECT_EQ(partly.xyz_mm.head<2>(), synthetic.points[5].head<2>());
  EXPECT_GT(partly.cov_mm2(2, 2), 0.0);
  EXPECT_EQ(partly.cov_mm2(0, 0), 0.0);
  EXPECT_EQ(result->unknowns, 9 + 12 * 6 + 30 * 3 - 11);
}

TEST(Control, FromAFreeNetworkIsUsedUpToItsDatum) {
  // The first network gives its points with their full, singular covariance to the second.
  auto first = tests::make_synthetic({.seed = 3});
  const auto source = adjust(first.network, {.model_sigma_px = 0.0});
  ASSERT_TRUE(source);
  base::ControlGroup group;
  const auto count = static_cast<Eigen::Index>(3 * source->points.size());
  group.xyz_mm.resize(count);
  group.cov_mm2 = source->covariance.bottomRightCorner(count, count);
  for (const auto& point : source->points) {
    group.xyz_mm.segment<3>(static_cast<Eigen::Index>(3 * group.ids.size())) = point.xyz_mm;
    group.ids.push_back(point.id);
  }
  auto second = tests::make_synthetic({.bars = false, .seed = 4});
  second.network.control = {group};
  const auto result = adjust(second.network, {.model_sigma_px = 0.0});
  ASSERT_TRUE(result) << result.error().message;
  EXPECT_EQ(result->conditions, 0);
  EXPECT_LT(std::abs(result->sigma0 - 1.0), 0.15);
  // Twice the photographs: sigmas shrink by the root of two where nothing else is in play.
  double ratio = 0.0;
  for (std::size_t p = 0; p < result->points.size(); ++p) {
    ratio += std::sqrt(result->points[p].cov_mm2.trace() / source->points[p].cov_mm2.trace()) /
             static_cast<double>(result->points.size());
  }
  EXPECT_GT(ratio, 0.6);
  EXPECT_LT(ratio, 0.95);
}

TEST(Control, ThatContradictsTheImagesIsNamed) {
  auto synthetic = tests::make_synthetic({.bars = false});
  synthetic.network.control = control_of(synthetic, {0, 5, 24, 29, 14}, 0.01);
  synthetic.network.control[4].xyz_mm.x() += 1.0;
  const auto result = adjust(synthetic.network);
  ASSERT_TRUE(result) << result.error().message;
  EXPECT_TRUE(warns(*result, "contradicting_control"));
  const auto worst =
      std::max_element(result->control.begin(), result->control.end(), [](const auto& a, const auto& b) { return a.w < b.w; });
  EXPECT_EQ(worst->id, synthetic.ids[14]);
  EXPECT_GT(worst->w, 10.0);
}

TEST(Control, TooFewOrMirroredIsRefused) {
  auto synthetic = tests::make_synthetic({.bars = false});
  synthetic.network.control = control_of(synthetic, {0, 29}, 0.01);
  auto result = adjust(synthetic.network);
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().code, base::ErrorCode::kNoUniqueSolution) << result.error().message;
  synthetic.network.control = control_of(synthetic, {0, 5, 24, 29, 14, 8}, 0.01);
  for (auto& control : synthetic.network.control) control.xyz_mm.x() *= -1.0;
  result = adjust(synthetic.network);
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().code, base::ErrorCode::kBadInput) << result.error().message;
}

TEST(Datum, OfReferencePointsIsTheBestFitToThem) {
  auto synthetic = tests::make_synthetic({});
  const base::Pose moved{base::rotation_exp({0.3, -1.1, 0.4}), {500.0, -200.0, 70.0}};
  for (const std::size_t i : {0U, 3U, 11U, 20U, 29U}) {
    synthetic.network.datum.push_back(
        {synthetic.ids[i], moved * synthetic.points[i] + Eigen::Vector3d(0.02 * static_cast<double>(i % 3), 0.01, 0.0)});
  }
  const auto result = adjust(synthetic.network);
  ASSERT_TRUE(result) << result.error().message;
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  Eigen::Vector3d moment = Eigen::Vector3d::Zero();
  for (const auto& datum : synthetic.network.datum) {
    for (const auto& point : result->points) {
      if (point.id != datum.id) continue;
      sum += point.xyz_mm - datum.xyz_mm;
      moment += point.xyz_mm.cross(point.xyz_mm - datum.xyz_mm);
    }
  }
  EXPECT_LT(sum.norm(), 1e-8);
  EXPECT_LT(moment.norm(), 1e-5);
}

TEST(Datum, ThatLeavesTheFrameFreeIsRefused) {
  auto synthetic = tests::make_synthetic({});
  for (const std::size_t i : {0U, 5U, 24U}) {
    synthetic.network.datum.push_back({synthetic.ids[i], synthetic.points[i], {false, false, true}});
  }
  const auto result = adjust(synthetic.network);
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().code, base::ErrorCode::kNoUniqueSolution);
  EXPECT_THAT(result.error().message, testing::HasSubstr("datum leaves the frame free"));
}

TEST(Datum, FitsTheSizeOfAFreeScale) {
  auto synthetic = tests::make_synthetic({.bars = false});
  synthetic.network.scale_is_free = true;
  for (std::size_t i = 0; i < synthetic.ids.size(); ++i)
    synthetic.network.datum.push_back({synthetic.ids[i], synthetic.points[i]});
  const auto result = adjust(synthetic.network);
  ASSERT_TRUE(result) << result.error().message;
  EXPECT_EQ(result->conditions, 7);
  EXPECT_EQ(result->scale, "datum points");
  for (const auto& point : result->points) EXPECT_LT((point.xyz_mm - synthetic.point(point.id)).norm(), 0.1) << point.id;
}

}  // namespace
}  // namespace crosstie::bundle
