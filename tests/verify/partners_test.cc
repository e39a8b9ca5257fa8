#include <algorithm>
#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/verify/point_sets.h"
#include "verify/compare.h"

namespace crosstie::verify {
namespace {

using base::ErrorCode;
using base::PointList;
using ::testing::HasSubstr;
using tests::moved;
using tests::random_points;
using tests::some_pose;

/// The warnings of one code.
std::vector<base::Warning> of_code(const base::Verification& verification, const std::string& code) {
  std::vector<base::Warning> result;
  std::copy_if(verification.warnings.begin(), verification.warnings.end(), std::back_inserter(result),
               [&](const base::Warning& warning) { return warning.code == code; });
  return result;
}

TEST(BadPartner, NoCommonId) {
  PointList reference = random_points(8, 1);
  for (auto& point : reference.points) point.id += 1000;
  const auto result = compare(random_points(8, 1), reference);
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().code, ErrorCode::kBadInput);
  EXPECT_THAT(result.error().message, HasSubstr("1001 to 1008"));
}

TEST(BadPartner, EmptyList) {
  EXPECT_EQ(compare({}, random_points(8, 1)).error().code, ErrorCode::kBadInput);
  EXPECT_EQ(compare(random_points(8, 1), {}).error().code, ErrorCode::kBadInput);
}

TEST(BadPartner, TwoCommonPointsDetermineNoFit) {
  PointList two = random_points(2, 1);
  const auto result = compare(random_points(8, 1), two);
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().code, ErrorCode::kNoUniqueSolution);
  EXPECT_TRUE(compare(random_points(8, 1), two, {.fit = Fit::kNone}));
}

TEST(BadPartner, PointsOnOneLineDetermineNoFit) {
  PointList line;
  for (int i = 0; i < 6; ++i) line.points.push_back({i, {100.0 * i, 50.0 * i, -20.0 * i}, {}});
  EXPECT_EQ(compare(line, moved(line, some_pose())).error().code, ErrorCode::kNoUniqueSolution);
}

TEST(BadPartner, DuplicateIdAndValuesThatAreNotFinite) {
  PointList twice = random_points(8, 1);
  twice.points[4].id = 3;
  EXPECT_THAT(compare(twice, random_points(8, 1)).error().message, HasSubstr("id 3"));
  PointList infinite = random_points(8, 1);
  infinite.points[2].xyz_mm.y() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(compare(random_points(8, 1), infinite).error().code, ErrorCode::kBadInput);
}

TEST(BadPartner, UnitSlips) {
  const PointList points = random_points(9, 2);
  for (const auto& [factor, name] : {std::pair(25.4, "inches"), std::pair(1.0 / 25.4, "inches"), std::pair(1000.0, "m and mm"),
                                     std::pair(0.001, "m and mm"), std::pair(10.0, "cm")}) {
    for (const Fit fit : {Fit::kRigid, Fit::kNone}) {
      const auto result = compare(moved(points, some_pose(), factor), points, {.fit = fit});
      ASSERT_FALSE(result) << factor;
      EXPECT_EQ(result.error().code, ErrorCode::kBadInput);
      EXPECT_THAT(result.error().message, HasSubstr(name));
    }
  }
}

TEST(BadPartner, AnotherScaleIsAWarning) {
  const PointList points = random_points(9, 2);
  const auto result = compare(moved(points, some_pose(), 1.07), points);
  ASSERT_TRUE(result);
  EXPECT_EQ(of_code(*result, "scale_mismatch").size(), 1u);
}

TEST(BadPartner, LeftHandedFramesAndOddPermutations) {
  const PointList points = random_points(15, 3);
  PointList negated = points;
  for (auto& point : negated.points) point.xyz_mm.z() *= -1.0;
  PointList swapped = points;
  for (auto& point : swapped.points) std::swap(point.xyz_mm.x(), point.xyz_mm.y());
  for (const auto& [list, axes] : {std::pair(&negated, "z from -z"), std::pair(&swapped, "x from y, y from x")}) {
    const auto result = compare(*list, points);
    ASSERT_FALSE(result);
    EXPECT_EQ(result.error().code, ErrorCode::kBadInput);
    EXPECT_THAT(result.error().message, HasSubstr("left-handed"));
    EXPECT_THAT(result.error().message, HasSubstr(axes));
  }
  // In any other position too, and with a gross point among them.
  PointList elsewhere = moved(negated, some_pose());
  elsewhere.points[7].xyz_mm.x() += 400.0;
  EXPECT_EQ(compare(elsewhere, points).error().code, ErrorCode::kBadInput);
}

