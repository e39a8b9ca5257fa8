#include "bundle/detail/eccentricity.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <vector>

#include <Eigen/Dense>

#include "base/camera.h"

namespace crosstie::bundle::detail {
namespace {

using Eigen::Matrix2d;
using Eigen::Matrix3d;
using Eigen::Vector3d;
using Matrix23 = Eigen::Matrix<double, 2, 3, Eigen::RowMajor>;

constexpr std::size_t kLeastImages = 3;
constexpr double kUnequalAxes = 0.15;  // of the two radii that the ellipses give, relative: beyond it they show no circle

/// How the image sees a thing of this shape.
CircleView view_of(const Survey& survey, const State& state, int image, const Matrix2d& shape_px2) {
  const auto camera = static_cast<std::size_t>(survey.camera_of_image[static_cast<std::size_t>(image)]);
  return {survey.lens(image), state.lenses[camera].data(), state.poses[static_cast<std::size_t>(image)]->inverse(), shape_px2};
}

}  // namespace

std::optional<Matrix3d> circle_of(std::span<const CircleView> views, const Vector3d& point) {
  if (views.size() < kLeastImages) return std::nullopt;
  Eigen::Matrix<double, 6, 6> normal = Eigen::Matrix<double, 6, 6>::Zero();
  Eigen::Matrix<double, 6, 1> right = Eigen::Matrix<double, 6, 1>::Zero();
  for (const CircleView& view : views) {
    const Vector3d in_camera = view.camera_from_object * point;
    Eigen::Vector2d pixel;
    Matrix23 by_point;
    if (!base::project_bare(view.lens, view.parameters, in_camera.data(), pixel.data(), by_point.data(), nullptr)) continue;
    const Matrix23 j = by_point * view.camera_from_object.rotation.toRotationMatrix();
    // Each element (a, b) of S is the sum over M's six numbers; relative to the ellipse's size, so that near images do not
    // rule.
    const double scale = 1.0 / view.shape_px2.trace();
    for (const auto& [a, b] : {std::pair{0, 0}, std::pair{0, 1}, std::pair{1, 1}}) {
      Eigen::Matrix<double, 6, 1> row;
      row << j(a, 0) * j(b, 0), j(a, 0) * j(b, 1) + j(a, 1) * j(b, 0), j(a, 0) * j(b, 2) + j(a, 2) * j(b, 0), j(a, 1) * j(b, 1),
          j(a, 1) * j(b, 2) + j(a, 2) * j(b, 1), j(a, 2) * j(b, 2);
      row *= scale;
      normal += row * row.transpose();
      right += row * (scale * view.shape_px2(a, b));
    }
  }
  const Eigen::FullPivLU<Eigen::Matrix<double, 6, 6>> factor(normal);
  if (factor.rank() < 6) return std::nullopt;
  const Eigen::Matrix<double, 6, 1> m = factor.solve(right);
  Matrix3d full;
  full << m(0), m(1), m(2), m(1), m(3), m(4), m(2), m(4), m(5);
  const Eigen::SelfAdjointEigenSolver<Matrix3d> eigen(full);
  const double small = eigen.eigenvalues()(1);
  const double large = eigen.eigenvalues()(2);
  if (!(small > 0.0) || std::sqrt(large / small) > 1.0 + kUnequalAxes || std::abs(eigen.eigenvalues()(0)) > 0.5 * small) {
    return std::nullopt;
  }
  const Vector3d normal_direction = eigen.eigenvectors().col(0);
  return Matrix3d(0.5 * (small + large) * (Matrix3d::Identity() - normal_direction * normal_direction.transpose()));
}

std::optional<Matrix3d> circle_of(const Survey& survey, const State& state, std::span<const SeenEllipse> ellipses,
                                  const Vector3d& point) {
  std::vector<CircleView> views;
  for (const SeenEllipse& ellipse : ellipses) views.push_back(view_of(survey, state, ellipse.image, ellipse.shape_px2));
  return circle_of(views, point);
}

namespace {

/// The same of all active rays of a point.
std::optional<Matrix3d> circle_of_point(const Survey& survey, const State& state, std::size_t point) {
  if (!state.points[point]) return std::nullopt;
  std::vector<SeenEllipse> ellipses;
  for (const int r : survey.rays_of_point[point]) {
    const Ray& ray = survey.rays[static_cast<std::size_t>(r)];
    if (state.active[static_cast<std::size_t>(r)] && state.knows(ray) && ray.shape_px2.trace() > 0.0) {
      ellipses.push_back({ray.image, ray.shape_px2});
    }
  }
  return circle_of(survey, state, ellipses, *state.points[point]);
}

}  // namespace

double reduce_to_circle_centres(Survey& survey, const State& state) {
  double largest_px = 0.0;
  for (std::size_t p = 0; p < survey.ids.size(); ++p) {
    const auto seen = circle_of_point(survey, state, p);
    if (!seen) continue;
    for (const int r : survey.rays_of_point[p]) {
      Ray& ray = survey.rays[static_cast<std::size_t>(r)];
      if (!state.knows(ray)) continue;
      const auto offset = eccentricity_px(view_of(survey, state, ray.image, ray.shape_px2), *state.points[p], *seen);
      if (!offset) continue;
      ray.measured_px = ray.ellipse_px - *offset;
      largest_px = std::max(largest_px, offset->norm());
    }
  }
  return largest_px;
}

std::optional<double> dot_diameter_mm(const Survey& survey, const State& state) {
  std::vector<double> diameters;
  for (std::size_t p = 0; p < survey.ids.size(); ++p) {
    // r^2 (I - n n') has the trace 2 r^2.
    if (const auto seen = circle_of_point(survey, state, p)) diameters.push_back(2.0 * std::sqrt(0.5 * seen->trace()));
  }
  if (diameters.empty()) return std::nullopt;
  const auto middle = diameters.begin() + static_cast<std::ptrdiff_t>(diameters.size() / 2);
  std::nth_element(diameters.begin(), middle, diameters.end());
  return *middle;
}

}  // namespace crosstie::bundle::detail
