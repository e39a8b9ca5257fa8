// The headline of the adjustment: its covariance is true. The same network is disturbed 200 times; the errors of all unknowns
// together, and of the points alone, must have the covariance that is stated.
#include <cmath>

#include <gtest/gtest.h>
#include <Eigen/Eigenvalues>

#include "bundle/adjust.h"
#include "math/distributions.h"
#include "math/rigid_alignment.h"
#include "tests/bundle/synthetic_network.h"

namespace crosstie::bundle {
namespace {

constexpr int kRepetitions = 200;

/// e' Q^+ e with the `defect` least eigenvalues left out; whatever the units of the unknowns are.
double normalised_square(const Eigen::VectorXd& error, const Eigen::MatrixXd& covariance, int defect) {
  const Eigen::VectorXd sigma = covariance.diagonal().cwiseSqrt();
  const Eigen::MatrixXd correlation = sigma.cwiseInverse().asDiagonal() * covariance * sigma.cwiseInverse().asDiagonal();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(correlation);
  EXPECT_LT(std::abs(eigen.eigenvalues()(defect - 1)), 1e-10);
  EXPECT_GT(eigen.eigenvalues()(defect), 1e-8);
  const Eigen::VectorXd scaled = error.cwiseQuotient(sigma);
  double sum = 0.0;
  for (Eigen::Index i = defect; i < scaled.size(); ++i) {
    sum += std::pow(eigen.eigenvectors().col(i).dot(scaled), 2) / eigen.eigenvalues()(i);
  }
  return sum;
}

/// True minus adjusted of the unknowns in the order of the covariance, the truth brought into the datum of the result.
Eigen::VectorXd errors(const tests::SyntheticNetwork& truth, const base::AdjustedNetwork& result, bool scale_is_free) {
  std::vector<math::AlignmentPair> pairs;
  for (const auto& point : result.points) {
    math::AlignmentPair& pair = pairs.emplace_back();
    pair.a_mm = point.xyz_mm;
    pair.b_mm = truth.point(point.id);
  }
  const auto fit = math::align(pairs, {.with_scale = scale_is_free, .weighted = false});
  EXPECT_TRUE(fit);
  Eigen::VectorXd error(result.covariance.rows());
  Eigen::Index at = 0;
  for (std::size_t c = 0; c < result.cameras.size(); ++c) {
    const Eigen::VectorXd& parameters = result.cameras[c].camera.parameters();
    error.segment(at, parameters.size()) = truth.cameras[c].parameters() - parameters;
    at += parameters.size();
  }
  for (std::size_t i = 0; i < result.images.size(); ++i) {
    base::Pose true_pose = truth.network_from_camera[i];
    true_pose.translation_mm *= fit->scale;
    error.segment<6>(at) = base::difference(result.images[i].network_from_camera, fit->a_from_b * true_pose);
    at += 6;
  }
  for (const auto& point : result.points) {
    error.segment<3>(at) = fit->a_from_b * (fit->scale * truth.point(point.id)) - point.xyz_mm;
    at += 3;
  }
  EXPECT_EQ(at, error.size());
  return error;
}

void expect_true_covariance(tests::SyntheticOptions options, bool scale_is_free) {
  double all = 0.0;
  double points = 0.0;
  double square_sum = 0.0;
  int dof_all = 0;
  int dof_points = 0;
  int redundancy = 0;
  for (int k = 1; k <= kRepetitions; ++k) {
    options.seed = static_cast<std::uint64_t>(k);
    tests::SyntheticNetwork synthetic = tests::make_synthetic(options);
    if (scale_is_free) {
      synthetic.network.scale_bars.clear();
      synthetic.network.scale_is_free = true;
    }
    // The true sigmas are given, and nothing is rejected: the distribution of the errors is then known exactly.
    const auto result = adjust(synthetic.network, {.model_sigma_px = 0.0, .reject_outliers = false});
    ASSERT_TRUE(result) << result.error().message;
    ASSERT_EQ(result->points.size(), synthetic.points.size());
    ASSERT_TRUE(result->rejected.empty());
    const Eigen::MatrixXd covariance = result->covariance / (result->sigma0 * result->sigma0);
    const Eigen::VectorXd error = errors(synthetic, *result, scale_is_free);
    const int defect = result->conditions;
    all += normalised_square(error, covariance, defect);
    const auto count = static_cast<Eigen::Index>(3 * result->points.size());
    points += normalised_square(error.tail(count), covariance.bottomRightCorner(count, count), defect);
    dof_all += result->unknowns - defect;
    dof_points += static_cast<int>(count) - defect;
    square_sum += result->sigma0 * result->sigma0 * result->redundancy;
    redundancy += result->redundancy;
  }
  const auto within = [](double sum, int dof) {
    EXPECT_GT(sum, math::chi_square_quantile(0.0005, dof)) << sum / dof;
    EXPECT_LT(sum, math::chi_square_quantile(0.9995, dof)) << sum / dof;
  };
  within(all, dof_all);
  within(points, dof_points);
  within(square_sum, redundancy);
}

TEST(Sampling, CovarianceOfASolidNetworkIsTrue) {
  expect_true_covariance({.cameras = 1, .images = 7, .columns = 5, .rows = 3, .depth_mm = 250.0}, false);
}

TEST(Sampling, CovarianceOfAPlaneWithTwoCamerasAndFreeScaleIsTrue) {
  expect_true_covariance({.cameras = 2, .images = 10, .columns = 5, .rows = 3, .depth_mm = 0.0, .bars = false}, true);
}

}  // namespace
}  // namespace crosstie::bundle
