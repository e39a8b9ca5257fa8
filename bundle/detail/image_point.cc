#include "bundle/detail/image_point.h"

namespace crosstie::bundle::detail {

ImagePoint::ImagePoint(int camera_block, int pose_block, int point_block, base::LensModel lens,
                       const Eigen::Vector2d& measured_px, const Eigen::Matrix2d& whitening)
    : Measurement({camera_block, pose_block, point_block}), lens_(lens), measured_px_(measured_px), whitening_(whitening) {}

bool ImagePoint::evaluate(const double* const* values, double* residual, double* const* jacobians) const {
  using RowMajor23 = Eigen::Matrix<double, 2, 3, Eigen::RowMajor>;
  const base::Pose network_from_camera = pose_from_values(values[1]);
  const Eigen::Map<const Eigen::Vector3d> point(values[2]);
  const Eigen::Matrix3d camera_from_network = network_from_camera.rotation.toRotationMatrix().transpose();
  const Eigen::Vector3d p_in_camera = camera_from_network * (point - network_from_camera.translation_mm);

  const bool want_lens = jacobians != nullptr && jacobians[0] != nullptr;
  const bool want_pose = jacobians != nullptr && jacobians[1] != nullptr;
  const bool want_point = jacobians != nullptr && jacobians[2] != nullptr;
  Eigen::Vector2d pixel;
  RowMajor23 d_point;
  double d_lens[2 * base::kMaxLensParameters];
  if (!base::project_bare(lens_, values[0], p_in_camera.data(), pixel.data(),
                          want_pose || want_point ? d_point.data() : nullptr, want_lens ? d_lens : nullptr)) {
    return false;
  }
  Eigen::Map<Eigen::Vector2d>(residual, 2) = whitening_ * (pixel - measured_px_);
  if (want_lens) {
    const int count = base::parameter_count(lens_);
    using RowMajor = Eigen::Matrix<double, 2, Eigen::Dynamic, Eigen::RowMajor>;
    Eigen::Map<RowMajor>(jacobians[0], 2, count) = whitening_ * Eigen::Map<const RowMajor>(d_lens, 2, count);
  }
  if (want_pose || want_point) {
    const RowMajor23 d_network = whitening_ * d_point * camera_from_network;
    if (want_pose) {
      Eigen::Map<Eigen::Matrix<double, 2, 6, Eigen::RowMajor>> d_pose(jacobians[1]);
      d_pose.leftCols<3>() = d_network * base::skew(point);
      d_pose.rightCols<3>() = -d_network;
    }
    if (want_point) Eigen::Map<RowMajor23>(jacobians[2], 2, 3) = d_network;
  }
  return true;
}

}  // namespace crosstie::bundle::detail
