#include "math/detail/shape_state.h"

#include <cmath>
#include <numbers>

#include <Eigen/Geometry>

namespace crosstie::math::detail {
namespace {

/// The same axes with the third one turned round.
void turn_round(ShapeState& state) {
  state.axes.col(1) *= -1.0;
  state.axes.col(2) *= -1.0;
}

/// Angles of a cone to 0 .. pi / 2.
void normalise_cone(ShapeState& state) {
  if (state.angle < 0.0) {
    state.angle = -state.angle;
    turn_round(state);
  }
  if (state.angle > std::numbers::pi / 2) {
    state.angle = std::numbers::pi - state.angle;
    state.size = -state.size;
    turn_round(state);
  }
}

/// Moves the origin along what leaves the shape as it is.
void approach(ShapeKind kind, ShapeState& state, const Eigen::Vector3d& centroid) {
  const Eigen::Vector3d direction = state.axes.col(2);
  const double along = direction.dot(centroid - state.origin);
  switch (kind) {
    case ShapeKind::kCone:
      state.size += along * std::sin(state.angle);
      [[fallthrough]];
    case ShapeKind::kLine:
    case ShapeKind::kCylinder:
      state.origin += along * direction;
      break;
    case ShapeKind::kPlane:
      state.origin = centroid - along * direction;
      break;
    case ShapeKind::kCircle:
    case ShapeKind::kSphere:
      break;
  }
}

}  // namespace

Eigen::Index PointSet::count() const {
  if (active.empty()) return xyz.cols();
  Eigen::Index sum = 0;
  for (const char one : active) sum += one != 0 ? 1 : 0;
  return sum;
}

void PointSet::update_centroid() {
  centroid.setZero();
  for (Eigen::Index i = 0; i < xyz.cols(); ++i) {
    if (takes_part(i)) centroid += xyz.col(i);
  }
  centroid /= static_cast<double>(std::max<Eigen::Index>(count(), 1));
}

PointSet PointSet::thinned(Eigen::Index wanted) const {
  std::vector<Eigen::Index> chosen;
  const Eigen::Index all = count();
  Eigen::Index seen = 0;
  for (Eigen::Index i = 0; i < xyz.cols(); ++i) {
    if (!takes_part(i)) continue;
    const auto taken = static_cast<Eigen::Index>(chosen.size());
    if (all <= wanted || seen * wanted >= taken * all) chosen.push_back(i);
    ++seen;
  }
  PointSet few;
  few.xyz = xyz(Eigen::all, chosen);
  few.sigma = sigma;
  if (!cov.empty()) {
    double squares = 0.0;
    for (const Eigen::Index i : chosen) squares += cov[static_cast<std::size_t>(i)].trace() / 3.0;
    few.sigma = std::sqrt(squares / static_cast<double>(std::max<std::size_t>(chosen.size(), 1)));
  }
  few.update_centroid();
  return few;
}

std::string name_of(ShapeKind kind) {
  switch (kind) {
    case ShapeKind::kLine:
      return "line";
    case ShapeKind::kPlane:
      return "plane";
    case ShapeKind::kCircle:
      return "circle";
    case ShapeKind::kSphere:
      return "sphere";
    case ShapeKind::kCylinder:
      return "cylinder";
    case ShapeKind::kCone:
      return "cone";
  }
  return "";
}

std::vector<int> parameters_of(ShapeKind kind) {
  switch (kind) {
    case ShapeKind::kLine:
      return {kU, kV, kA, kB};
    case ShapeKind::kPlane:
      return {kW, kA, kB};
    case ShapeKind::kCircle:
      return {kU, kV, kW, kA, kB, kSize};
    case ShapeKind::kSphere:
      return {kU, kV, kW, kSize};
    case ShapeKind::kCylinder:
      return {kU, kV, kA, kB, kSize};
    case ShapeKind::kCone:
      return {kU, kV, kA, kB, kSize, kAngle};
  }
  return {};
}

int rows_of(ShapeKind kind) { return kind == ShapeKind::kLine || kind == ShapeKind::kCircle ? 2 : 1; }

Eigen::Matrix3d axes_along(const Eigen::Vector3d& direction) {
  Eigen::Index least = 0;
  direction.cwiseAbs().minCoeff(&least);
  Eigen::Matrix3d axes;
  axes.col(2) = direction.normalized();
  axes.col(0) = Eigen::Vector3d::Unit(least).cross(axes.col(2)).normalized();
  axes.col(1) = axes.col(2).cross(axes.col(0));
  return axes;
}

ShapeState changed(ShapeKind kind, ShapeState state, const Vector7d& change, const Eigen::Vector3d& centroid) {
  state.origin += state.axes * change.head<3>();
  if (kind != ShapeKind::kSphere) {
    const Eigen::Vector3d direction =
        (state.axes.col(2) + change(kA) * state.axes.col(0) + change(kB) * state.axes.col(1)).normalized();
    const Eigen::Vector3d first = state.axes.col(0);
    state.axes.col(2) = direction;
    state.axes.col(0) = (first - direction * direction.dot(first)).normalized();
    state.axes.col(1) = direction.cross(state.axes.col(0).eval());
  }
  state.size += change(kSize);
  state.angle += change(kAngle);
  if (kind == ShapeKind::kCone) normalise_cone(state);
  approach(kind, state, centroid);
  return state;
}

ShapeState with_sign(ShapeKind kind, ShapeState state) {
  if (kind == ShapeKind::kSphere || kind == ShapeKind::kCone) return state;
  Eigen::Index largest = 0;
  state.axes.col(2).cwiseAbs().maxCoeff(&largest);
  if (state.axes(largest, 2) < 0.0) turn_round(state);
  return state;
}

}  // namespace crosstie::math::detail
