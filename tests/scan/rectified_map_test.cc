// Interpolated viewing directions against the lens model's own.
#include "scan/detail/rectified_map.h"

#include <algorithm>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <Eigen/Geometry>

#include "base/camera.h"

namespace crosstie::scan::detail {
namespace {

TEST(RectifiedMap, InterpolatedRaysAreThoseOfTheLens) {
  // A wide lens: 30 px of distortion in the corners.
  constexpr int kWidth = 1296, kHeight = 972;
  Eigen::VectorXd p(9);
  p << 1400.0, 1402.0, 650.0, 480.0, -0.12, 0.09, 3e-4, -2e-4, -0.02;
  const auto camera = base::Camera::make(base::LensModel::kOpenCv5, kWidth, kHeight, p);
  ASSERT_TRUE(camera) << camera.error().message;
  const Eigen::Matrix3d turn = Eigen::AngleAxisd(0.2, Eigen::Vector3d(0.2, 0.9, 0.1).normalized()).toRotationMatrix();
  const auto map = RectifiedMap::make(*camera, turn, 0);
  ASSERT_TRUE(map) << map.error().message;
  std::vector<float> x(kWidth), y(kWidth);
  double largest_px = 0.0;
  for (int row = 0; row < kHeight; ++row) {
    map->row(row, x.data(), y.data());
    for (int column = row % 7; column < kWidth; column += 7) {
      const auto ray = camera->unproject(Eigen::Vector2d(column, row));
      ASSERT_TRUE(ray);
      const Eigen::Vector3d expected = turn * *ray;
      const auto at = static_cast<std::size_t>(column);
      const Eigen::Vector2d off(static_cast<double>(x[at]) - expected.x() / expected.z(),
                                static_cast<double>(y[at]) - expected.y() / expected.z());
      largest_px = std::max(largest_px, 1400.0 * off.norm());
    }
  }
  RecordProperty("largest_px", std::to_string(largest_px));
  EXPECT_LT(largest_px, 2e-4) << "what the header states";
}

}  // namespace
}  // namespace crosstie::scan::detail