TEST(BadPartner, EvenPermutationFitsAndIsNamed) {
  const PointList points = random_points(15, 4);
  PointList turned = points;
  for (auto& point : turned.points) point.xyz_mm = Eigen::Vector3d(point.xyz_mm.y(), point.xyz_mm.z(), point.xyz_mm.x());
  const auto result = compare(turned, points);
  ASSERT_TRUE(result);
  EXPECT_LT(result->rms3d_mm, 1e-9);
  const auto warnings = of_code(*result, "permuted_axes");
  ASSERT_EQ(warnings.size(), 1u);
  EXPECT_THAT(warnings[0].message, HasSubstr("x from z, y from x, z from y"));
  EXPECT_TRUE(of_code(*compare(moved(points, some_pose()), points), "permuted_axes").empty());
}

TEST(BadPartner, GrossPointsAreNamedAndNoOthers) {
  std::mt19937_64 random(5);
  std::normal_distribution<double> noise(0.0, 0.01);
  for (const int count : {6, 30}) {
    const PointList points = random_points(count, 5);
    PointList measured = moved(points, some_pose());
    for (auto& point : measured.points) point.xyz_mm += Eigen::Vector3d(noise(random), noise(random), noise(random));
    EXPECT_TRUE(of_code(*compare(measured, points), "gross_point").empty());
    measured.points[3].xyz_mm += Eigen::Vector3d(0.0, 2.0, 0.0);
    const auto result = compare(measured, points);
    ASSERT_TRUE(result);
    const auto warnings = of_code(*result, "gross_point");
    ASSERT_EQ(warnings.size(), 1u);
    EXPECT_EQ(warnings[0].subject, "4");
  }
}

TEST(BadPartner, SwappedIdsAreTwoGrossPoints) {
  const PointList points = random_points(20, 6);
  PointList measured = moved(points, some_pose());
  std::swap(measured.points[2].xyz_mm, measured.points[11].xyz_mm);
  const auto result = compare(measured, points);
  ASSERT_TRUE(result);
  const auto warnings = of_code(*result, "gross_point");
  ASSERT_EQ(warnings.size(), 2u);
  EXPECT_EQ(warnings[0].subject, "3");
  EXPECT_EQ(warnings[1].subject, "12");
}

TEST(BadPartner, DifferentObjectsAndDifferentFrames) {
  const auto other = compare(random_points(20, 7), random_points(20, 8));
  ASSERT_TRUE(other) << other.error().message;
  EXPECT_EQ(of_code(*other, "poor_fit").size(), 1u);
  const PointList points = random_points(20, 9);
  const auto frames = compare(moved(points, some_pose()), points, {.fit = Fit::kNone});
  ASSERT_TRUE(frames);
  EXPECT_EQ(of_code(*frames, "frames_differ").size(), 1u);
}

/// Points with ids 1..n, and uncoded ones that the measurement numbers otherwise than the reference does.
struct Uncoded {
  PointList measured;
  PointList reference;
};

Uncoded with_uncoded() {
  Uncoded lists;
  lists.reference = random_points(40, 21);
  lists.measured = moved(lists.reference, some_pose());
  for (std::size_t i = 15; i < 40; ++i) {
    lists.measured.points[i].has_own_id = false;
    // Ids that other points of the reference have: they must not be taken for common ones.
    lists.measured.points[i].id = 1000 + static_cast<int>(i);
    lists.reference.points[i].id = 1000 + static_cast<int>((i + 7) % 25 + 15);
  }
  std::sort(lists.reference.points.begin(), lists.reference.points.end(),
            [](const auto& a, const auto& b) { return a.id < b.id; });
  return lists;
}

