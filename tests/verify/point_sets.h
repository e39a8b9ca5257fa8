#pragma once

#include <random>
#include <vector>

#include <Eigen/Geometry>

#include "base/point_list.h"
#include "base/pose.h"

namespace crosstie::tests {

/// Points in a box, ids from 1; the box is no cube, so that no rotation maps it onto itself.
inline base::PointList random_points(int count, unsigned seed, const Eigen::Vector3d& box_mm = {1000.0, 700.0, 300.0}) {
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> unit(-0.5, 0.5);
  base::PointList list;
  for (int i = 0; i < count; ++i) {
    const Eigen::Vector3d fraction(unit(random), unit(random), unit(random));
    list.points.push_back({i + 1, box_mm.cwiseProduct(fraction), std::nullopt});
  }
  return list;
}

/// Every point p becomes scale * (pose * p).
inline base::PointList moved(const base::PointList& list, const base::Pose& pose, double scale = 1.0) {
  base::PointList result = list;
  for (base::ReferencePoint& point : result.points) point.xyz_mm = scale * (pose * point.xyz_mm);
  return result;
}

inline base::Pose some_pose() {
  return {Eigen::Quaterniond(Eigen::AngleAxisd(0.7, Eigen::Vector3d(0.3, -0.5, 0.8).normalized())), {120.0, -45.0, 830.0}};
}

/// A covariance with correlations, of standard deviations near `sigma_mm`.
inline Eigen::Matrix3d random_covariance(std::mt19937_64& random, double sigma_mm) {
  std::uniform_real_distribution<double> unit(0.4, 1.6);
  std::normal_distribution<double> normal;
  const Eigen::Quaterniond turn =
      Eigen::Quaterniond(normal(random), normal(random), normal(random), normal(random)).normalized();
  const Eigen::Vector3d sigma = sigma_mm * Eigen::Vector3d(unit(random), unit(random), unit(random));
  return turn.toRotationMatrix() * sigma.cwiseAbs2().asDiagonal() * turn.toRotationMatrix().transpose();
}

inline Eigen::Vector3d sample(std::mt19937_64& random, const Eigen::Matrix3d& cov) {
  std::normal_distribution<double> normal;
  const Eigen::Vector3d white(normal(random), normal(random), normal(random));
  return cov.llt().matrixL() * white;
}

}  // namespace crosstie::tests
