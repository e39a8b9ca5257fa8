#include "bundle/detail/minimal_solvers.h"

#include <cmath>

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <Eigen/SVD>
#include <opengv/absolute_pose/CentralAbsoluteAdapter.hpp>
#include <opengv/absolute_pose/NoncentralAbsoluteAdapter.hpp>
#include <opengv/absolute_pose/methods.hpp>
#include <opengv/relative_pose/CentralRelativeAdapter.hpp>
#include <opengv/relative_pose/methods.hpp>

namespace crosstie::bundle::detail {

using Eigen::Matrix3d;
using Eigen::Vector3d;

namespace {

/// Those of OpenGV's solutions that are rigid motions.
void keep_rigid(const opengv::transformations_t& solutions, std::vector<base::Pose>& poses) {
  for (const opengv::transformation_t& solution : solutions) {
    if (!solution.allFinite()) continue;
    const Matrix3d rotation = solution.leftCols<3>();
    if ((rotation.transpose() * rotation - Matrix3d::Identity()).norm() > 1e-6 || rotation.determinant() < 0.0) continue;
    poses.push_back({Eigen::Quaterniond(rotation).normalized(), solution.col(3)});
  }
}

}  // namespace

std::vector<base::Pose> three_point_poses(const std::array<Vector3d, 3>& directions,
                                          const std::array<Vector3d, 3>& points_in_network) {
  std::vector<base::Pose> poses;
  try {
    const opengv::bearingVectors_t bearings(directions.begin(), directions.end());
    const opengv::points_t points(points_in_network.begin(), points_in_network.end());
    const opengv::absolute_pose::CentralAbsoluteAdapter adapter(bearings, points);
    keep_rigid(opengv::absolute_pose::p3p_kneip(adapter), poses);
  } catch (const std::exception&) {
    poses.clear();  // a degenerate sample: no pose
  }
  return poses;
}

std::vector<base::Pose> head_poses(const std::array<HeadSight, 3>& sights, const std::array<Vector3d, 3>& points) {
  const auto same_camera = [&](std::size_t a, std::size_t b) {
    return sights[a].rig_from_camera.translation_mm == sights[b].rig_from_camera.translation_mm;
  };
  std::vector<base::Pose> poses;
  if (same_camera(0, 1) && same_camera(1, 2)) {
    for (const base::Pose& world_from_camera :
         three_point_poses({sights[0].direction, sights[1].direction, sights[2].direction}, points)) {
      poses.push_back(world_from_camera * sights[0].rig_from_camera.inverse());
    }
    return poses;
  }
  try {
    opengv::bearingVectors_t directions;
    std::vector<int> cameras;
    opengv::translations_t positions;
    opengv::rotations_t rotations;
    for (const HeadSight& sight : sights) {
      cameras.push_back(static_cast<int>(directions.size()));
      directions.push_back(sight.direction);
      positions.push_back(sight.rig_from_camera.translation_mm);
      rotations.push_back(sight.rig_from_camera.rotation.toRotationMatrix());
    }
    const opengv::points_t world(points.begin(), points.end());
    opengv::absolute_pose::NoncentralAbsoluteAdapter adapter(directions, cameras, world, positions, rotations);
    keep_rigid(opengv::absolute_pose::gp3p(adapter), poses);
  } catch (const std::exception&) {
    poses.clear();  // a degenerate sample: no pose
  }
  return poses;
}

std::vector<Matrix3d> five_point_essentials(const std::array<Vector3d, 5>& directions_a,
                                            const std::array<Vector3d, 5>& directions_b) {
  std::vector<Matrix3d> essentials;
  try {
    const opengv::bearingVectors_t a(directions_a.begin(), directions_a.end());
    const opengv::bearingVectors_t b(directions_b.begin(), directions_b.end());
    const opengv::relative_pose::CentralRelativeAdapter adapter(a, b);
    for (const opengv::essential_t& solution : opengv::relative_pose::fivept_nister(adapter)) {
      if (solution.allFinite()) essentials.emplace_back(solution);
    }
  } catch (const std::exception&) {
    essentials.clear();
  }
  return essentials;
}

std::vector<base::Pose> motions_of_essential(const Matrix3d& essential) {
  const Eigen::JacobiSVD<Matrix3d> svd(essential, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Matrix3d w;
  w << 0, -1, 0, 1, 0, 0, 0, 0, 1;
  const auto proper = [](const Matrix3d& rotation) -> Matrix3d {
    if (rotation.determinant() < 0.0) return -rotation;
    return rotation;
  };
  const Vector3d translation = svd.matrixU().col(2);
  std::vector<base::Pose> motions;
  for (const Matrix3d& turn : {w, Matrix3d(w.transpose())}) {
    const Eigen::Quaterniond rotation(proper(svd.matrixU() * turn * svd.matrixV().transpose()));
    motions.push_back({rotation.normalized(), translation});
    motions.push_back({rotation.normalized(), -translation});
  }
  return motions;
}

Matrix3d homography(const std::vector<Vector3d>& directions_a, const std::vector<Vector3d>& directions_b) {
  Eigen::Matrix<double, 9, 9> normal = Eigen::Matrix<double, 9, 9>::Zero();
  for (std::size_t i = 0; i < directions_a.size(); ++i) {
    Eigen::Matrix<double, 3, 9> rows;  // a x (H b) = 0, H row by row
    const Matrix3d cross = base::skew(directions_a[i]);
    for (int r = 0; r < 3; ++r) rows.block<3, 3>(0, 3 * r) = cross.col(r) * directions_b[i].transpose();
    normal += rows.transpose() * rows;
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix<double, 9, 9>> eigen(normal);
  const Eigen::Matrix<double, 9, 1> h = eigen.eigenvectors().col(0);
  Matrix3d result;
  result << h.segment<3>(0).transpose(), h.segment<3>(3).transpose(), h.segment<3>(6).transpose();
  return result;
}

std::vector<base::Pose> motions_of_homography(const Matrix3d& homography, const std::vector<Vector3d>& directions_a,
                                              const std::vector<Vector3d>& directions_b) {
  constexpr double kRotationOnly = 1e-4;  // spread of the singular values below which the translation is lost
  const Eigen::JacobiSVD<Matrix3d> svd(homography, Eigen::ComputeFullV);
  if (!(svd.singularValues()(1) > 0.0)) return {};
  Matrix3d h = homography / svd.singularValues()(1);
  double sign = 0.0;
  for (std::size_t i = 0; i < directions_a.size(); ++i) sign += directions_a[i].dot(h * directions_b[i]) > 0.0 ? 1.0 : -1.0;
  if (sign < 0.0) h = -h;
  const Vector3d sigma = svd.singularValues() / svd.singularValues()(1);
  const double above = sigma(0) * sigma(0) - 1.0;
  const double below = 1.0 - sigma(2) * sigma(2);
  if (!(above + below > kRotationOnly)) return {};
  Matrix3d v = svd.matrixV();
  if (v.determinant() < 0.0) v = -v;
  std::vector<base::Pose> motions;
  for (const double side : {1.0, -1.0}) {
    const Vector3d u = (std::sqrt(std::max(below, 0.0)) * v.col(0) + side * std::sqrt(std::max(above, 0.0)) * v.col(2)) /
                       std::sqrt(above + below);
    const Vector3d v2 = v.col(1);
    Vector3d normal = v2.cross(u);
    Matrix3d from;
    Matrix3d to;
    from << v2, u, normal;
    to << h * v2, h * u, (h * v2).cross(h * u);
    const Matrix3d rotation = to * from.transpose();
    double front = 0.0;
    for (const Vector3d& b : directions_b) front += normal.dot(b) > 0.0 ? 1.0 : -1.0;
    if (front < 0.0) normal = -normal;
    motions.push_back({Eigen::Quaterniond(rotation).normalized(), (h - rotation) * normal});
  }
  return motions;
}

}  // namespace crosstie::bundle::detail
