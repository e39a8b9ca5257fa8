// A real network of AICON 3D Studio with an independent solution of the same problem to its last digit. The four observations with
// ten times the sigma are those that AICON's own test of outliers weighed down; see the network's report.
#include <cmath>
#include <map>

#include <gtest/gtest.h>

#include "base/aicon_network.h"
#include "base/table.h"
#include "bundle/adjust.h"
#include "tests/bundle/synthetic_network.h"
#include "tests/support/measured_data.h"

namespace crosstie::bundle {
namespace {

constexpr double kSigma_mm = 0.0005;

class AiconNetwork : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = tests::measured_data("aicon-network");
    if (folder_.empty()) GTEST_SKIP() << "no aicon-network in CROSSTIE_DATA";
    const auto project = base::find_aicon_project(folder_);
    ASSERT_TRUE(project) << project.error().message;
    base::AiconNetworkOptions options;
    options.overrides = {{{48, 27}, 0.005}, {{48, 49}, 0.005}, {{48, 60}, 0.005}, {{54, 49}, 0.005}};
    options.excluded = {{32, 1087}, {33, 1087}, {97, 1087}, {98, 1087}};
    auto network = base::read_aicon_network(*project, options);
    ASSERT_TRUE(network) << network.error().message;
    network_ = std::move(*network);
  }

  static base::Result<base::AdjustedNetwork> adjusted(base::Network network) {
    for (base::NetworkCamera& camera : network.cameras) camera.held = {"A3", "C1", "C2"};
    return adjust(network, {.model_sigma_px = 0.0, .reject_outliers = false, .min_angle_rad = 0.0, .full_covariance = false});
  }

  [[nodiscard]] base::Table reference(const char* name) const {
    auto table = base::read_table(folder_ / name);
    EXPECT_TRUE(table);
    return *table;
  }

  void expect_the_reference(const base::AdjustedNetwork& result) const {
    EXPECT_EQ(result.observations, 19945);
    EXPECT_EQ(result.unknowns, 1147);
    EXPECT_EQ(result.conditions, 6);
    EXPECT_EQ(result.redundancy, 18804);
    EXPECT_NEAR(result.sigma0 * kSigma_mm / 4.0536401729e-4, 1.0, 1e-8);

    const base::Table points = reference("reference_points.csv");
    ASSERT_EQ(points.rows.size(), result.points.size());
    std::map<int, const base::AdjustedPoint*> by_id;
    for (const auto& point : result.points) by_id[point.id] = &point;
    for (std::size_t row = 0; row < points.rows.size(); ++row) {
      const base::AdjustedPoint& point = *by_id.at(*points.integer(row, 0));
      for (int axis = 0; axis < 3; ++axis) {
        const auto column = static_cast<std::size_t>(axis);
        EXPECT_NEAR(point.xyz_mm(axis), *points.number(row, 1 + column), 1e-6) << point.id;
        EXPECT_NEAR(std::sqrt(point.cov_mm2(axis, axis)), *points.number(row, 4 + column), 1e-6) << point.id;
      }
      EXPECT_NEAR(point.cov_mm2(0, 2), *points.number(row, 9), 1e-12 + 1e-6 * point.cov_mm2.trace()) << point.id;
    }

    const base::Table images = reference("reference_images.csv");
    ASSERT_EQ(images.rows.size(), result.images.size());
    std::map<std::string, const base::AdjustedImage*> by_name;
    for (const auto& image : result.images) by_name[image.name] = &image;
    for (std::size_t row = 0; row < images.rows.size(); ++row) {
      const base::AdjustedImage& image = *by_name.at(images.rows[row][0]);
      const Eigen::Matrix3d cov = base::position_covariance(image.network_from_camera, image.cov);
      for (int axis = 0; axis < 3; ++axis) {
        const auto column = static_cast<std::size_t>(axis);
        EXPECT_NEAR(image.network_from_camera.translation_mm(axis), *images.number(row, 1 + column), 1e-6) << image.name;
        EXPECT_NEAR(std::sqrt(cov(axis, axis)), *images.number(row, 7 + column), 1e-6) << image.name;
      }
    }

    const base::Table observations = reference("reference_observations.csv");
    ASSERT_EQ(observations.rows.size(), result.residuals.size());
    std::map<std::pair<std::string, int>, Eigen::Vector2d> residual_mm;
    const Eigen::VectorXd& lens = result.cameras.front().camera.parameters();
    for (const auto& observation : result.residuals) {
      residual_mm[{result.images[static_cast<std::size_t>(observation.image)].name,
                   result.points[static_cast<std::size_t>(observation.point)].id}] = {
          observation.residual_px.x() * lens(11) / lens(13), -observation.residual_px.y() * lens(12) / lens(14)};
    }
    for (std::size_t row = 0; row < observations.rows.size(); ++row) {
      const Eigen::Vector2d& v = residual_mm.at({observations.rows[row][0], *observations.integer(row, 1)});
      EXPECT_NEAR(v.x(), *observations.number(row, 5), 1e-9);
      EXPECT_NEAR(v.y(), *observations.number(row, 6), 1e-9);
    }
  }

