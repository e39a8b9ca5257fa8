#include "registration/detail/directions.h"

#include <algorithm>

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <Eigen/SVD>

namespace crosstie::registration::detail {
namespace {

using base::Matrix6d;
using base::Segment;
using base::Vector6d;
using Eigen::Vector3d;

constexpr double kMostly = 0.5;

}  // namespace

std::array<std::string, 6> direction_names(Segment::Kind kind) {
  switch (kind) {
    case Segment::Kind::kCylinder:
    case Segment::Kind::kCone:
      return {"axial", "tangential", "radial", "roll", "pitch", "yaw"};
    case Segment::Kind::kPlane:
      return {"in plane 1", "in plane 2", "normal", "about in plane 1", "about in plane 2", "about normal"};
    case Segment::Kind::kNone:
      break;
  }
  return {"x", "y", "z", "about x", "about y", "about z"};
}

Eigen::Matrix3d axes_at(const Segment& segment, const Vector3d& place_mm) {
  Eigen::Matrix3d axes = Eigen::Matrix3d::Identity();
  if (segment.kind == Segment::Kind::kNone) return axes;
  const Vector3d direction = segment.direction.normalized();
  if (segment.kind == Segment::Kind::kPlane) {
    // The first axis in the plane is the one nearest to the frame's x.
    Vector3d first = Vector3d::UnitX() - direction.x() * direction;
    if (first.norm() < 0.1) first = Vector3d::UnitY() - direction.y() * direction;
    axes.col(0) = first.normalized();
    axes.col(1) = direction.cross(axes.col(0));
    axes.col(2) = direction;
    return axes;
  }
  const Vector3d off = place_mm - segment.point_mm;
  Vector3d radial = off - off.dot(direction) * direction;
  radial = radial.norm() > 1e-9 ? radial.normalized() : direction.unitOrthogonal();
  axes.col(0) = direction;
  axes.col(1) = radial.cross(direction);
  axes.col(2) = radial;
  return axes;
}

Matrix6d at_place(const Vector3d& place_mm) {
  Matrix6d result = Matrix6d::Identity();
  result.bottomLeftCorner<3, 3>() = -base::skew(place_mm);
  return result;
}

std::vector<NamedMotion> motions_at(const Segment& segment, const Vector3d& place_mm) {
  const auto names = direction_names(segment.kind);
  const Eigen::Matrix3d axes = axes_at(segment, place_mm);
  const bool round = segment.kind == Segment::Kind::kCylinder || segment.kind == Segment::Kind::kCone;
  std::vector<NamedMotion> motions;
  for (int i = 0; i < 6; ++i) {
    NamedMotion& motion = motions.emplace_back();
    motion.name = names[static_cast<std::size_t>(i)];
    if (i < 3) {
      motion.motion.tail<3>() = axes.col(i);
    } else {
      motion.motion.head<3>() = axes.col(i - 3);
      if (round && i == 3) motion.motion.tail<3>() = axes.col(0).cross(place_mm - segment.point_mm);
    }
  }
  return motions;
}

std::vector<std::string> names_of(const std::vector<NamedMotion>& motions, const Eigen::MatrixXd& free, const Matrix6d& gram) {
  // In coordinates in which the mean squared shift is the square of the length.
  const Eigen::LLT<Matrix6d> root(gram);
  const Eigen::MatrixXd scaled = root.matrixU() * free;
  const Eigen::JacobiSVD<Eigen::MatrixXd> svd(scaled, Eigen::ComputeThinU);
  const double largest = svd.singularValues().size() > 0 ? svd.singularValues()(0) : 0.0;
  const auto rank = (svd.singularValues().array() > 1e-6 * largest).count();
  Eigen::MatrixXd span = svd.matrixU().leftCols(rank);
  std::vector<std::string> names;
  // The one that lies most in the span takes its part out of it, until nothing is left: as many names as there are free directions.
  while (span.cols() > 0) {
    double best_part = -1.0;
    Vector6d best = Vector6d::Zero();
    std::string name;
    for (const NamedMotion& motion : motions) {
      if (std::find(names.begin(), names.end(), motion.name) != names.end()) continue;
      const Vector6d m = root.matrixU() * motion.motion;
      const double part = (span.transpose() * m).squaredNorm() / m.squaredNorm();
      if (part <= best_part) continue;
      best_part = part;
      best = m;
      name = motion.name;
    }
    if (name.empty() || (best_part < kMostly && !names.empty())) break;
    names.push_back(name);
    const Vector6d inside = (span * (span.transpose() * best)).normalized();
    const Eigen::MatrixXd left = span - inside * (inside.transpose() * span);
    const Eigen::JacobiSVD<Eigen::MatrixXd> rest(left, Eigen::ComputeThinU);
    span = rest.matrixU().leftCols(span.cols() - 1).eval();
  }
  // In the order of their definition.
  std::vector<std::string> ordered;
  for (const NamedMotion& motion : motions) {
    if (std::find(names.begin(), names.end(), motion.name) != names.end()) ordered.push_back(motion.name);
  }
  return ordered;
}

Matrix6d shift_gram(const std::vector<Vector3d>& places, const Vector3d& centre_mm) {
  Matrix6d gram = Matrix6d::Zero();
  for (const Vector3d& place : places) {
    Eigen::Matrix<double, 3, 6> shift;
    shift << -base::skew(place - centre_mm), Eigen::Matrix3d::Identity();
    gram += shift.transpose() * shift / static_cast<double>(places.size());
  }
  return gram;
}

}  // namespace crosstie::registration::detail
