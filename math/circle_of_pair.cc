#include "math/circle_of_pair.h"

#include <cmath>
#include <numbers>
#include <vector>

#include <Eigen/Geometry>

#include "base/camera.h"

namespace crosstie::math {
namespace {

using Eigen::Matrix2d;
using Eigen::Matrix3d;
using Eigen::Vector3d;
using Matrix23 = Eigen::Matrix<double, 2, 3, Eigen::RowMajor>;

constexpr double kUnexplained = 0.15;

/// An ellipse and how its image follows from the circle, relative to the ellipse's size.
struct Seen {
  Matrix23 by_point;
  Matrix2d shape;
};

struct Fit {
  double square = 1e300;  ///< sum of squared relative differences
  double radius2 = 0.0;
  Vector3d normal = Vector3d::Zero();
};

Fit fit(const std::vector<Seen>& seen, const Vector3d& normal) {
  const Matrix3d disc = Matrix3d::Identity() - normal * normal.transpose();
  double both = 0.0;
  double own = 0.0;
  double all = 0.0;
  for (const Seen& one : seen) {
    const Matrix2d shown = one.by_point * disc * one.by_point.transpose();
    both += shown.cwiseProduct(one.shape).sum();
    own += shown.squaredNorm();
    all += one.shape.squaredNorm();
  }
  const double radius2 = own > 0.0 ? both / own : 0.0;
  return {all - radius2 * both, radius2, normal};
}

}  // namespace

Eigen::Matrix2d shape_of(const base::Observation& observation) {
  if (!(observation.semi_minor_px > 0.0) || !std::isfinite(observation.semi_major_px) ||
      !std::isfinite(observation.angle_rad)) {
    return Eigen::Matrix2d::Zero();
  }
  const Eigen::Matrix2d axes = Eigen::Rotation2Dd(observation.angle_rad).toRotationMatrix();
  const Eigen::Vector2d squares(observation.semi_major_px * observation.semi_major_px,
                                observation.semi_minor_px * observation.semi_minor_px);
  return axes * squares.asDiagonal() * axes.transpose();
}

std::optional<Eigen::Vector2d> eccentricity_px(const CircleView& view, const Vector3d& point, const Matrix3d& circle) {
  const Matrix3d rotation = view.camera_from_object.rotation.toRotationMatrix();
  const Vector3d x = view.camera_from_object * point;
  const Matrix3d dual_conic = x * x.transpose() - rotation * circle * rotation.transpose();
  const Vector3d centre = dual_conic.col(2);
  Eigen::Vector2d of_circle;
  Eigen::Vector2d of_ellipse;
  if (!base::project_bare(view.lens, view.parameters, x.data(), of_circle.data(), nullptr, nullptr) ||
      !base::project_bare(view.lens, view.parameters, centre.data(), of_ellipse.data(), nullptr, nullptr)) {
    return std::nullopt;
  }
  return of_ellipse - of_circle;
}

std::optional<Matrix3d> circle_of_pair(std::span<const CircleView> views, const Vector3d& point) {
  std::vector<Seen> seen;
  for (const CircleView& view : views) {
    const Vector3d in_camera = view.camera_from_object * point;
    Eigen::Vector2d pixel;
    Matrix23 by_point;
    if (!(view.shape_px2.trace() > 0.0) ||
        !base::project_bare(view.lens, view.parameters, in_camera.data(), pixel.data(), by_point.data(), nullptr)) {
      return std::nullopt;
    }
    const double scale = 1.0 / view.shape_px2.trace();
    seen.push_back({Matrix23(std::sqrt(scale) * by_point * view.camera_from_object.rotation.toRotationMatrix()),
                    Matrix2d(scale * view.shape_px2)});
  }
  if (seen.empty()) return std::nullopt;
  // Normals as points of a disc about the direction to the first camera: the sine of the angle outwards.
  const Vector3d towards =
      -(views.front().camera_from_object.rotation.conjugate() * (views.front().camera_from_object * point)).normalized();
  const Vector3d across = towards.unitOrthogonal();
  const Vector3d along = towards.cross(across);
  const auto normal_at = [&](double a, double b) {
    const double square = a * a + b * b;
    return Vector3d(std::sqrt(std::max(0.0, 1.0 - square)) * towards + a * across + b * along);
  };
  constexpr double kSteepest = 0.98;
  constexpr int kRings = 10;
  Fit best;
  double at_a = 0.0;
  double at_b = 0.0;
  const auto try_at = [&](double a, double b) {
    if (a * a + b * b > kSteepest * kSteepest) return false;
    const Fit here = fit(seen, normal_at(a, b));
    if (!(here.square < best.square) || !(here.radius2 > 0.0)) return false;
    best = here;
    at_a = a;
    at_b = b;
    return true;
  };
  for (int i = -kRings; i <= kRings; ++i) {
    for (int j = -kRings; j <= kRings; ++j) try_at(kSteepest * i / kRings, kSteepest * j / kRings);
  }
  for (double step = 0.5 * kSteepest / kRings; step > 1e-6;) {
    bool better = false;
    const double a = at_a;
    const double b = at_b;
    for (int k = 0; k < 8; ++k) {
      const double angle = k * std::numbers::pi / 4.0;
      better = try_at(a + step * std::cos(angle), b + step * std::sin(angle)) || better;
    }
    if (!better) step *= 0.5;
  }
  if (!(best.radius2 > 0.0) || std::sqrt(best.square / static_cast<double>(seen.size())) > kUnexplained) return std::nullopt;
  return Matrix3d(best.radius2 * (Matrix3d::Identity() - best.normal * best.normal.transpose()));
}

}  // namespace crosstie::math
