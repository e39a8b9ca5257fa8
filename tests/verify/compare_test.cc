#include "verify/compare.h"

#include <gtest/gtest.h>

#include "tests/verify/point_sets.h"

namespace crosstie::verify {
namespace {

using base::ErrorCode;
using base::PointList;
using tests::moved;
using tests::random_points;
using tests::some_pose;

TEST(Compare, RecoversAKnownMotion) {
  const PointList measured = random_points(20, 1);
  const base::Pose truth = some_pose();
  const auto result = compare(measured, moved(measured, truth));
  ASSERT_TRUE(result) << result.error().message;
  EXPECT_EQ(result->fit, "rigid");
  EXPECT_LT(base::difference(truth, result->reference_from_measured).norm(), 1e-9);
  EXPECT_LT(result->rms3d_mm, 1e-9);
  EXPECT_LT(result->max_mm, 1e-9);
  EXPECT_NEAR(result->scale_ppm, 0.0, 1e-6);
  EXPECT_EQ(result->points.size(), 20u);
  EXPECT_EQ(result->lengths.size(), 190u);
  EXPECT_LT(result->length_max_mm, 1e-9);
}

TEST(Compare, RigidFitLeavesTheScaleUnderTest) {
  const PointList measured = random_points(30, 2);
  const PointList reference = moved(measured, some_pose(), 1.0 + 200e-6);
  const auto rigid = compare(measured, reference);
  ASSERT_TRUE(rigid);
  EXPECT_NEAR(rigid->scale_ppm, 200.0, 1e-3);
  EXPECT_GT(rigid->rms3d_mm, 0.02);
  for (const base::LengthDeviation& length : rigid->lengths) {
    EXPECT_NEAR((length.measured_mm - length.nominal_mm) / length.nominal_mm, -200e-6, 1e-6);
  }
  const auto similarity = compare(measured, reference, {.fit = Fit::kSimilarity});
  ASSERT_TRUE(similarity);
  EXPECT_NEAR(similarity->scale_ppm, 200.0, 1e-3);
  EXPECT_LT(similarity->rms3d_mm, 1e-9);
  EXPECT_LT(similarity->length_max_mm, 1e-9);
}

TEST(Compare, DeviationsOfAHandMadeCase) {
  // A square of side 2 and one point off by 0.4 in z, out of four: the fit tilts and lifts, a checkerboard of +-0.1 remains.
  PointList reference;
  reference.points = {{1, {1, 1, 0}, {}}, {2, {-1, 1, 0}, {}}, {3, {-1, -1, 0}, {}}, {4, {1, -1, 0}, {}}};
  PointList measured = reference;
  measured.points[0].xyz_mm.z() = 4e-4;
  const auto result = compare(measured, reference);
  ASSERT_TRUE(result);
  for (std::size_t i = 0; i < 4; ++i) {
    EXPECT_NEAR(result->points[i].deviation_mm.z(), i % 2 == 0 ? 1e-4 : -1e-4, 1e-9);
  }
  EXPECT_NEAR(result->rms_mm.z(), 1e-4, 1e-9);
  EXPECT_NEAR(result->max_mm, 1e-4, 1e-7);
  EXPECT_EQ(result->points[0].untransformed_mm, Eigen::Vector3d(0, 0, 4e-4));
}

TEST(Compare, WithoutAFitCoordinatesAreComparedAsTheyStand) {
  const PointList reference = random_points(6, 3);
  PointList measured = reference;
  for (auto& point : measured.points) point.xyz_mm += Eigen::Vector3d(0.01, -0.02, 0.03);
  const auto result = compare(measured, reference, {.fit = Fit::kNone});
  ASSERT_TRUE(result);
  EXPECT_EQ(result->fit, "none");
  EXPECT_TRUE(result->rms_mm.isApprox(Eigen::Vector3d(0.01, 0.02, 0.03), 1e-9));
  EXPECT_TRUE(result->reference_from_measured.translation_mm.isZero());
}

TEST(Compare, ListsWhatHasNoPartnerAndWhatIsExcluded) {
  const PointList all = random_points(12, 4);
  PointList measured = all;
  PointList reference = moved(all, some_pose());
  measured.points.erase(measured.points.begin());  // id 1 only in the reference
  reference.points.pop_back();                     // id 12 only measured
  measured.points[3].xyz_mm.x() += 5.0;            // id 5 has moved
  const auto result = compare(measured, reference, {.exclude_ids = {5, 99}});
  ASSERT_TRUE(result);
  EXPECT_EQ(result->only_measured, std::vector<int>{12});
  EXPECT_EQ(result->only_reference, std::vector<int>{1});
  EXPECT_LT(result->rms3d_mm, 1e-9);
  EXPECT_EQ(result->lengths.size(), 36u);  // of 9 used points
  const auto& moved_point = result->points[3];
  EXPECT_EQ(moved_point.id, 5);
  EXPECT_FALSE(moved_point.used);
  EXPECT_NEAR(moved_point.deviation_mm.norm(), 5.0, 1e-9);
}

TEST(Compare, DefiningLengthsAreNoTestLengths) {
  const PointList points = random_points(5, 5);
  const auto result = compare(points, points, {.defining_lengths = {{4, 2}}});
  ASSERT_TRUE(result);
  EXPECT_EQ(result->lengths.size(), 9u);
  for (const auto& length : result->lengths) EXPECT_FALSE(length.id_a == 2 && length.id_b == 4);
}

TEST(Compare, SelectsLengthsEvenlyAndKeepsTheLongest) {
  const PointList points = random_points(40, 6);  // 780 pairs
  const auto all = compare(points, points);
  const auto some = compare(points, points, {.max_lengths = 100});
  ASSERT_TRUE(all && some);
  ASSERT_EQ(some->lengths.size(), 100u);
  EXPECT_EQ(some->lengths.back().nominal_mm, all->lengths.back().nominal_mm);
  EXPECT_LT(some->lengths.front().nominal_mm, all->lengths[20].nominal_mm);
}

TEST(Compare, PermissibleErrorGrowsWithLength) {
  const PointList points = random_points(5, 7);
  const auto result = compare(points, points, {.mpe = {0.02, 50000.0}});
  ASSERT_TRUE(result);
  for (const auto& length : result->lengths) EXPECT_DOUBLE_EQ(length.mpe_mm, 0.02 + length.nominal_mm / 50000.0);
}

TEST(Compare, AFreeDatumHasNoUncertaintyOfItsOwnFrame) {
  // Independent errors, then the datum spread over all points by inner constraints: P S P with P = I - G (G'G)^-1 G'.
  constexpr int kCount = 10;
  const PointList points = random_points(kCount, 9);
  Eigen::MatrixXd g(3 * kCount, 6);
  for (int i = 0; i < kCount; ++i) {
    g.middleRows<3>(3 * i) << -base::skew(points.points[static_cast<std::size_t>(i)].xyz_mm), Eigen::Matrix3d::Identity();
  }
  const Eigen::MatrixXd p =
      Eigen::MatrixXd::Identity(3 * kCount, 3 * kCount) - g * (g.transpose() * g).inverse() * g.transpose();
  CompareOptions options;
  options.measured_cov_mm2 = 1e-4 * p * p.transpose();
  const auto result = compare(points, moved(points, some_pose()), options);
  ASSERT_TRUE(result) << result.error().message;
  EXPECT_TRUE(result->pose_cov.isZero(0.0)) << result->pose_cov;
  // The fit takes nothing more away from what the datum has already taken.
  const Eigen::Matrix3d turn = some_pose().rotation.toRotationMatrix();
  for (int i = 0; i < kCount; ++i) {
    const Eigen::Matrix3d expected = turn * options.measured_cov_mm2.block<3, 3>(3 * i, 3 * i) * turn.transpose();
    EXPECT_TRUE(result->points[static_cast<std::size_t>(i)].sigma_mm.isApprox(expected.diagonal().cwiseSqrt(), 1e-6));
  }
  EXPECT_GT(result->scale_sigma_ppm, 0.0);
}

TEST(Compare, RefusesOptionsOutOfTheirDomain) {
  const PointList points = random_points(5, 8);
  EXPECT_EQ(compare(points, points, {.mpe = {-1.0, 1.0}}).error().code, ErrorCode::kUsage);
  EXPECT_EQ(compare(points, points, {.mpe = {0.1, 0.0}}).error().code, ErrorCode::kUsage);
  EXPECT_EQ(compare(points, points, {.max_lengths = -1}).error().code, ErrorCode::kUsage);
  CompareOptions wrong_size;
  wrong_size.measured_cov_mm2 = Eigen::MatrixXd::Identity(3, 3);
  EXPECT_EQ(compare(points, points, wrong_size).error().code, ErrorCode::kBadInput);
}

}  // namespace
}  // namespace crosstie::verify
