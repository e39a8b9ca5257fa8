#include "bundle/detail/eccentricity.h"

#include <cmath>

#include <gtest/gtest.h>
#include <Eigen/Dense>

#include "tests/bundle/sampled_ellipse.h"

namespace crosstie::bundle::detail {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double kPi = 3.14159265358979323846;

TEST(Eccentricity, IsTakenOffTheCentresOfSampledEllipses) {
  const double radius_mm = 12.0;
  const Vector3d point(40.0, -30.0, 15.0);
  const Vector3d normal = Vector3d(0.3, -0.4, 1.0).normalized();

  Survey survey;
  const auto camera =
      base::Camera::make(base::LensModel::kPinhole, 3000, 2000, (Eigen::VectorXd(4) << 3000, 3000, 1500, 1000).finished());
  ASSERT_TRUE(camera);
  survey.cameras.push_back({"c", *camera, true});
  survey.ids = {7};
  survey.rays_of_point.resize(1);
  State state;
  state.lenses.push_back(camera->parameters());
  state.points.emplace_back(point);
  std::vector<Vector2d> truth;
  for (int i = 0; i < 6; ++i) {
    const double turn = i * kPi / 3.0;
    const Vector3d position(500.0 * std::cos(turn), 500.0 * std::sin(turn), 700.0 + 50.0 * i);
    Eigen::Matrix3d axes;  // z at the point, x and y any
    axes.col(2) = (point - position).normalized();
    axes.col(0) = axes.col(2).unitOrthogonal();
    axes.col(1) = axes.col(2).cross(axes.col(0));
    const base::Pose network_from_camera{Eigen::Quaterniond(axes), position};
    const base::Pose camera_from_network = network_from_camera.inverse();
    const auto ellipse = tests::ellipse_through(tests::rim_px(*camera, camera_from_network, point, normal, radius_mm));
    Ray ray;
    ray.image = i;
    ray.ellipse_px = ray.measured_px = ellipse.centre_px;
    ray.shape_px2 = ellipse.shape_px2;
    survey.rays.push_back(ray);
    survey.rays_of_point[0].push_back(i);
    survey.images.push_back(std::to_string(i));
    survey.camera_of_image.push_back(0);
    state.poses.emplace_back(network_from_camera);
    state.active.push_back(1);
    truth.push_back(*camera->project(camera_from_network * point));
  }
  double before_px = 0.0;
  for (std::size_t i = 0; i < truth.size(); ++i)
    before_px = std::max(before_px, (survey.rays[i].measured_px - truth[i]).norm());
  ASSERT_GT(before_px, 0.1) << "the example must have an eccentricity to speak of";
  EXPECT_NEAR(reduce_to_circle_centres(survey, state), before_px, 0.002 * before_px);
  // The circle follows from the ellipses to first order of its size: what is left is a few thousandths of the eccentricity.
  for (std::size_t i = 0; i < truth.size(); ++i)
    EXPECT_LT((survey.rays[i].measured_px - truth[i]).norm(), 0.005 * before_px) << i;
}

}  // namespace
}  // namespace crosstie::bundle::detail