TEST(ByPosition, UncodedPointsFindTheirPlacesWhateverTheirIds) {
  Uncoded lists = with_uncoded();
  const base::Pose back = some_pose();
  lists.measured.points[20].xyz_mm += back.rotation * Eigen::Vector3d(0.03, 0.0, -0.04);
  const auto result = compare(lists.measured, lists.reference);
  ASSERT_TRUE(result) << result.error().message;
  EXPECT_EQ(result->points.size(), 15u);
  EXPECT_LT(result->rms3d_mm, 1e-9) << "uncoded points take no part in the fit";
  ASSERT_EQ(result->by_position.points.size(), 25u);
  EXPECT_TRUE(result->by_position.unpaired.empty());
  EXPECT_TRUE(result->only_reference.empty());
  EXPECT_NEAR(result->by_position.max_mm, 0.05, 1e-9);
  EXPECT_NEAR(result->by_position.rms3d_mm, 0.05 / 5.0, 1e-9);
  for (const auto& deviation : result->by_position.points) {
    const int place = (deviation.id - 1000 + 7) % 25 + 15;
    EXPECT_EQ(deviation.reference_id, 1000 + place) << deviation.id;
    EXPECT_FALSE(deviation.used);
  }
}

TEST(ByPosition, NoPartnerOutsideOfTheGateAndNoneTwice) {
  Uncoded lists = with_uncoded();
  const base::Pose back = some_pose();
  lists.measured.points[16].xyz_mm += back.rotation * Eigen::Vector3d(0.0, 0.7, 0.0);  // outside of the default gate
  base::ReferencePoint twin = lists.measured.points[17];                               // a second one at the same place
  twin.id = 1900;
  twin.xyz_mm += back.rotation * Eigen::Vector3d(0.0, 0.0, 0.2);
  lists.measured.points.push_back(twin);
  const auto result = compare(lists.measured, lists.reference);
  ASSERT_TRUE(result) << result.error().message;
  EXPECT_THAT(result->by_position.unpaired, testing::ElementsAre(lists.measured.points[16].id, 1900));
  EXPECT_EQ(result->by_position.points.size(), 24u);
  EXPECT_EQ(result->only_reference.size(), 1u);
  EXPECT_EQ(compare(lists.measured, lists.reference, {.position_gate_mm = 1.0})->by_position.points.size(), 25u);
  EXPECT_EQ(compare(lists.measured, lists.reference, {.position_gate_mm = 0.0}).error().code, ErrorCode::kUsage);
}

TEST(ByPosition, DeviationsOverTheirSigmasAreNearOne) {
  double sum = 0.0;
  int count = 0;
  for (unsigned seed = 1; seed <= 100; ++seed) {
    Uncoded lists = with_uncoded();
    std::mt19937_64 random(seed);
    for (auto& point : lists.measured.points) {
      point.cov_mm2 = tests::random_covariance(random, 0.02);
      point.xyz_mm += tests::sample(random, *point.cov_mm2);
    }
    const auto result = compare(lists.measured, lists.reference);
    ASSERT_TRUE(result);
    ASSERT_EQ(result->by_position.points.size(), 25u);
    sum += 75.0 * std::pow(result->by_position.normalised_rms, 2);
    count += 75;
  }
  // The mean square of deviation over sigma has the expectation 1; its sigma, were all 7500 independent, is sqrt(2 / 7500) = 1.6 %.
  // Those of one comparison share the six parameters of the fit, hence three of these and a half.
  EXPECT_NEAR(sum / count, 1.0, 0.057);
}

TEST(BadPartner, FewPointsAndNoSigmaAreSaid) {
  const auto few = compare(random_points(3, 10), random_points(3, 10));
  ASSERT_TRUE(few);
  EXPECT_EQ(of_code(*few, "few_points").size(), 1u);
  EXPECT_EQ(of_code(*few, "no_sigma").size(), 1u);
  EXPECT_EQ(few->normalised_rms, 0.0);
}

}  // namespace
}  // namespace crosstie::verify
