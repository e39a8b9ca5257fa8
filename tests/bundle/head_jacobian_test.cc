#include <random>

#include <gtest/gtest.h>
#include <Eigen/Geometry>

#include "bundle/detail/head_measurements.h"
#include "tests/bundle/true_jacobians.h"

namespace crosstie::bundle::detail {
namespace {

using tests::expect_true_jacobians;

/// A square matrix with nothing special about it.
Eigen::MatrixXd mixed(Eigen::Index rows, Eigen::Index columns, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  Eigen::MatrixXd matrix(rows, columns);
  for (Eigen::Index i = 0; i < matrix.size(); ++i) matrix(i) = normal(random);
  return matrix;
}

base::Pose pose(const Eigen::Vector3d& turn_rad, const Eigen::Vector3d& shift_mm) {
  return {base::rotation_exp(turn_rad), shift_mm};
}

math::Block vector_block(std::string name, std::vector<double> values) {
  math::Block block{std::move(name), math::Block::Kind::kVector, std::move(values), {}, {}, {}};
  for (std::size_t i = 0; i < block.values.size(); ++i) {
    block.components.push_back(std::to_string(i));
    block.free.push_back(static_cast<int>(i));
  }
  return block;
}

TEST(HeadJacobians, Calibration) {
  math::Model model;
  const int left = model.add(vector_block("left", {1400.0, 1401.0, 800.0, 600.0, -0.1, 0.08}));
  const int right = model.add(vector_block("right", {1390.0, 1392.0, 810.0, 610.0}));
  const base::Pose rig_from_right = pose({0.02, -0.6, 0.05}, {760.0, 4.0, 230.0});
  math::Block mount = math::pose_block("rig", base::perturbed(rig_from_right, mixed(6, 1, 4) * 0.01));
  mount.kind = math::Block::Kind::kMount;
  const int rig = model.add(std::move(mount));
  // As many rows as directions, fewer where some are exact.
  for (const Eigen::Index rows : {16, 9}) {
    model.measurements.clear();
    model.measurements.push_back(std::make_unique<HeadPrior>(std::vector<int>{left, right, rig}, mixed(6, 1, 1), mixed(4, 1, 2),
                                                             rig_from_right, mixed(rows, 16, 3)));
    expect_true_jacobians(model);
  }
}

TEST(HeadJacobians, ListOfTheCross) {
  math::Model model;
  const int a = model.add(math::point_block("a", {120.0, 80.0, -40.0}));
  const int b = model.add(math::point_block("b", {-300.0, 20.0, 75.0}));
  const int growth = model.add(vector_block("cross", {57.0}));
  model.measurements.push_back(
      std::make_unique<ListedPoints>(std::vector<int>{a, b}, growth, 100.0 * mixed(6, 1, 5), mixed(6, 6, 6)));
  expect_true_jacobians(model);
}

TEST(HeadJacobians, ProbedCentreOfWhichAllOrSingleCoordinatesCount) {
  for (const Eigen::Index rows : {3, 1}) {
    math::Model model;
    const int frame = model.add(math::pose_block("cross", pose({0.4, -0.2, 1.1}, {900.0, 250.0, -300.0})));
    const int point = model.add(math::point_block("sphere", {690.0, 20.0, 45.0}));
    model.measurements.push_back(
        std::make_unique<ProbedCentre>(frame, point, Eigen::Vector3d(1500.0, 270.0, -250.0), 50.0 * mixed(rows, 3, 7)));
    expect_true_jacobians(model);
  }
}

/// A station beside its place on the axis, by small amounts as in a measurement or by large ones.
void expect_station(const std::vector<AxisTerm>& terms, double axis_mm, double off_rad, double off_mm) {
  Carriage carriage;
  carriage.direction = Eigen::Vector3d(1.0, 3e-3, -2e-3).normalized();
  carriage.across.col(0) = carriage.direction.unitOrthogonal();
  carriage.across.col(1) = carriage.direction.cross(carriage.across.col(0));
  carriage.middle_mm = 600.0;
  carriage.half_mm = 500.0;
  carriage.pivot_mm = {700.0, 40.0, 300.0};
  carriage.terms = terms;
  math::Model model;
  const base::Pose at_middle = pose({2.9, 0.2, 0.1}, {650.0, 300.0, 1100.0});
  std::vector<double> coefficients;
  for (std::size_t i = 0; i < terms.size(); ++i)
    coefficients.push_back((terms[i].angle ? off_rad : off_mm) * (0.3 + 0.1 * static_cast<double>(i)));
  const double direction[2] = {0.3 * off_rad, -0.2 * off_rad};
  const double scale = 80.0;
  double at[7];
  math::pose_to_values(at_middle, at);
  const double* values[] = {at, direction, &scale, coefficients.data()};
  const base::Pose on_axis = carried(carriage, axis_mm, values, nullptr);
  const base::Pose machine_from_cross = pose({0.02, -0.01, 0.7}, {850.0, 300.0, -250.0});
  base::Vector6d off = mixed(6, 1, 11);
  off.head<3>() *= off_rad;
  off.tail<3>() *= off_mm;
  const base::Pose cross_from_rig = machine_from_cross.inverse() * base::perturbed(on_axis, off);
  std::vector<int> blocks{
      model.add(math::pose_block("cross", machine_from_cross)), model.add(math::pose_block("station", cross_from_rig)),
      model.add(math::pose_block("head", at_middle)), model.add(vector_block("axis", {direction[0], direction[1]})),
      model.add(vector_block("scale", {scale}))};
  if (!terms.empty()) blocks.push_back(model.add(vector_block("terms", coefficients)));
  base::Matrix6d whitening = mixed(6, 6, 12);
  whitening.leftCols<3>() *= 1e3;
  model.measurements.push_back(std::make_unique<OnAxis>(std::move(blocks), carriage, axis_mm, whitening));
  expect_true_jacobians(model);
}

TEST(HeadJacobians, StationOnTheAxis) {
  const std::vector<AxisTerm> all = {{0, 2, false}, {1, 2, false}, {2, 3, false}, {0, 1, true}, {1, 1, true}, {2, 2, true}};
  for (const double axis_mm : {100.0, 600.0, 870.0}) {
    expect_station({}, axis_mm, 1e-5, 1e-2);
    expect_station(all, axis_mm, 1e-5, 1e-2);
    expect_station(all, axis_mm, 0.05, 5.0);
  }
}

TEST(HeadJacobians, DifferenceOfPosesAndItsSeriesAgreeWhereTheyMeet) {
  // The series for small angles and the closed form, on both sides of the angle at which they change.
  const auto numeric = [](const base::Pose& from, const base::Pose& to, bool by_to) {
    base::Matrix6d jacobian;
    for (Eigen::Index i = 0; i < 6; ++i) {
      const double h = 1e-5;
      const base::Vector6d step = h * base::Vector6d::Unit(i);
      const auto at = [&](const base::Vector6d& d) {
        return by_to ? base::difference(from, base::perturbed(to, d)) : base::difference(base::perturbed(from, d), to);
      };
      jacobian.col(i) = (at(step) - at(-step)) / (2.0 * h);
    }
    return jacobian;
  };
  for (const double angle : {0.0, 0.9e-3, 1.1e-3, 0.3, 2.0}) {
    const base::Pose from = pose({0.3, -0.8, 0.2}, {3.0, -2.0, 5.0});
    const base::Pose to = base::Pose{base::rotation_exp(angle * Eigen::Vector3d(0.6, -0.48, 0.64)), {0.4, 0.2, -0.7}} * from;
    const DifferenceJacobians by = difference_jacobians(base::difference(from, to));
    EXPECT_LT((by.by_to - numeric(from, to, true)).cwiseAbs().maxCoeff(), 1e-8) << angle;
    EXPECT_LT((by.by_from - numeric(from, to, false)).cwiseAbs().maxCoeff(), 1e-8) << angle;
  }
}

}  // namespace
}  // namespace crosstie::bundle::detail
