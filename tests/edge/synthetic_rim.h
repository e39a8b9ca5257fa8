#pragma once

#include <cmath>
#include <functional>
#include <numbers>
#include <random>
#include <vector>

#include <Eigen/Geometry>

#include "base/edge_curve.h"
#include "base/pose.h"

namespace crosstie::tests {

/// A point of a true rim in the hole's frame, and the surface's normal there.
struct TruePoint {
  Eigen::Vector3d point = Eigen::Vector3d::Zero();
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();
};

/// Counter-clockwise, u in [0, 1) once round.
using TrueRim = std::function<TruePoint(double u)>;

inline TrueRim true_ellipse(double length, double width) {
  return [=](double u) {
    const double phi = 2.0 * std::numbers::pi * u;
    return TruePoint{{0.5 * length * std::cos(phi), 0.5 * width * std::sin(phi), 0.0}};
  };
}

/// Two half circles about the ends of a segment: the points at width / 2 from it.
inline TrueRim true_oval(double length, double width) {
  return [=](double u) {
    const double reach = 0.5 * (length - width);
    const double phi = 2.0 * std::numbers::pi * u;
    const Eigen::Vector2d ray(std::cos(phi), std::sin(phi));
    double low = 0.0;
    double high = length;
    for (int i = 0; i < 80; ++i) {  // distance from the segment grows along the ray
      const double middle = 0.5 * (low + high);
      const Eigen::Vector2d p = middle * ray;
      const double off = (p - Eigen::Vector2d(std::clamp(p.x(), -reach, reach), 0.0)).norm();
      (off < 0.5 * width ? low : high) = middle;
    }
    return TruePoint{{low * ray.x(), low * ray.y(), 0.0}};
  };
}

/// The flat rim's prism cut into a cylinder of radius R whose axis is along x (turned by `direction` about z): z = sqrt(R^2 - b^2) - R
/// with b across the axis; seen from outside.
inline TrueRim on_cylinder(TrueRim flat, double radius, double direction = 0.0) {
  return [=](double u) {
    TruePoint p = flat(u);
    const Eigen::Vector3d across(-std::sin(direction), std::cos(direction), 0.0);
    const double b = across.dot(p.point);
    p.point.z() = std::sqrt(radius * radius - b * b) - radius;
    p.normal = (b * across + (p.point.z() + radius) * Eigen::Vector3d::UnitZ()).normalized();
    return p;
  };
}

struct RimErrors {
  double across_mm = 0.02;  ///< sigma along u of each point alone
  double normal_mm = 0.03;  ///< along v
  double tilt_rad = 0.0;    ///< of a normal towards u and the tangent, the mean of the depths that it stands on
  double depths_mm = 0.0;   ///< length of rim before which these lie
  std::vector<base::Vector6d> station_sigmas = {};  ///< pose errors (rad, mm) shared by each of as many equal parts of the rim
  double scale = 0.0;                               ///< sigma of a common factor about the frame's origin
};

/// A rim as it is measured: `count` points of `rim` at frame_from_hole over [from, to), with independent and shared errors of the
/// given sigmas; noise 0 gives the truth with those sigmas beside it.
inline base::EdgeCurve measured_rim(const TrueRim& rim, const base::Pose& frame_from_hole, int count, const RimErrors& errors,
                                    std::mt19937_64& random, double noise = 1.0, double from = 0.0, double to = 1.0) {
  std::normal_distribution<double> normal;
  base::EdgeCurve edge;
  edge.frame = "machine";
  edge.closed = to - from > 0.999;
  const auto n = static_cast<Eigen::Index>(count);
  const auto stations = static_cast<Eigen::Index>(errors.station_sigmas.size());
  edge.shared_mm = Eigen::MatrixXd::Zero(3 * n, 6 * stations + (errors.scale > 0.0 ? 1 : 0));
  for (int i = 0; i < count; ++i) {
    const double u = from + (to - from) * i / (edge.closed ? count : count - 1);
    const TruePoint here = rim(u);
    const Eigen::Vector3d ahead = rim(u + 1e-6).point - rim(u - 1e-6).point;
    base::EdgePoint point;
    point.point_mm = frame_from_hole * here.point;
    point.normal = frame_from_hole.rotation * here.normal;
    point.tangent = (frame_from_hole.rotation * ahead).normalized();
    const Eigen::Vector3d across = point.normal.cross(point.tangent);
    const double alone = errors.across_mm * errors.across_mm;
    point.cov_mm2 = alone * (across * across.transpose() + point.tangent * point.tangent.transpose()) +
                    errors.normal_mm * errors.normal_mm * point.normal * point.normal.transpose();
    for (Eigen::Index s = 0; s < stations; ++s) {
      if (s != static_cast<Eigen::Index>(i) * stations / n) continue;
      Eigen::Matrix<double, 3, 6> by_pose;
      by_pose << -base::skew(point.point_mm), Eigen::Matrix3d::Identity();
      edge.shared_mm.block<3, 6>(3 * i, 6 * s) = by_pose * errors.station_sigmas[static_cast<std::size_t>(s)].asDiagonal();
    }
    if (errors.scale > 0.0) edge.shared_mm.block<3, 1>(3 * i, 6 * stations) = errors.scale * point.point_mm;
    edge.points.push_back(point);
  }
  edge.depths_mm = errors.depths_mm;
  edge.shared_tilt_rad = Eigen::MatrixXd::Zero(2 * n, edge.shared_mm.cols());
  Eigen::VectorXd z(edge.shared_mm.cols());
  for (double& value : z) value = noise * normal(random);
  const Eigen::VectorXd together = edge.shared_mm * z;
  // Neighbours' normals stand on depths in common.
  const double spacing = n > 1 ? (edge.points[1].point_mm - edge.points[0].point_mm).norm() : 1.0;
  const auto depths = std::max<Eigen::Index>(1, std::lround(errors.depths_mm / spacing));
  Eigen::MatrixXd slopes(2, n);
  for (double& value : slopes.reshaped())
    value = errors.tilt_rad / std::sqrt(static_cast<double>(depths)) * noise * normal(random);
  for (Eigen::Index i = 0; i < n; ++i) {
    base::EdgePoint& point = edge.points[static_cast<std::size_t>(i)];
    const Eigen::Vector3d across = point.normal.cross(point.tangent);
    point.sigma_u_mm = std::sqrt(across.dot(point.cov_mm2 * across) +
                                 (across.transpose() * edge.shared_mm.middleRows<3>(3 * i)).squaredNorm());
    point.sigma_v_mm = std::sqrt(point.normal.dot(point.cov_mm2 * point.normal) +
                                 (point.normal.transpose() * edge.shared_mm.middleRows<3>(3 * i)).squaredNorm());
    point.tilt_variance_rad2.setConstant(errors.tilt_rad * errors.tilt_rad);
    for (Eigen::Index s = 0; s < stations; ++s) {
      if (s != static_cast<Eigen::Index>(i) * stations / n) continue;
      const auto sigmas = errors.station_sigmas[static_cast<std::size_t>(s)].head<3>().asDiagonal();
      edge.shared_tilt_rad.block<1, 3>(2 * i, 6 * s) = -point.tangent.transpose() * sigmas;
      edge.shared_tilt_rad.block<1, 3>(2 * i + 1, 6 * s) = across.transpose() * sigmas;
    }
    point.point_mm += together.segment<3>(3 * i) +
                      noise * (errors.across_mm * normal(random) * across + errors.across_mm * normal(random) * point.tangent +
                               errors.normal_mm * normal(random) * point.normal);
    const auto shared = edge.shared_tilt_rad.middleRows<2>(2 * i);
    Eigen::Vector2d tilt = shared * z;
    for (Eigen::Index k = 0; k < depths; ++k) tilt += slopes.col((i + k) % n);
    point.normal = (point.normal + tilt(0) * across + tilt(1) * point.tangent).normalized();
    point.sigma_tilt_rad = (point.tilt_variance_rad2 + shared.rowwise().squaredNorm()).cwiseSqrt();
    if (i > 0) edge.length_mm += (point.point_mm - edge.points[static_cast<std::size_t>(i - 1)].point_mm).norm();
    point.s_mm = edge.length_mm;
  }
  if (edge.closed) edge.length_mm += (edge.points.front().point_mm - edge.points.back().point_mm).norm();
  return edge;
}

inline base::Pose some_pose() {
  return {Eigen::Quaterniond(Eigen::AngleAxisd(1.1, Eigen::Vector3d(0.3, -0.8, 0.5).normalized())), {1850.0, -420.0, 960.0}};
}

}  // namespace crosstie::tests
