#include <cmath>
#include <functional>

#include <gtest/gtest.h>
#include <Eigen/Cholesky>

#include "bundle/detail/distance.h"
#include "bundle/detail/estimate.h"
#include "math/image_point.h"
#include "math/prior.h"
#include "tests/bundle/synthetic_network.h"
#include "tests/bundle/true_jacobians.h"

namespace crosstie::bundle::detail {
namespace {

using tests::expect_true_jacobians;

/// A lens with all its parameters at work.
Eigen::VectorXd lens_parameters(base::LensModel lens) {
  Eigen::VectorXd parameters = 0.01 * Eigen::VectorXd::LinSpaced(base::parameter_count(lens), 1.0, 2.0);
  if (lens == base::LensModel::kAicon) {
    parameters << 24.0, 0.2, -0.1, -1.2e-4, 2e-7, 3e-10, 6e-6, -8e-6, 1e-4, -2e-4, 9.0, 23.5, 15.6, 2000.0, 1330.0;
  } else {
    parameters.head<4>() << 2100.0, 2090.0, 990.0, 660.0;
  }
  return parameters;
}

/// One image point of a camera that stands alone, or that sits on a rig.
math::Model image_point_model(base::LensModel lens, bool mounted) {
  const Eigen::VectorXd parameters = lens_parameters(lens);
  math::Model model;
  math::Block camera{"camera", math::Block::Kind::kVector, {parameters.data(), parameters.data() + parameters.size()}, {}, {},
                     {}};
  for (int i = 0; i < parameters.size(); ++i) {
    camera.components.emplace_back(base::parameter_names(lens)[static_cast<std::size_t>(i)]);
    if (i != 1 && i < base::adjustable_count(lens)) camera.free.push_back(i);  // one held: the others must keep their columns
  }
  model.add(camera);
  const base::Pose rig_from_camera =
      mounted ? base::Pose{base::rotation_exp({0.02, -0.2, 0.05}), {80.0, 4.0, -7.0}} : base::Pose{};
  const base::Pose network_from_camera = tests::looking_at({400.0, -300.0, 1100.0}, {20.0, 30.0, 0.0}, 0.7);
  model.add(math::pose_block("image", network_from_camera * rig_from_camera.inverse()));
  model.add(math::point_block("point", {120.0, 80.0, -40.0}));
  math::Block mount = math::pose_block("mount", rig_from_camera);
  mount.kind = math::Block::Kind::kMount;
  if (mounted) model.add(mount);
  Eigen::Matrix2d whitening;
  whitening << 30.0, 0.0, -8.0, 45.0;
  model.measurements.push_back(std::make_unique<math::ImagePoint>(math::ImagePoint::Blocks{0, 1, 2, mounted ? 3 : -1}, lens,
                                                                  Eigen::Vector2d(1000.0, 700.0), whitening));
  return model;
}

TEST(Jacobians, ImagePoint) {
  for (const base::LensModel lens :
       {base::LensModel::kPinhole, base::LensModel::kOpenCv5, base::LensModel::kOpenCv12, base::LensModel::kAicon}) {
    for (const bool mounted : {false, true}) {
      math::Model model = image_point_model(lens, mounted);
      expect_true_jacobians(model);
    }
  }
}

TEST(Jacobians, AMountedCameraSeesWhatOneOfItsOwnPoseSees) {
  for (const base::LensModel lens : {base::LensModel::kOpenCv5, base::LensModel::kAicon}) {
    EXPECT_NEAR(image_point_model(lens, true).square_sum() / image_point_model(lens, false).square_sum(), 1.0, 1e-12);
  }
}

TEST(Jacobians, Distance) {
  math::Model model;
  model.add(math::point_block("a", {120.0, 80.0, -40.0}));
  model.add(math::point_block("b", {-300.0, 20.0, 75.0}));
  model.measurements.push_back(std::make_unique<Distance>(0, 1, 400.0, 0.02));
  expect_true_jacobians(model);
}

TEST(Jacobians, Prior) {
  math::Model model;
  math::Block block{"camera", math::Block::Kind::kVector, {1.0, 2.0, 3.0}, {"a", "b", "c"}, {0, 2}, math::BlockRole::kKept};
  model.add(block);
  Eigen::MatrixXd whitening(2, 3);
  whitening << 2.0, 0.0, 0.0, -1.0, 0.0, 5.0;
  model.measurements.push_back(
      std::make_unique<math::Prior>(std::vector<int>{0}, std::vector<int>{3}, Eigen::Vector3d(0.5, 2.0, 3.5), whitening));
  expect_true_jacobians(model);
}

TEST(Jacobians, PriorOfTwoPoints) {
  math::Model model;
  model.add(math::point_block("a", {120.0, 80.0, -40.0}));
  model.add(math::point_block("b", {-300.0, 20.0, 75.0}));
  const Eigen::MatrixXd whitening = Eigen::MatrixXd::Random(4, 6);
  model.measurements.push_back(std::make_unique<math::Prior>(std::vector<int>{0, 1}, std::vector<int>{3, 3},
                                                             Eigen::VectorXd::LinSpaced(6, -1.0, 1.0), whitening));
  expect_true_jacobians(model);
}

TEST(Jacobians, TheNullSpaceIsOne) {
  // Moving, turning and scaling a network of our own making changes no image point.
  const tests::SyntheticNetwork synthetic = tests::make_synthetic({.images = 3, .columns = 3, .rows = 2});
  auto survey = make_survey(synthetic.network);
  ASSERT_TRUE(survey);
  State state = start_state(*survey);
  for (std::size_t i = 0; i < state.poses.size(); ++i) state.poses[i] = synthetic.network_from_camera[i];
  for (std::size_t p = 0; p < state.points.size(); ++p) state.points[p] = synthetic.points[p];
  NetworkModel network = build_model(*survey, state, {});
  const Eigen::MatrixXd directions = null_space(network, {});
  ASSERT_EQ(directions.cols(), 7);
  const auto residuals = [&](const NetworkModel& at) {
    math::WhitenedRows rows;
    EXPECT_TRUE(at.model.linearise(rows));
    Eigen::VectorXd all(rows.row_count());
    for (int g = 0; g < rows.group_count(); ++g) all.segment<2>(2 * g) = rows.residual(g);
    return all;
  };
  for (Eigen::Index k = 0; k < 7; ++k) {
    const double h = 1e-2 / directions.col(k).cwiseAbs().maxCoeff();
    NetworkModel forwards = build_model(*survey, state, {});
    NetworkModel backwards = build_model(*survey, state, {});
    forwards.model.move(h * directions.col(k));
    backwards.model.move(-h * directions.col(k));
    // Third order in h is left; a direction that is observed gives 1e-2 px and more.
    EXPECT_LT((residuals(forwards) - residuals(backwards)).norm(), 1e-7) << k;
  }
}

}  // namespace
}  // namespace crosstie::bundle::detail
