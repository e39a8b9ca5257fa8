// Points, normals and the calibration's part against a synthetic scan; its parts of the covariance by sampling.
#include "scan/cloud.h"

#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <Eigen/Cholesky>

#include "base/depth_image.h"
#include "base/file.h"
#include "scan/decode.h"
#include "scan/detail/calibration_part.h"
#include "tests/scan/synthetic_scan.h"
#include "tests/support/temporary_folder.h"

namespace crosstie::scan {
namespace {

using tests::SyntheticScan;

struct Scanned {
  std::array<base::PhaseMap, 2> maps;
  DepthMap depths;
};

Scanned scanned(const SyntheticScan& scene, std::uint64_t seed) {
  const auto sequence = tests::gray_and_fringes(24.0, 6, false, false);
  Scanned result;
  for (int camera = 0; camera < 2; ++camera) {
    std::mt19937_64 random(seed + static_cast<std::uint64_t>(camera));
    auto decoder = Decoder::make(sequence, scene.width, scene.height, {});
    for (std::size_t i = 0; i < sequence.patterns.size(); ++i) {
      EXPECT_TRUE(decoder->add(static_cast<int>(i), scene.image(camera, sequence, sequence.patterns[i], random)));
    }
    result.maps[static_cast<std::size_t>(camera)] = *decoder->finish();
  }
  result.depths = *match(result.maps[0], result.maps[1], scene.head, {});
  return result;
}

const base::CloudField& field(const base::Cloud& cloud, const std::string& name) {
  for (const auto& candidate : cloud.fields) {
    if (candidate.name == name) return candidate;
  }
  ADD_FAILURE() << "no field " << name;
  return cloud.fields.front();
}

TEST(ScanCloud, PointsAndNormalsLieOnTheSurface) {
  SyntheticScan scene;
  scene.surface = tests::tilted_plane(1200.0, 0.3);
  const Scanned scan = scanned(scene, 31);
  const auto cloud = make_cloud(scan.depths, scan.maps[0], scene.head, {});
  ASSERT_TRUE(cloud) << cloud.error().message;
  const Eigen::Vector3d normal(-std::sin(0.3), 0.0, -std::cos(0.3));  // towards the camera
  double square = 0.0;
  int oblique = 0;
  Eigen::Vector3d mean_normal = Eigen::Vector3d::Zero();
  const auto& sigma = field(cloud->cloud, "sigma_mm").values;
  for (std::size_t i = 0; i < cloud->cloud.points.size(); ++i) {
    const Eigen::Vector3d& point = cloud->cloud.points[i];
    const double off = normal.dot(point) + 1200.0 * std::cos(0.3);
    square += std::pow(off / (sigma[i] * normal.dot(point.normalized())), 2);
    mean_normal += cloud->cloud.normals[i];
    if (normal.dot(cloud->cloud.normals[i]) < std::cos(0.3)) ++oblique;
  }
  const auto count = static_cast<double>(cloud->cloud.points.size());
  EXPECT_GT(count, 20000);
  EXPECT_NEAR(std::sqrt(square / count), 1.0, 0.05);
  EXPECT_LT(std::acos(normal.dot(mean_normal.normalized())), 2e-3);
  EXPECT_LT(oblique, count / 20);  // at the rim neighbours are missing
  EXPECT_EQ(cloud->correlation_length_mm, 0.0);
  EXPECT_LT(cloud->off_surface, count / 1000);
}

TEST(ScanCloud, FilterMakesNoiseSmallerAndSaysSo) {
  const SyntheticScan scene;
  const Scanned scan = scanned(scene, 32);
  const auto plain = make_cloud(scan.depths, scan.maps[0], scene.head, {});
  CloudOptions options;
  options.filter_radius_px = 1;
  const auto filtered = make_cloud(scan.depths, scan.maps[0], scene.head, options);
  ASSERT_TRUE(plain && filtered);
  const auto ratio = [&](const ScanCloud& cloud) {
    double square = 0.0, count = 0.0;
    for (int y = 0; y < scene.height; ++y) {
      for (int x = 0; x < scene.width; ++x) {
        const float z = cloud.depth_mm[static_cast<std::size_t>(y * scene.width + x)];
        const auto& seen = scene.seen(0, x, y);
        if (std::isnan(z) || !seen) continue;
        square += std::pow(static_cast<double>(z) - seen->point_mm.z(), 2);
        count += 1.0;
      }
    }
    return std::sqrt(square / count);
  };
  EXPECT_GT(ratio(*plain) / ratio(*filtered), 2.0);
  EXPECT_NEAR(filtered->correlation_length_mm, 3.0 * 1200.0 / 501.0, 0.5);
}

TEST(ScanCloud, CalibrationPartIsTrueBySampling) {
  SyntheticScan scene;
  base::Head& head = scene.head;
  Eigen::VectorXd sigmas(24);
  sigmas << 0.1, 0.1, 0.2, 0.2, 1e-4, 1e-4, 1e-5, 1e-5, 0.0, 0.1, 0.1, 0.2, 0.2, 1e-4, 1e-4, 1e-5, 1e-5, 0.0, 1e-4, 2e-4, 1e-4,
      0.02, 0.02, 0.03;
  head.cov = sigmas.cwiseAbs2().asDiagonal();
  head.cov(18, 19) = head.cov(19, 18) = 0.5 * sigmas(18) * sigmas(19);
  const Eigen::Vector3d point(120.0, -80.0, 1150.0);
  const Eigen::Matrix3d predicted = detail::calibration_covariance(head, point);
  const Eigen::Vector2d left_px = *head.left.project(point);
  const Eigen::Vector2d right_px = *head.right.project(head.right_from_left * point);
  const Eigen::MatrixXd factor = head.cov.ldlt().transpositionsP().transpose() * Eigen::MatrixXd(head.cov.ldlt().matrixL()) *
                                 head.cov.ldlt().vectorD().cwiseMax(0.0).cwiseSqrt().asDiagonal();
  std::mt19937_64 random(33);
  std::normal_distribution<double> normal;
  Eigen::Matrix3d sampled = Eigen::Matrix3d::Zero();
  constexpr int kSamples = 4000;
  for (int sample = 0; sample < kSamples; ++sample) {
    const Eigen::VectorXd error = factor * Eigen::VectorXd::NullaryExpr(24, [&] { return normal(random); });
    const auto left = *base::Camera::make(head.left.model(), 320, 240, head.left.parameters() + error.head(9));
    const auto right = *base::Camera::make(head.right.model(), 320, 240, head.right.parameters() + error.segment(9, 9));
    const base::Pose right_from_left = base::perturbed(head.right_from_left, error.tail<6>());
    // On the left ray the point whose image is nearest to the right pixel: by bisection of the derivative along the ray.
    const Eigen::Vector3d ray = *left.unproject(left_px);
    const Eigen::Vector3d c = right_from_left.inverse().translation_mm;
    const Eigen::Vector3d b = right_from_left.inverse().rotation * *right.unproject(right_px);
    Eigen::Matrix<double, 3, 2> both;
    both << ray, -b;
    const Eigen::Vector2d along = (both.transpose() * both).ldlt().solve(both.transpose() * c);
    const Eigen::Vector3d off = along(0) * ray - point;
    sampled += off * off.transpose() / kSamples;
  }
  for (int i = 0; i < 3; ++i) EXPECT_NEAR(std::sqrt(sampled(i, i) / predicted(i, i)), 1.0, 0.05) << i;
}

TEST(ScanCloud, DepthImageIsATiffOfFloats) {
  const tests::TemporaryFolder folder;
  const std::vector<float> values = {1.5F, -2.0F, 1300.25F, 4.0F, 5.0F, 6.0F};
  ASSERT_TRUE(base::write_depth_tiff(folder / "depth.tiff", 3, 2, values));
  const auto bytes = base::read_file(folder / "depth.tiff");
  ASSERT_TRUE(bytes);
  ASSERT_EQ(bytes->size(), 8U + 24U + 2U + 120U + 4U);
  EXPECT_EQ(bytes->substr(0, 4), std::string("II\x2a\0", 4));
  float third = 0.0F;
  std::copy_n(bytes->data() + 16, 4, reinterpret_cast<char*>(&third));
  EXPECT_EQ(third, 1300.25F);
}

}  // namespace
}  // namespace crosstie::scan