  std::filesystem::path folder_;
  base::Network network_;
};

TEST_F(AiconNetwork, IsAdjustedToTheLastDigit) {
  const auto result = adjusted(network_);
  ASSERT_TRUE(result) << result.error().message;
  expect_the_reference(*result);
  // Interior orientation against the report of AICON and the independent solution.
  const base::Camera& camera = result->cameras.front().camera;
  const double values[] = {28.78507297775,  0.01734891961, 0.05668730959, -1.0960685077e-4,
                           1.4956597338e-7, 0.0,           5.79842811e-6, -8.64453938e-6};
  const double sigmas[] = {2.513178e-4, 3.441658e-4, 3.262600e-4, 2.978787e-8, 7.655524e-11, 0.0, 1.190972e-7, 1.043919e-7};
  for (int i = 0; i < 8; ++i) {
    EXPECT_NEAR(camera.parameters()(i), values[i], 1e-8 * std::abs(values[i])) << i;
    EXPECT_NEAR(std::sqrt(camera.covariance()(i, i)), sigmas[i], 1e-6 * sigmas[i]) << i;
  }
  const auto correlation = [&](int i, int k) {
    return camera.covariance()(i, k) / std::sqrt(camera.covariance()(i, i) * camera.covariance()(k, k));
  };
  EXPECT_NEAR(correlation(3, 4), -0.909, 5e-4);
  EXPECT_NEAR(correlation(1, 6), 0.939, 5e-4);
  EXPECT_NEAR(correlation(2, 7), 0.800, 5e-4);
  EXPECT_NEAR(correlation(0, 2), 0.555, 5e-4);
}

TEST_F(AiconNetwork, ComesOutTheSameFromStartsFarOff) {
  tests::Random random(3);
  const double angle = 5.0 * std::numbers::pi / 180.0;
  const auto direction = [&] { return Eigen::Vector3d(random.normal(), random.normal(), random.normal()).normalized().eval(); };
  for (base::StartPose& start : network_.start_poses) {
    start.network_from_camera.rotation = base::rotation_exp(angle * direction()) * start.network_from_camera.rotation;
    start.network_from_camera.translation_mm += 50.0 * direction();
  }
  for (base::ReferencePoint& start : network_.start_points) start.xyz_mm += 50.0 * direction();
  const auto result = adjusted(network_);
  ASSERT_TRUE(result) << result.error().message;
  for (const auto& warning : result->warnings) EXPECT_NE(warning.code, "start_values_unused");
  expect_the_reference(*result);
}

TEST_F(AiconNetwork, ComesOutTheSameWithoutStartValues) {
  network_.start_poses.clear();
  network_.start_points.clear();
  const auto result = adjusted(network_);
  ASSERT_TRUE(result) << result.error().message;
  expect_the_reference(*result);
}

TEST_F(AiconNetwork, WrongWeightsShow) {
  // Answers that a mistake would give, as the independent program computed them.
  for (base::ImageObservations& image : network_.images) {
    for (base::Observation& observation : image.observations) {
      if (observation.cov_px2(0, 0) > 0.5) observation.cov_px2 *= 0.01;
    }
  }
  const auto result = adjusted(network_);
  ASSERT_TRUE(result) << result.error().message;
  EXPECT_NEAR(result->sigma0 * result->sigma0 * result->redundancy, 12374.156097908, 1e-5);
  EXPECT_NEAR(result->sigma0 * kSigma_mm, 0.00040560442, 5e-12);
}

}  // namespace
}  // namespace crosstie::bundle
