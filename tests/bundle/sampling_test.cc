// The headline of the adjustment: its covariance is true. The same network is disturbed 200 times; the errors of all unknowns
// together, and of the points alone, must have the covariance that is stated.
#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "bundle/adjust.h"
#include "math/distributions.h"
#include "math/rigid_alignment.h"
#include "tests/bundle/normalised_square.h"
#include "tests/bundle/seeds.h"
#include "tests/bundle/synthetic_network.h"

namespace crosstie::bundle {
namespace {

enum class Datum { kInner, kMinimal, kThreeTwoOne, kControl };

/// Four points whose coordinates are known with a full covariance, drawn anew.
base::ControlGroup control_points(const tests::SyntheticNetwork& synthetic, std::uint64_t seed) {
  constexpr Eigen::Index kSize = 12;
  tests::Random layout(5);
  Eigen::MatrixXd root(kSize, kSize);
  for (double& value : root.reshaped()) value = 0.01 * layout.normal();
  tests::Random random(1000 + seed);
  Eigen::VectorXd normal(kSize);
  for (double& value : normal) value = random.normal();
  base::ControlGroup group;
  group.xyz_mm = root * normal;
  group.cov_mm2 = root * root.transpose();
  for (const std::size_t i : {std::size_t{0}, std::size_t{4}, synthetic.ids.size() - 5, synthetic.ids.size() - 1}) {
    group.xyz_mm.segment<3>(static_cast<Eigen::Index>(3 * group.ids.size())) += synthetic.points[i];
    group.ids.push_back(synthetic.ids[i]);
  }
  return group;
}

/// Where the frame of a result comes from: the network itself, six coordinates of one point and two others, or planes.
std::vector<base::DatumPoint> datum_points(const tests::SyntheticNetwork& synthetic, Datum datum) {
  if (datum == Datum::kInner || datum == Datum::kControl) return {};
  const auto place = [&](std::size_t i) { return synthetic.points[i]; };
  const std::size_t last = synthetic.points.size() - 1;
  if (datum == Datum::kMinimal) {
    return {{synthetic.ids[0], place(0)},
            {synthetic.ids[last], place(last), {false, true, true}},
            {synthetic.ids[4], place(4), {false, false, true}}};
  }
  // Three points give z, two of others y, one x.
  return {{synthetic.ids[0], place(0), {false, false, true}},
          {synthetic.ids[4], place(4), {false, false, true}},
          {synthetic.ids[last], place(last), {false, true, true}},
          {synthetic.ids[last - 4], place(last - 4), {false, true, false}},
          {synthetic.ids[2], place(2), {true, false, false}}};
}

/// The motion that brings the truth into the datum of the result.
math::Alignment result_from_truth(const tests::SyntheticNetwork& truth, const base::AdjustedNetwork& result, Datum datum,
                                  bool scale_is_free) {
  if (datum != Datum::kInner) return {};  // its coordinates are the true ones
  std::vector<math::AlignmentPair> pairs;
  for (const auto& point : result.points) {
    math::AlignmentPair& pair = pairs.emplace_back();
    pair.a_mm = point.xyz_mm;
    pair.b_mm = truth.point(point.id);
  }
  const auto fit = math::align(pairs, {.with_scale = scale_is_free, .weighted = false});
  EXPECT_TRUE(fit);
  return *fit;
}

/// True minus adjusted of the unknowns in the order of the covariance.
Eigen::VectorXd errors(const tests::SyntheticNetwork& truth, const base::AdjustedNetwork& result,
                       const math::Alignment& motion) {
  Eigen::VectorXd error(result.covariance.rows());
  Eigen::Index at = 0;
  for (std::size_t c = 0; c < result.cameras.size(); ++c) {
    const Eigen::VectorXd& parameters = result.cameras[c].camera.parameters();
    error.segment(at, parameters.size()) = truth.cameras[c].parameters() - parameters;
    at += parameters.size();
  }
  for (std::size_t c = 1; c < truth.rig_from_camera.size(); ++c) {
    error.segment<6>(at) = base::difference(result.rigs.front().mounts[c].rig_from_camera, truth.rig_from_camera[c]);
    at += 6;
  }
  // On a rig the pose of a station is that of its first camera.
  for (std::size_t i = 0; i < result.images.size(); i += std::max<std::size_t>(1, truth.rig_from_camera.size())) {
    base::Pose true_pose = truth.network_from_camera[i];
    true_pose.translation_mm *= motion.scale;
    error.segment<6>(at) = base::difference(result.images[i].network_from_camera, motion.a_from_b * true_pose);
    at += 6;
  }
  for (const auto& point : result.points) {
    error.segment<3>(at) = motion.a_from_b * (motion.scale * truth.point(point.id)) - point.xyz_mm;
    at += 3;
  }
  EXPECT_EQ(at, error.size());
  return error;
}

void expect_true_covariance(tests::SyntheticOptions options, Datum datum, bool scale_is_free) {
  const int repetitions = tests::seeds(200);
  double all = 0.0;
  double points = 0.0;
  double poses = 0.0;
  double square_sum = 0.0;
  int dof_all = 0;
  int dof_points = 0;
  int dof_poses = 0;
  int redundancy = 0;
  for (int k = 1; k <= repetitions; ++k) {
    options.seed = static_cast<std::uint64_t>(k);
    tests::SyntheticNetwork synthetic = tests::make_synthetic(options);
    if (scale_is_free) {
      synthetic.network.scale_bars.clear();
      synthetic.network.scale_is_free = true;
    }
    synthetic.network.datum = datum_points(synthetic, datum);
    if (datum == Datum::kControl) {
      synthetic.network.scale_bars.clear();
      synthetic.network.control.push_back(control_points(synthetic, options.seed));
    }
    // The true sigmas are given, and nothing is rejected: the distribution of the errors is then known exactly.
    const auto result = adjust(
        synthetic.network, {.model_sigma_px = 0.0, .reject_outliers = false, .variance_components = VarianceComponents::kNone});
    ASSERT_TRUE(result) << result.error().message;
    ASSERT_EQ(result->points.size(), synthetic.points.size());
    ASSERT_TRUE(result->rejected.empty());
    const Eigen::MatrixXd covariance = result->covariance / (result->sigma0 * result->sigma0);
    const Eigen::VectorXd error = errors(synthetic, *result, result_from_truth(synthetic, *result, datum, scale_is_free));
    const int defect = result->conditions;
    ASSERT_EQ(defect, datum == Datum::kControl ? 0 : scale_is_free ? 7 : 6);
    all += tests::normalised_square(error, covariance, defect);
    const auto count = static_cast<Eigen::Index>(3 * result->points.size());
    points += tests::normalised_square(error.tail(count), covariance.bottomRightCorner(count, count), defect);
    const auto of_poses =
        static_cast<Eigen::Index>(6 * result->images.size() / std::max<std::size_t>(1, synthetic.rig_from_camera.size()));
    const Eigen::Index first = error.size() - count - of_poses;
    poses += tests::normalised_square(error.segment(first, of_poses), covariance.block(first, first, of_poses, of_poses), 0);
    dof_all += result->unknowns - defect;
    dof_points += static_cast<int>(count) - defect;
    dof_poses += static_cast<int>(of_poses);
    square_sum += result->sigma0 * result->sigma0 * result->redundancy;
    redundancy += result->redundancy;
  }
  const auto within = [](double sum, int dof) {
    EXPECT_GT(sum, math::chi_square_quantile(0.0005, dof)) << sum / dof;
    EXPECT_LT(sum, math::chi_square_quantile(0.9995, dof)) << sum / dof;
  };
  within(all, dof_all);
  within(points, dof_points);
  within(poses, dof_poses);
  within(square_sum, redundancy);
}

const tests::SyntheticOptions kSolid{.cameras = 1, .images = 7, .columns = 5, .rows = 3, .depth_mm = 250.0};

TEST(Sampling, CovarianceOfASolidNetworkIsTrue) { expect_true_covariance(kSolid, Datum::kInner, false); }

TEST(Sampling, CovarianceInAMinimalDatumIsTrue) { expect_true_covariance(kSolid, Datum::kMinimal, false); }

TEST(Sampling, CovarianceInAThreeTwoOneDatumIsTrue) { expect_true_covariance(kSolid, Datum::kThreeTwoOne, false); }

TEST(Sampling, CovarianceWithControlPointsIsTrue) { expect_true_covariance(kSolid, Datum::kControl, false); }

TEST(Sampling, CovarianceOfARigIsTrue) {
  tests::SyntheticOptions options = kSolid;
  options.cameras = 2;
  options.images = 12;
  options.rig = true;
  expect_true_covariance(options, Datum::kInner, false);
}

TEST(Sampling, DistancesAndTheirSigmasAreTheSameInEveryDatum) {
  std::vector<base::AdjustedNetwork> results;
  for (const Datum datum : {Datum::kInner, Datum::kMinimal, Datum::kThreeTwoOne}) {
    tests::SyntheticNetwork synthetic = tests::make_synthetic(kSolid);
    synthetic.network.datum = datum_points(synthetic, datum);
    auto result = adjust(synthetic.network,
                         {.model_sigma_px = 0.0, .reject_outliers = false, .variance_components = VarianceComponents::kNone});
    ASSERT_TRUE(result) << result.error().message;
    results.push_back(std::move(*result));
  }
  const auto distance = [](const base::AdjustedNetwork& result, std::size_t a, std::size_t b) {
    const Eigen::Vector3d along = (result.points[a].xyz_mm - result.points[b].xyz_mm);
    const Eigen::Index size = result.covariance.rows();
    const auto count = static_cast<Eigen::Index>(result.points.size());
    Eigen::VectorXd gradient = Eigen::VectorXd::Zero(size);
    gradient.segment<3>(size - 3 * (count - static_cast<Eigen::Index>(a))) = along.normalized();
    gradient.segment<3>(size - 3 * (count - static_cast<Eigen::Index>(b))) = -along.normalized();
    return std::pair(along.norm(), std::sqrt(gradient.dot(result.covariance * gradient)));
  };
  for (std::size_t a = 0; a < results[0].points.size(); ++a) {
    for (std::size_t b = 0; b < a; ++b) {
      const auto [length, sigma] = distance(results[0], a, b);
      EXPECT_GT(sigma, 0.0);
      for (const std::size_t other : {1, 2}) {
        EXPECT_NEAR(distance(results[other], a, b).first, length, 1e-8);
        EXPECT_NEAR(distance(results[other], a, b).second / sigma, 1.0, 1e-6);
      }
    }
  }
  // Coordinates and their sigmas do differ.
  EXPECT_GT((results[1].points[7].xyz_mm - results[0].points[7].xyz_mm).norm(), 1.0);
  EXPECT_GT(results[1].points[7].cov_mm2.trace(), 1.5 * results[0].points[7].cov_mm2.trace());
}

TEST(Sampling, CovarianceOfAPlaneWithTwoCamerasAndFreeScaleIsTrue) {
  expect_true_covariance({.cameras = 2, .images = 10, .columns = 5, .rows = 3, .depth_mm = 0.0, .bars = false}, Datum::kInner,
                         true);
}

}  // namespace
}  // namespace crosstie::bundle
