#include "calib/detail/homography.h"

#include <cmath>

#include <Eigen/Geometry>
#include <Eigen/SVD>

namespace crosstie::calib::detail {
namespace {

/// The similarity that brings points to a middle of 0 and a mean distance of sqrt(2).
Eigen::Matrix3d unit_spread(const Eigen::Matrix2Xd& points) {
  const Eigen::Vector2d middle = points.rowwise().mean();
  const double mean = (points.colwise() - middle).colwise().norm().mean();
  const double scale = std::sqrt(2.0) / std::max(mean, 1e-12);
  Eigen::Matrix3d result = Eigen::Matrix3d::Identity();
  result.diagonal() << scale, scale, 1.0;
  result.topRightCorner<2, 1>() = -scale * middle;
  return result;
}

}  // namespace

std::optional<Homography> fit_homography(const Eigen::Matrix2Xd& plane, const Eigen::Matrix2Xd& pixels) {
  if (plane.cols() < 4 || plane.cols() != pixels.cols()) return {};
  const Eigen::Matrix3d a = unit_spread(plane);
  const Eigen::Matrix3d b = unit_spread(pixels);
  Eigen::Matrix<double, 9, 9> normal = Eigen::Matrix<double, 9, 9>::Zero();
  for (Eigen::Index i = 0; i < plane.cols(); ++i) {
    const Eigen::Vector3d p = a * plane.col(i).homogeneous();
    const Eigen::Vector3d q = b * pixels.col(i).homogeneous();
    Eigen::Matrix<double, 2, 9> rows = Eigen::Matrix<double, 2, 9>::Zero();
    rows.row(0).head<3>() = p;
    rows.row(0).tail<3>() = -q.x() * p;
    rows.row(1).segment<3>(3) = p;
    rows.row(1).tail<3>() = -q.y() * p;
    normal.noalias() += rows.transpose() * rows;
  }
  const Eigen::JacobiSVD<Eigen::Matrix<double, 9, 9>> svd(normal, Eigen::ComputeFullV);
  if (!(svd.singularValues()(7) > 1e-12 * svd.singularValues()(0))) return {};  // more than one homography
  const Eigen::Matrix<double, 9, 1> h = svd.matrixV().col(8);
  Eigen::Matrix3d scaled;
  scaled << h.head<3>().transpose(), h.segment<3>(3).transpose(), h.tail<3>().transpose();
  Homography result;
  result.h = b.inverse() * scaled * a;
  const double size = result.h.norm();
  if (!(size > 0.0) || !std::isfinite(size)) return {};
  result.h /= size;
  double sum = 0.0;
  for (Eigen::Index i = 0; i < plane.cols(); ++i) {
    const Eigen::Vector3d q = result.h * plane.col(i).homogeneous();
    sum += (q.hnormalized() - pixels.col(i)).squaredNorm();
  }
  result.rms_px = std::sqrt(sum / static_cast<double>(plane.cols()));
  if (!std::isfinite(result.rms_px)) return {};
  return result;
}

std::optional<double> focal_from_homographies(const std::vector<Eigen::Matrix3d>& homographies, const Eigen::Vector2d& centre) {
  Eigen::Matrix3d centred = Eigen::Matrix3d::Identity();
  centred.topRightCorner<2, 1>() = -centre;
  double square = 0.0;
  double product = 0.0;
  for (const Eigen::Matrix3d& homography : homographies) {
    Eigen::Matrix3d h = centred * homography;
    h /= std::sqrt(h.col(0).head<2>().norm() * h.col(1).head<2>().norm());
    const double a[2] = {h.col(0).head<2>().dot(h.col(1).head<2>()),
                         h.col(0).head<2>().squaredNorm() - h.col(1).head<2>().squaredNorm()};
    const double b[2] = {h(2, 0) * h(2, 1), h(2, 0) * h(2, 0) - h(2, 1) * h(2, 1)};
    for (int i = 0; i < 2; ++i) {
      square += a[i] * a[i];
      product -= a[i] * b[i];
    }
  }
  // The perspective b is known worse than the foreshortening a: w from the regression of b on a.
  if (!(square > 0.0) || !(product > 0.0)) return {};
  const double focal = std::sqrt(square / product);
  return std::isfinite(focal) ? std::optional(focal) : std::nullopt;
}

std::optional<base::Pose> plane_pose(const Eigen::Matrix3d& homography, double focal_px, const Eigen::Vector2d& centre) {
  Eigen::Matrix3d centred = Eigen::Matrix3d::Identity();
  centred.topRightCorner<2, 1>() = -centre;
  Eigen::Matrix3d m = Eigen::Vector3d(1.0 / focal_px, 1.0 / focal_px, 1.0).asDiagonal() * centred * homography;
  const double scale = 0.5 * (m.col(0).norm() + m.col(1).norm());
  if (!(scale > 0.0) || !std::isfinite(scale)) return {};
  m /= m(2, 2) < 0.0 ? -scale : scale;  // the plane lies in front of the camera
  Eigen::Matrix3d rotation;
  rotation << m.col(0), m.col(1), m.col(0).cross(m.col(1));
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(rotation, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const Eigen::Matrix3d nearest = svd.matrixU() * svd.matrixV().transpose();
  if (nearest.determinant() < 0.0) return {};
  return base::Pose{Eigen::Quaterniond(nearest).normalized(), m.col(2)};
}

}  // namespace crosstie::calib::detail
