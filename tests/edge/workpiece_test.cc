#include "edge/workpiece.h"

#include <cmath>
#include <numbers>
#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <Eigen/Cholesky>
#include <Eigen/Geometry>

#include "tests/edge/synthetic_rim.h"

namespace crosstie::edge {
namespace {

using base::ErrorCode;
using ::testing::HasSubstr;
using tests::some_pose;

Eigen::Vector3d normal_vector(std::mt19937_64& random) {
  std::normal_distribution<double> normal;
  const double x = normal(random);
  const double y = normal(random);
  return {x, y, normal(random)};
}

std::vector<PartPoint> markers() {
  std::vector<PartPoint> points;
  int id = 10;
  for (const Eigen::Vector3d& p :
       {Eigen::Vector3d(0, 0, 0), {1500, 100, 30}, {700, 900, -50}, {-300, 800, 200}, {900, -400, 350}}) {
    PartPoint point;
    point.id = id++;
    point.p_in_part = p;
    point.p_in_machine = some_pose() * p;
    point.machine_cov_mm2 = Eigen::Vector3d(0.02, 0.03, 0.05).cwiseAbs2().asDiagonal();
    point.part_cov_mm2 = 0.01 * 0.01 * Eigen::Matrix3d::Identity();
    points.push_back(point);
  }
  return points;
}

/// 3-2-1: z of three points, y of two, x of one.
std::vector<PartPoint> rps() {
  std::vector<PartPoint> points = markers();
  points.pop_back();
  points[0].axes = {true, true, true};
  points[1].axes = {false, true, true};
  points[2].axes = {false, false, true};
  points[3].axes = {false, false, false};
  return points;
}

double normalised(const Workpiece& part) {
  const base::Vector6d error = base::difference(part.machine_from_part, some_pose());
  return error.dot(part.covariance.ldlt().solve(error));
}

TEST(Workpiece, PerfectPointsGiveTheTruthBack) {
  for (const auto& points : {markers(), rps()}) {
    const auto part = workpiece_from_points(points);
    ASSERT_TRUE(part.has_value()) << part.error().message;
    EXPECT_LT(base::difference(part->machine_from_part, some_pose()).norm(), 1e-8);
    EXPECT_TRUE(part->warnings.empty());
  }
  EXPECT_EQ(workpiece_from_points(markers())->source, "markers");
  EXPECT_EQ(workpiece_from_points(markers())->redundancy, 9);
  EXPECT_EQ(workpiece_from_points(rps())->source, "rps");
  EXPECT_EQ(workpiece_from_points(rps())->redundancy, 0);
}

TEST(Workpiece, SigmasOfPointsAreTrue) {
  constexpr int kSeeds = 400;
  for (const auto& truth : {markers(), rps()}) {
    double sum = 0.0;
    for (int seed = 0; seed < kSeeds; ++seed) {
      std::mt19937_64 random(static_cast<unsigned>(seed));
      std::vector<PartPoint> points = truth;
      for (PartPoint& p : points) {
        p.p_in_machine += p.machine_cov_mm2.diagonal().cwiseSqrt().cwiseProduct(normal_vector(random));
        p.p_in_part += 0.01 * normal_vector(random);
      }
      const auto part = workpiece_from_points(points);
      ASSERT_TRUE(part.has_value());
      sum += normalised(*part);
    }
    EXPECT_NEAR(sum / kSeeds, 6.0, 4.0 * std::sqrt(12.0 / kSeeds));
  }
}

TEST(Workpiece, SigmasOfPointsThatShareErrorsAreTrue) {
  constexpr int kSeeds = 400;
  const std::vector<PartPoint> truth = markers();
  const auto n = static_cast<Eigen::Index>(3 * truth.size());
  Eigen::MatrixXd shared(n, 7);  // the machine's frame, and a scale
  Eigen::MatrixXd joint = Eigen::MatrixXd::Zero(n, n);
  base::Vector6d frame;
  frame << 3e-5, 2e-5, 4e-5, 0.04, 0.03, 0.05;
  for (std::size_t i = 0; i < truth.size(); ++i) {
    const auto row = static_cast<Eigen::Index>(3 * i);
    Eigen::Matrix<double, 3, 6> by_pose;
    by_pose << -base::skew(truth[i].p_in_machine), Eigen::Matrix3d::Identity();
    shared.block<3, 6>(row, 0) = by_pose * frame.asDiagonal();
    shared.block<3, 1>(row, 6) = 4e-5 * truth[i].p_in_machine;
    joint.block<3, 3>(row, row) = truth[i].machine_cov_mm2;
  }
  joint += shared * shared.transpose();
  double sum = 0.0;
  for (int seed = 0; seed < kSeeds; ++seed) {
    std::mt19937_64 random(static_cast<unsigned>(seed) + 7000U);
    std::normal_distribution<double> normal;
    std::vector<PartPoint> points = truth;
    Eigen::VectorXd z(7);
    for (double& value : z) value = normal(random);
    const Eigen::VectorXd together = shared * z;
    for (std::size_t i = 0; i < points.size(); ++i) {
      PartPoint& p = points[i];
      p.p_in_machine += together.segment<3>(static_cast<Eigen::Index>(3 * i)) +
                        p.machine_cov_mm2.diagonal().cwiseSqrt().cwiseProduct(normal_vector(random));
      p.p_in_part += 0.01 * normal_vector(random);
    }
    const auto part = workpiece_from_points(points, joint);
    ASSERT_TRUE(part.has_value());
    sum += normalised(*part);
  }
  EXPECT_NEAR(sum / kSeeds, 6.0, 4.0 * std::sqrt(12.0 / kSeeds));
}

TEST(Workpiece, AMarkerThatMovedIsNamed) {
  std::vector<PartPoint> points = markers();
  points[2].p_in_machine.z() += 1.0;
  const auto part = workpiece_from_points(points);
  ASSERT_TRUE(part.has_value());
  ASSERT_FALSE(part->warnings.empty());
  EXPECT_EQ(part->warnings[0].code, "part_point");
  EXPECT_EQ(part->warnings[0].subject, "12");
  EXPECT_GT(part->sigma0, 3.0);
}

TEST(Workpiece, PointsThatDoNotHoldThePartAreRefused) {
  const auto error = [](const std::vector<PartPoint>& points, const Eigen::MatrixXd& joint = {}) {
    const auto part = workpiece_from_points(points, joint);
    return part ? base::Error{ErrorCode::kInternal, "it was taken"} : part.error();
  };
  std::vector<PartPoint> points = rps();
  points[0].axes = {false, true, true};
  EXPECT_EQ(error(points).code, ErrorCode::kNoUniqueSolution);
  EXPECT_THAT(error(points).message, HasSubstr("lock 5 coordinates"));
  points[1].axes = {false, true, true};
  points[2].axes = {false, true, true};  // six, but none holds x
  EXPECT_EQ(error(points).code, ErrorCode::kNoUniqueSolution);
  EXPECT_THAT(error(points).message, HasSubstr("free"));
  points = markers();
  points.resize(2);
  EXPECT_EQ(error(points).code, ErrorCode::kNoUniqueSolution);
  points = markers();
  for (PartPoint& p : points) p.p_in_part.y() = -p.p_in_part.y();
  EXPECT_EQ(error(points).code, ErrorCode::kBadInput);
  EXPECT_THAT(error(points).message, HasSubstr("mirror"));
  points = markers();
  points[1].id = points[0].id;
  EXPECT_THAT(error(points).message, HasSubstr("twice"));
  points = markers();
  points[1].machine_cov_mm2.setZero();
  EXPECT_THAT(error(points).message, HasSubstr("without a sigma"));
  EXPECT_THAT(error(markers(), Eigen::MatrixXd::Identity(3, 3)).message, HasSubstr("has 3 rows"));
}

TowerAndHole tower_in_part() { return {{100.0, 0.0, 0.0}, Eigen::Vector3d(1.0, 0.0, 0.0), {1500.0, 300.0, 2129.0}}; }

TowerAndHole in_machine(const TowerAndHole& part) {
  // Another point of the same axis, as a fit gives it.
  return {some_pose() * (part.axis_point_mm + 700.0 * part.axis_direction), some_pose().rotation * part.axis_direction,
          some_pose() * part.hole_centre_mm};
}

TEST(Workpiece, ATowersAxisAndItsHoleHoldThePart) {
  const auto part = workpiece_from_tower(tower_in_part(), in_machine(tower_in_part()), 1e-6 * TowerCovariance::Identity());
  ASSERT_TRUE(part.has_value()) << part.error().message;
  EXPECT_LT(base::difference(part->machine_from_part, some_pose()).norm(), 1e-8);
  EXPECT_NEAR(part->radius_error_mm, 0.0, 1e-9);
  EXPECT_TRUE(part->warnings.empty());
}

TEST(Workpiece, SigmasOfATowerAreTrueFromThePointsOfItsShellOn) {
  // A cylinder fitted to noisy points over 60 degrees of its shell, and a hole's centre.
  constexpr int kSeeds = 120;
  constexpr double kRadius_mm = 2150.0;
  const TowerAndHole nominal = {{0.0, 0.0, 0.0}, Eigen::Vector3d::UnitX(), {600.0, 0.0, kRadius_mm}};
  base::Vector6d frame;
  frame << 3e-5, 2e-5, 4e-5, 0.04, 0.03, 0.05;
  double sum = 0.0;
  double radius = 0.0;
  for (int seed = 0; seed < kSeeds; ++seed) {
    std::mt19937_64 random(static_cast<unsigned>(seed) + 40U);
    std::normal_distribution<double> normal;
    std::vector<Eigen::Vector3d> points;
    for (int i = 0; i < 20; ++i) {
      for (int k = 0; k < 12; ++k) {
        const double phi = (k - 5.5) / 11.0 * std::numbers::pi / 3.0;
        const double r = kRadius_mm + 0.1 * normal(random);
        points.push_back(some_pose() * Eigen::Vector3d(60.0 * i, r * std::sin(phi), r * std::cos(phi)));
      }
    }
    Eigen::Vector3d centre = some_pose() * nominal.hole_centre_mm + 0.03 * normal_vector(random);
    base::Vector6d together;
    for (double& value : together) value = normal(random);
    const base::Pose moved = base::perturbed({}, frame.cwiseProduct(together));
    for (auto& p : points) p = moved * p;
    centre = moved * centre;
    const auto fit = math::fit_cylinder(points, {.sigma_mm = 0.1});
    ASSERT_TRUE(fit.has_value());
    Eigen::Vector3d direction = fit->shape.direction;
    if (direction.dot(some_pose().rotation * Eigen::Vector3d::UnitX()) < 0.0) direction = -direction;
    const auto part = workpiece_from_tower(nominal, {fit->shape.point_mm, direction, centre},
                                           tower_covariance(fit->quality, direction, 0.03 * 0.03 * Eigen::Matrix3d::Identity()),
                                           frame.cwiseAbs2().asDiagonal());
    ASSERT_TRUE(part.has_value());
    sum += normalised(*part);
    radius += std::pow(part->radius_error_mm / part->radius_sigma_mm, 2);
  }
  EXPECT_NEAR(sum / kSeeds, 6.0, 4.0 * std::sqrt(12.0 / kSeeds));
  EXPECT_NEAR(radius / kSeeds, 1.0, 4.0 * std::sqrt(2.0 / kSeeds));
}

TEST(Workpiece, ATowerThatSaysNothingIsRefused) {
  TowerAndHole on_axis = tower_in_part();
  on_axis.hole_centre_mm = {500.0, 0.0, 0.0};
  const TowerCovariance small = 1e-6 * TowerCovariance::Identity();
  auto part = workpiece_from_tower(on_axis, in_machine(tower_in_part()), small);
  ASSERT_FALSE(part.has_value());
  EXPECT_THAT(part.error().message, HasSubstr("lies on the tower's axis"));
  part = workpiece_from_tower(tower_in_part(), in_machine(tower_in_part()), TowerCovariance::Identity());
  ASSERT_FALSE(part.has_value());
  EXPECT_EQ(part.error().code, ErrorCode::kNoUniqueSolution);
  TowerAndHole larger = in_machine(tower_in_part());
  larger.hole_centre_mm += some_pose().rotation * Eigen::Vector3d(0.0, 0.5, 5.0);
  TowerCovariance covariance = 1e-4 * TowerCovariance::Identity();
  covariance.block<3, 3>(3, 3) *= 1e-6;
  part = workpiece_from_tower(tower_in_part(), larger, covariance);
  ASSERT_TRUE(part.has_value());
  ASSERT_EQ(part->warnings.size(), 1U);
  EXPECT_EQ(part->warnings[0].code, "tower_radius");
}

}  // namespace
}  // namespace crosstie::edge
