#include "calib/detail/camera_fit.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <Eigen/Cholesky>
#include <Eigen/Geometry>

namespace crosstie::calib::detail {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using RowMajor23 = Eigen::Matrix<double, 2, 3, Eigen::RowMajor>;
using LensRows = Eigen::Matrix<double, 2, Eigen::Dynamic, Eigen::RowMajor>;

/// The normal equations of one view: lens (l) and pose (p).
struct ViewNormal {
  MatrixXd coupling;  ///< p x l
  base::Matrix6d pose = base::Matrix6d::Zero();
  base::Vector6d gradient = base::Vector6d::Zero();
};

struct Normal {
  double cost = 0.0;
  MatrixXd lens;
  VectorXd gradient;
  std::vector<ViewNormal> views;
};

bool evaluate(base::LensModel model, const std::vector<PoseData>& views, double robust_sigmas, const CameraFit& at,
              Normal& normal) {
  const auto all = at.lens.size();
  const Eigen::Index free = base::adjustable_count(model);
  const double c2 = robust_sigmas * robust_sigmas;
  normal.cost = 0.0;
  normal.lens = MatrixXd::Zero(free, free);
  normal.gradient = VectorXd::Zero(free);
  normal.views.assign(views.size(), {});
  LensRows d_lens(2, all);
  LensRows by_lens(2, free);
  for (std::size_t v = 0; v < views.size(); ++v) {
    const PoseData& data = views[v];
    const base::Pose& pose = at.board_from_camera[v];
    const Eigen::Matrix3d camera_from_board = pose.rotation.toRotationMatrix().transpose();
    ViewNormal& view = normal.views[v];
    view.coupling = MatrixXd::Zero(6, free);
    for (Eigen::Index i = 0; i < data.count(); ++i) {
      const Eigen::Vector3d point = data.points.col(i);
      const Eigen::Vector3d p_in_camera = camera_from_board * (point - pose.translation_mm);
      Eigen::Vector2d pixel;
      RowMajor23 d_point;
      if (!base::project_bare(model, at.lens.data(), p_in_camera.data(), pixel.data(), d_point.data(), d_lens.data())) {
        return false;
      }
      const Eigen::Vector2d error = pixel - data.pixels.col(i);
      const double inverse = 1.0 / (data.sigma_px(i) * data.sigma_px(i));
      const double square = error.squaredNorm() * inverse;
      if (!std::isfinite(square)) return false;
      normal.cost += c2 * std::log1p(square / c2);
      const double weight = inverse / (1.0 + square / c2);
      const RowMajor23 by_board = d_point * camera_from_board;
      Eigen::Matrix<double, 2, 6> by_pose;
      by_pose << by_board * base::skew(point), -by_board;
      by_lens = d_lens.leftCols(free);
      normal.lens.noalias() += weight * by_lens.transpose().lazyProduct(by_lens);
      normal.gradient.noalias() += weight * by_lens.transpose().lazyProduct(error);
      view.coupling.noalias() += weight * by_pose.transpose().lazyProduct(by_lens);
      view.pose.noalias() += weight * by_pose.transpose() * by_pose;
      view.gradient.noalias() += weight * by_pose.transpose() * error;
    }
  }
  return true;
}

/// The damped step from the normal equations, the poses eliminated; false where it is not finite.
bool step(const Normal& normal, double damping, const CameraFit& at, CameraFit& next) {
  MatrixXd reduced = normal.lens;
  reduced.diagonal() *= 1.0 + damping;
  VectorXd right = normal.gradient;
  std::vector<Eigen::LDLT<base::Matrix6d>> factors;
  for (const ViewNormal& view : normal.views) {
    base::Matrix6d pose = view.pose;
    pose.diagonal() *= 1.0 + damping;
    factors.emplace_back(pose);
    reduced -= view.coupling.transpose() * factors.back().solve(view.coupling);
    right -= view.coupling.transpose() * factors.back().solve(view.gradient);
  }
  const VectorXd scale = reduced.diagonal().cwiseAbs().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
  const MatrixXd scaled = scale.asDiagonal() * reduced * scale.asDiagonal();
  const VectorXd lens = -(scale.asDiagonal() * scaled.ldlt().solve(scale.asDiagonal() * right));
  if (!lens.allFinite()) return false;
  next = at;
  next.lens.head(lens.size()) += lens;
  for (std::size_t v = 0; v < normal.views.size(); ++v) {
    const base::Vector6d delta = -factors[v].solve(normal.views[v].gradient + normal.views[v].coupling * lens);
    if (!delta.allFinite()) return false;
    next.board_from_camera[v] = base::perturbed(at.board_from_camera[v], delta);
  }
  return true;
}

}  // namespace

bool fit_camera(base::LensModel model, const std::vector<PoseData>& views, double robust_sigmas, CameraFit& fit) {
  constexpr int kMaxIterations = 100;
  constexpr double kTolerance = 1e-6;
  constexpr double kMostDamping = 1e8;
  Normal normal;
  if (!evaluate(model, views, robust_sigmas, fit, normal)) return false;
  double damping = 1e-4;
  for (fit.iterations = 0; fit.iterations < kMaxIterations && damping < kMostDamping; ++fit.iterations) {
    CameraFit trial;
    Normal next;
    if (step(normal, damping, fit, trial) && evaluate(model, views, robust_sigmas, trial, next) && next.cost <= normal.cost) {
      const bool done = normal.cost - next.cost <= kTolerance * normal.cost;
      trial.iterations = fit.iterations;
      fit = std::move(trial);
      normal = std::move(next);
      damping = std::max(1e-12, 0.1 * damping);
      if (done) break;
    } else {
      damping *= 10.0;
    }
  }
  return true;
}

}  // namespace crosstie::calib::detail
