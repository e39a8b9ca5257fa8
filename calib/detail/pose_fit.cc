#include "calib/detail/pose_fit.h"

#include <cmath>
#include <limits>

#include <Eigen/Cholesky>
#include <Eigen/Geometry>

namespace crosstie::calib::detail {
namespace {

using RowMajor23 = Eigen::Matrix<double, 2, 3, Eigen::RowMajor>;

struct Evaluation {
  double cost = std::numeric_limits<double>::infinity();  ///< robust
  double square_sum = 0.0;
  double square_px2 = 0.0;
  base::Matrix6d normal = base::Matrix6d::Zero();
  base::Vector6d gradient = base::Vector6d::Zero();
};

/// False where a point lies behind the camera.
bool evaluate(base::LensModel model, const Eigen::VectorXd& lens, const PoseData& data, const base::Pose& pose,
              double robust_sigmas, bool with_normal, Evaluation& out) {
  out = {};
  out.cost = 0.0;
  const Eigen::Matrix3d camera_from_board = pose.rotation.toRotationMatrix().transpose();
  const double c2 = robust_sigmas * robust_sigmas;
  for (Eigen::Index i = 0; i < data.count(); ++i) {
    const Eigen::Vector3d point = data.points.col(i);
    const Eigen::Vector3d p_in_camera = camera_from_board * (point - pose.translation_mm);
    Eigen::Vector2d pixel;
    RowMajor23 d_point;
    if (!base::project_bare(model, lens.data(), p_in_camera.data(), pixel.data(), with_normal ? d_point.data() : nullptr,
                            nullptr)) {
      return false;
    }
    const Eigen::Vector2d error = pixel - data.pixels.col(i);
    const double inverse = 1.0 / data.sigma_px(i);
    const double square = error.squaredNorm() * inverse * inverse;
    if (!std::isfinite(square)) return false;
    out.square_sum += square;
    out.square_px2 += error.squaredNorm();
    out.cost += c2 > 0.0 ? c2 * std::log1p(square / c2) : square;
    if (!with_normal) continue;
    const double weight = (c2 > 0.0 ? 1.0 / (1.0 + square / c2) : 1.0) * inverse * inverse;
    const RowMajor23 by_board = d_point * camera_from_board;
    Eigen::Matrix<double, 2, 6> jacobian;
    jacobian << by_board * base::skew(point), -by_board;
    out.normal.noalias() += weight * jacobian.transpose() * jacobian;
    out.gradient.noalias() += weight * jacobian.transpose() * error;
  }
  return true;
}

}  // namespace

std::optional<PoseFit> fit_pose(base::LensModel model, const Eigen::VectorXd& lens, const PoseData& data,
                                const base::Pose& start, double robust_sigmas) {
  constexpr int kMaxIterations = 60;
  constexpr double kTolerance = 1e-12;  // relative change of the cost
  base::Pose pose = start;
  Evaluation at;
  if (!evaluate(model, lens, data, pose, robust_sigmas, true, at)) return {};
  double damping = 1e-4;
  for (int i = 0; i < kMaxIterations; ++i) {
    base::Matrix6d damped = at.normal;
    damped.diagonal() *= 1.0 + damping;
    const base::Vector6d step = -damped.ldlt().solve(at.gradient);
    if (!step.allFinite()) break;
    const base::Pose trial = base::perturbed(pose, step);
    Evaluation next;
    if (evaluate(model, lens, data, trial, robust_sigmas, true, next) && next.cost <= at.cost) {
      const bool done = at.cost - next.cost <= kTolerance * at.cost;
      pose = trial;
      at = next;
      damping = std::max(1e-12, 0.1 * damping);
      if (done) break;
    } else {
      damping *= 10.0;
      if (damping > 1e8) break;
    }
  }
  return PoseFit{pose, at.square_sum, at.square_px2};
}

base::Pose mirrored_pose(const base::Pose& board_from_camera) {
  const base::Pose camera_from_board = board_from_camera.inverse();
  const Eigen::Vector3d sight = camera_from_board.translation_mm.normalized();
  const Eigen::Matrix3d mirror = Eigen::Matrix3d::Identity() - 2.0 * sight * sight.transpose();
  const Eigen::Matrix3d turned =
      mirror * camera_from_board.rotation.toRotationMatrix() * Eigen::Vector3d(1.0, 1.0, -1.0).asDiagonal();
  return base::Pose{Eigen::Quaterniond(turned).normalized(), camera_from_board.translation_mm}.inverse();
}

}  // namespace crosstie::calib::detail
