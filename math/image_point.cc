#include "math/image_point.h"

namespace crosstie::math {
namespace {

using RowMajor23 = Eigen::Matrix<double, 2, 3, Eigen::RowMajor>;

std::vector<int> list_of(const ImagePoint::Blocks& blocks) {
  if (blocks.mount < 0) return {blocks.camera, blocks.pose, blocks.point};
  return {blocks.camera, blocks.pose, blocks.point, blocks.mount};
}

/// d residual / d [w, v] of a pose a_from_b, where d residual / d p_in_a is known.
void by_pose(const RowMajor23& by_point, const Eigen::Vector3d& p_in_a, double* jacobian) {
  Eigen::Map<Eigen::Matrix<double, 2, 6, Eigen::RowMajor>> d_pose(jacobian);
  d_pose.leftCols<3>() = by_point * base::skew(p_in_a);
  d_pose.rightCols<3>() = -by_point;
}

}  // namespace

ImagePoint::ImagePoint(const Blocks& blocks, base::LensModel lens, const Eigen::Vector2d& measured_px,
                       const Eigen::Matrix2d& whitening)
    : Measurement(list_of(blocks)), lens_(lens), measured_px_(measured_px), whitening_(whitening) {}

bool ImagePoint::evaluate(const double* const* values, double* residual, double* const* jacobians) const {
  const bool mounted = blocks().size() > 3;
  const auto wanted = [&](std::size_t i) { return jacobians != nullptr && i < blocks().size() && jacobians[i] != nullptr; };
  const base::Pose pose = pose_from_values(values[1]);
  const Eigen::Map<const Eigen::Vector3d> point(values[2]);
  Eigen::Matrix3d camera_from_network = pose.rotation.toRotationMatrix().transpose();
  const Eigen::Vector3d p_in_rig = camera_from_network * (point - pose.translation_mm);
  Eigen::Vector3d p_in_camera = p_in_rig;
  Eigen::Matrix3d camera_from_rig = Eigen::Matrix3d::Identity();
  if (mounted) {
    const base::Pose rig_from_camera = pose_from_values(values[3]);
    camera_from_rig = rig_from_camera.rotation.toRotationMatrix().transpose();
    p_in_camera = camera_from_rig * (p_in_rig - rig_from_camera.translation_mm);
    camera_from_network = camera_from_rig * camera_from_network;
  }

  const bool want_geometry = wanted(1) || wanted(2) || wanted(3);
  Eigen::Vector2d pixel;
  RowMajor23 d_point;
  if (!base::project_bare(lens_, values[0], p_in_camera.data(), pixel.data(), want_geometry ? d_point.data() : nullptr,
                          wanted(0) ? jacobians[0] : nullptr)) {
    return false;
  }
  Eigen::Map<Eigen::Vector2d>(residual, 2) = whitening_ * (pixel - measured_px_);
  if (wanted(0)) {
    const int count = base::parameter_count(lens_);
    double* const x = jacobians[0];
    double* const y = x + count;
    for (int i = 0; i < count; ++i) {
      const Eigen::Vector2d d_pixel(x[i], y[i]);
      x[i] = whitening_.row(0).dot(d_pixel);
      y[i] = whitening_.row(1).dot(d_pixel);
    }
  }
  if (!want_geometry) return true;
  const RowMajor23 d_camera = whitening_ * d_point;
  const RowMajor23 d_network = d_camera * camera_from_network;
  if (wanted(1)) by_pose(d_network, point, jacobians[1]);
  if (wanted(2)) Eigen::Map<RowMajor23>(jacobians[2], 2, 3) = d_network;
  if (wanted(3)) by_pose(d_camera * camera_from_rig, p_in_rig, jacobians[3]);
  return true;
}

}  // namespace crosstie::math
