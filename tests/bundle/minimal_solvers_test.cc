#include "bundle/detail/minimal_solvers.h"

#include <gtest/gtest.h>

#include "tests/bundle/synthetic_network.h"

namespace crosstie::bundle::detail {
namespace {

using Eigen::Vector3d;

double angle_between(const base::Pose& a, const base::Pose& b) { return a.rotation.angularDistance(b.rotation); }

struct TwoViews {
  base::Pose network_from_a = tests::looking_at({300.0, -200.0, 1000.0}, {0.0, 0.0, 0.0}, 0.2);
  base::Pose network_from_b = tests::looking_at({-400.0, 250.0, 1200.0}, {30.0, 10.0, 0.0}, 1.4);
  std::vector<Vector3d> points;
  std::vector<Vector3d> a;
  std::vector<Vector3d> b;

  explicit TwoViews(double depth_mm) {
    tests::Random random(3);
    for (int i = 0; i < 12; ++i) {
      points.emplace_back(random.uniform(-300, 300), random.uniform(-200, 200), depth_mm * random.uniform(-0.5, 0.5));
      a.push_back((network_from_a.inverse() * points.back()).normalized());
      b.push_back((network_from_b.inverse() * points.back()).normalized());
    }
  }
  [[nodiscard]] base::Pose a_from_b() const { return network_from_a.inverse() * network_from_b; }
};

TEST(MinimalSolvers, ThreePointsGiveThePoseAmongFew) {
  const TwoViews views(200.0);
  const auto poses =
      three_point_poses({views.a[0], views.a[3], views.a[7]}, {views.points[0], views.points[3], views.points[7]});
  ASSERT_FALSE(poses.empty());
  double best = 1e9;
  for (const auto& pose : poses) best = std::min(best, base::difference(views.network_from_a, pose).norm());
  EXPECT_LT(best, 1e-6);
}

TEST(MinimalSolvers, ThreePointsOnALineGiveNone) {
  const base::Pose pose = tests::looking_at({300.0, -200.0, 1000.0}, {0.0, 0.0, 0.0}, 0.2);
  std::array<Vector3d, 3> points{Vector3d(0, 0, 0), Vector3d(100, 0, 0), Vector3d(200, 0, 0)};
  std::array<Vector3d, 3> directions;
  for (std::size_t i = 0; i < 3; ++i) directions[i] = (pose.inverse() * points[i]).normalized();
  for (const auto& found : three_point_poses(directions, points)) EXPECT_TRUE(found.translation_mm.allFinite());
}

TEST(MinimalSolvers, FivePointsGiveTheMotionAmongFew) {
  const TwoViews views(300.0);
  const std::array<Vector3d, 5> a{views.a[0], views.a[2], views.a[4], views.a[6], views.a[8]};
  const std::array<Vector3d, 5> b{views.b[0], views.b[2], views.b[4], views.b[6], views.b[8]};
  double best = 1e9;
  for (const auto& essential : five_point_essentials(a, b)) {
    for (std::size_t i = 0; i < 5; ++i) EXPECT_NEAR(a[i].dot(essential / essential.norm() * b[i]), 0.0, 1e-9);
    for (const auto& motion : motions_of_essential(essential)) {
      const double direction = (motion.translation_mm.normalized() - views.a_from_b().translation_mm.normalized()).norm();
      best = std::min(best, angle_between(motion, views.a_from_b()) + direction);
    }
  }
  EXPECT_LT(best, 1e-6);
}

TEST(MinimalSolvers, AHomographyGivesTheMotionAmongTwo) {
  const TwoViews views(0.0);
  const auto motions = motions_of_homography(homography(views.a, views.b), views.a, views.b);
  ASSERT_EQ(motions.size(), 2U);
  double best = 1e9;
  for (const auto& motion : motions) {
    const double direction = (motion.translation_mm.normalized() - views.a_from_b().translation_mm.normalized()).norm();
    best = std::min(best, angle_between(motion, views.a_from_b()) + direction);
  }
  EXPECT_LT(best, 1e-9);
}

TEST(MinimalSolvers, APureRotationHasNoTranslation) {
  const TwoViews views(0.0);
  std::vector<Vector3d> turned;
  const Eigen::Quaterniond rotation = base::rotation_exp({0.1, -0.2, 0.3});
  for (const auto& b : views.b) turned.push_back(rotation * b);
  EXPECT_TRUE(motions_of_homography(homography(turned, views.b), turned, views.b).empty());
}

}  // namespace
}  // namespace crosstie::bundle::detail
