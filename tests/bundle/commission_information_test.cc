// Does the adjustment take all that the observations hold? Its sigmas against the Fisher information of the same observations, from numeric
// derivatives of the formulas that draw them; nothing of the solver is used.

#include <functional>

#include <gtest/gtest.h>
#include <Eigen/Cholesky>

#include "tests/bundle/synthetic_head.h"

namespace crosstie::bundle {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Where the unknowns stand: both lenses, rig, growth, markers, cross in machine, head in the middle, direction, scale, pitch, and where
/// each stop truly was.
struct Places {
  Index left = 0, right = 9, rig = 18, growth = 24, markers = 25, cross = 0, head = 0, direction = 0, scale = 0, pitch = 0,
        stops = 0, size = 0;
  explicit Places(const tests::SyntheticHead& of) {
    cross = markers + 3 * static_cast<Index>(of.markers.size());
    head = cross + 6;
    direction = head + 6;
    scale = direction + 2;
    pitch = scale + 1;
    stops = pitch + 1;
    size = stops + of.plan.stations;
  }
};

/// Image points of all markers in all stops, in pixels; the caller knows which of them are seen.
VectorXd image_points(const tests::SyntheticHead& of, const Places& at, const VectorXd& x) {
  const auto lens = [&](const base::Camera& camera, Index first) {
    return *base::Camera::make(camera.model(), camera.width_px(), camera.height_px(),
                               camera.parameters() + x.segment<9>(first));
  };
  const base::Camera left = lens(of.left, at.left);
  const base::Camera right = lens(of.right, at.right);
  const base::Pose right_from_left = base::perturbed(of.right_from_left, x.segment<6>(at.rig));
  const base::Pose machine_from_cross = base::perturbed(of.machine_from_cross, x.segment<6>(at.cross));
  const base::Pose at_middle = base::perturbed(of.machine_from_rig_at_middle, x.segment<6>(at.head));
  const double middle = 0.5 * (of.plan.from_mm + of.plan.to_mm);
  const double half = 0.5 * (of.plan.to_mm - of.plan.from_mm);
  const Eigen::Vector3d direction = of.plan.direction.normalized() + Eigen::Vector3d(0.0, x(at.direction), x(at.direction + 1));
  const auto count = static_cast<Index>(of.markers.size());
  VectorXd points(4 * count * of.plan.stations);
  Index row = 0;
  for (int k = 0; k < of.plan.stations; ++k) {
    const double way = 2.0 * half * k / (of.plan.stations - 1) - half + x(at.stops + k);
    const Eigen::Quaterniond turn = base::rotation_exp({0.0, (0.5 * of.plan.pitch_rad + x(at.pitch)) * way / half, 0.0});
    const Eigen::Vector3d pivot = of.plan.direction.normalized() * middle;
    const base::Pose carried{turn, direction * (way * (1.0 + 1e-6 * x(at.scale))) + pivot - turn * pivot};
    const base::Pose rig_from_cross = (carried * at_middle).inverse() * machine_from_cross;
    for (int camera = 0; camera < 2; ++camera) {
      const base::Pose camera_from_cross = camera == 0 ? rig_from_cross : right_from_left * rig_from_cross;
      for (Index m = 0; m < count; ++m, row += 2) {
        const auto px =
            (camera == 0 ? left : right)
                .project(camera_from_cross * (of.markers[static_cast<std::size_t>(m)] + x.segment<3>(at.markers + 3 * m)));
        points.segment<2>(row) = px ? *px : Eigen::Vector2d::Constant(-1e6);
      }
    }
  }
  return points;
}

TEST(CommissionInformation, NoneIsLost) {
  tests::HeadPlan plan;
  plan.pitch_rad = 400e-6;  // found for sure: it takes part
  const tests::SyntheticHead of = tests::make_head(plan, 1);
  const Places at(of);
  const VectorXd zero = VectorXd::Zero(at.size);
  const VectorXd seen = image_points(of, at, zero);
  MatrixXd information = MatrixXd::Zero(at.size, at.size);
  {
    MatrixXd jacobian(seen.size(), at.size);
    for (Index i = 0; i < at.size; ++i) {
      const bool lens = i < at.rig;
      const bool angle = (i >= at.rig && i < at.rig + 3) || (i >= at.cross && i < at.cross + 3) ||
                         (i >= at.head && i < at.head + 3) || (i >= at.direction && i < at.scale) || i == at.pitch;
      const double h = lens ? 1e-5 * std::max(1.0, i % 9 < 4 ? 100.0 : 1.0) : angle ? 1e-6 : i == at.scale ? 10.0 : 1e-3;
      VectorXd step = zero;
      step(i) = h;
      jacobian.col(i) = (image_points(of, at, step) - image_points(of, at, -step)) / (2.0 * h);
    }
    for (Index row = 0; row < seen.size(); row += 2) {
      const bool inside = seen(row) >= 20.0 && seen(row + 1) >= 20.0 && seen(row) <= of.left.width_px() - 20.0 &&
                          seen(row + 1) <= of.left.height_px() - 20.0;
      if (!inside) jacobian.middleRows<2>(row).setZero();
    }
    information = jacobian.transpose() * jacobian / (plan.image_sigma_px * plan.image_sigma_px);
  }
  const auto add = [&](const MatrixXd& rows, double sigma) { information += rows.transpose() * rows / (sigma * sigma); };
  information.topLeftCorner<24, 24>() += of.input.head.cov.inverse();
  const auto one = [&](Index i) { return MatrixXd(VectorXd::Unit(at.size, i).transpose()); };
  add(one(at.growth), of.input.cross.growth_sigma());
  for (std::size_t m = 0; m < of.markers.size(); ++m) {
    MatrixXd rows = MatrixXd::Zero(3, at.size);
    rows.middleCols<3>(at.markers + 3 * static_cast<Index>(m)).setIdentity();
    rows.col(at.growth) = -of.markers[m];
    add(rows, plan.cross_sigma_mm);
  }
  // A ball's own place, known with the list's sigma, is eliminated: both sigmas add in quadrature.
  for (const auto& sphere : of.input.cross.spheres) {
    const Eigen::Vector3d p = of.machine_from_cross * sphere.centre_mm;
    MatrixXd rows = MatrixXd::Zero(3, at.size);
    rows.middleCols<6>(at.cross) << -base::skew(p), Eigen::Matrix3d::Identity();
    rows.col(at.growth) = of.machine_from_cross.rotation * sphere.centre_mm;
    add(rows, std::hypot(plan.sphere_sigma_mm, plan.cross_sigma_mm));
  }
  for (int k = 0; k < plan.stations; ++k) add(one(at.stops + k), plan.reading_sigma_mm);
  const VectorXd scale = information.diagonal().cwiseSqrt().cwiseInverse();
  const MatrixXd scaled = scale.asDiagonal() * information * scale.asDiagonal();
  const VectorXd limit = scale.cwiseProduct(scaled.llt().solve(MatrixXd::Identity(at.size, at.size)).diagonal().cwiseSqrt());

  const auto result =
      commission(of.input, {.estimate_image_sigma = false, .pivot_mm = Eigen::Vector3d(0.0, 0.0, 0.0), .small_motions = false});
  ASSERT_TRUE(result) << result.error().message;
  const base::LinearAxis& axis = result->frame.axis;
  for (const base::ErrorMotion& term : axis.terms) {
    const bool is_pitch = term.name == "EBX" && term.order == 1;
    ASSERT_EQ(term.significant, is_pitch) << term.name << term.order;
    if (is_pitch) {
      std::printf("sigma of linear pitch %.3f urad, of the information %.3f\n", 1e6 * term.sigma, 1e6 * limit(at.pitch));
      EXPECT_NEAR(term.sigma / limit(at.pitch), 1.0, 0.01);
    }
  }
  EXPECT_NEAR(axis.scale_sigma_ppm / limit(at.scale), 1.0, 0.01);
  EXPECT_NEAR(std::sqrt(axis.direction_cov(1, 1)) / limit(at.direction), 1.0, 0.01);
  EXPECT_NEAR(std::sqrt(axis.direction_cov(2, 2)) / limit(at.direction + 1), 1.0, 0.01);
}

}  // namespace
}  // namespace crosstie::bundle
