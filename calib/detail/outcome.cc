#include "calib/detail/outcome.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <tuple>
#include <utility>

#include <Eigen/Geometry>
#include <Eigen/QR>

#include "calib/detail/outliers.h"
#include "math/cofactors.h"
#include "math/distributions.h"

namespace crosstie::calib::detail {
namespace {

using base::Calibration;
using base::fail;
using base::Result;

constexpr double kHighCorrelation = 0.95;

/// Where the unknowns of a block lie in the joint covariance.
struct Place {
  Eigen::Index first = 0;
  Eigen::Index size = 0;
};

/// The joint covariance of the kept blocks, the mount as right_from_left: with T = left_from_right, exp(d) T has the inverse
/// exp(-Ad(T^-1) d) T^-1.
std::vector<Place> add_covariance(const State& state, const Estimate& at, const math::Cofactors& cofactors,
                                  Calibration& result) {
  std::vector<int> blocks;
  std::vector<Place> places;
  Eigen::Index size = 0;
  const auto& all = at.network.model.blocks;
  for (std::size_t b = 0; b < all.size(); ++b) {
    const bool joint = all[b].role == math::BlockRole::kKept && !all[b].free.empty();
    const auto count = joint ? static_cast<Eigen::Index>(all[b].free.size()) : 0;
    places.push_back({size, count});
    if (!joint) continue;
    blocks.push_back(static_cast<int>(b));
    size += count;
    for (const int i : all[b].free) result.labels.push_back(all[b].name + " " + all[b].components[static_cast<std::size_t>(i)]);
  }
  result.covariance = cofactors.joint(blocks);
  if (at.network.mount_block >= 0) {
    const Place place = places[static_cast<std::size_t>(at.network.mount_block)];
    const base::Matrix6d turn = -state.left_from_right->inverse().adjoint();
    result.covariance.middleRows<6>(place.first) = turn * result.covariance.middleRows<6>(place.first).eval();
    result.covariance.middleCols<6>(place.first) = result.covariance.middleCols<6>(place.first).eval() * turn.transpose();
    result.covariance = 0.5 * (result.covariance + result.covariance.transpose()).eval();
  }
  return places;
}

Eigen::MatrixXd block_of(const Calibration& result, const Place& place) {
  return result.covariance.block(place.first, place.first, place.size, place.size);
}

void judge_parameters(base::CalibratedCamera& camera, double redundancy) {
  const Eigen::MatrixXd& cov = camera.camera.covariance();
  const Eigen::VectorXd& values = camera.camera.parameters();
  const auto names = base::parameter_names(camera.camera.model());
  camera.significance_p = Eigen::VectorXd::Constant(values.size(), std::numeric_limits<double>::quiet_NaN());
  if (camera.camera.model().is_splined()) return;  // no control point means anything alone
  for (Eigen::Index i = 4; i < base::adjustable_count(camera.camera.model()); ++i) {
    if (cov(i, i) > 0.0) camera.significance_p(i) = math::student_two_sided(values(i) / std::sqrt(cov(i, i)), redundancy);
  }
  for (Eigen::Index i = 0; i < cov.rows(); ++i) {
    for (Eigen::Index j = i + 1; j < cov.cols(); ++j) {
      const double scale = std::sqrt(cov(i, i) * cov(j, j));
      if ((i == 0 && j == 1) || !(scale > 0.0) || std::abs(cov(i, j)) < kHighCorrelation * scale) continue;
      camera.correlations.push_back({std::string(names[static_cast<std::size_t>(i)]),
                                     std::string(names[static_cast<std::size_t>(j)]), cov(i, j) / scale});
    }
  }
}

Result<> add_cameras(const Problem& problem, const State& state, const Estimate& at, const std::vector<Place>& places,
                     Calibration& result) {
  for (std::size_t c = 0; c < problem.cameras.size(); ++c) {
    auto camera = base::Camera::make(state.lens_model, problem.size_px[c].x(), problem.size_px[c].y(), state.lenses[c]);
    if (!camera) {
      return fail(base::ErrorCode::kNoUniqueSolution,
                  "camera " + problem.cameras[c] + ": the images lead to no lens: " + camera.error().message);
    }
    const Place place = places[static_cast<std::size_t>(at.network.camera_block[c])];
    Eigen::MatrixXd cov = Eigen::MatrixXd::Zero(state.lenses[c].size(), state.lenses[c].size());
    cov.topLeftCorner(place.size, place.size) = block_of(result, place);
    camera->set_covariance(std::move(cov));
    base::CalibratedCamera calibrated{.name = problem.cameras[c],
                                      .camera = std::move(*camera),
                                      .area = {problem.size_px[c].x(), problem.size_px[c].y()},
                                      .significance_p = {},
                                      .correlations = {}};
    judge_parameters(calibrated, at.solution.redundancy);
    result.cameras.push_back(std::move(calibrated));
  }
  return {};
}

/// The convex hull of points, counter-clockwise as counted in pixels (Andrew's monotone chain).
base::Camera::Region hull_of(std::vector<Eigen::Vector2d> points) {
  const auto before = [](const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
    return a.x() < b.x() || (a.x() == b.x() && a.y() < b.y());
  };
  std::sort(points.begin(), points.end(), before);
  base::Camera::Region hull;
  const auto add = [&](const Eigen::Vector2d& p, std::size_t first) {
    while (hull.size() >= first + 2) {
      const Eigen::Vector2d a = hull[hull.size() - 1] - hull[hull.size() - 2];
      const Eigen::Vector2d b = p - hull.back();
      if (a.x() * b.y() - a.y() * b.x() > 0.0) break;
      hull.pop_back();
    }
    hull.push_back(p);
  };
  for (const Eigen::Vector2d& p : points) add(p, 0);
  const std::size_t upper = hull.size() - 1;
  for (std::size_t i = points.size() - 1; i-- > 0;) add(points[i], upper);
  hull.pop_back();  // the first once more
  return hull;
}

/// Right angle's complement: how far the line of sight to the board's middle is from the board's normal.
double tilt_rad(const base::Pose& board_from_camera) {
  const Eigen::Vector3d sight = board_from_camera.translation_mm;
  const double along = std::abs(sight.z());
  return std::atan2(std::hypot(sight.x(), sight.y()), along);
}

void add_views(const Problem& problem, const State& state, const Estimate& at, Calibration& result) {
  std::vector<int> view_index(problem.views.size(), -1);
  for (const Station& station : problem.stations) {
    base::CalibratedStation calibrated{.name = station.name, .paired = is_joint(state, station), .board_from_rig = {}};
    bool used = false;
    for (const int v : station.view) {
      if (v < 0 || !state.takes_part(v)) continue;
      const View& view = problem.views[static_cast<std::size_t>(v)];
      const base::Pose& pose = *state.board_from_camera[static_cast<std::size_t>(v)];
      if (!used) calibrated.board_from_rig = pose;
      used = true;
      view_index[static_cast<std::size_t>(v)] = static_cast<int>(result.views.size());
      base::CalibratedView& seen = result.views.emplace_back();
      seen.image = view.image;
      seen.camera = problem.cameras[static_cast<std::size_t>(view.camera)];
      seen.station = static_cast<int>(result.stations.size());
      seen.board_from_camera = pose;
      seen.distance_mm = pose.translation_mm.norm();
      seen.tilt_rad = tilt_rad(pose);
      ++result.cameras[static_cast<std::size_t>(view.camera)].views;
    }
    if (used) result.stations.push_back(std::move(calibrated));
  }
  const std::vector<double> w = standardised(problem, state, at);
  double total = 0.0;
  int count = 0;
  std::vector<std::vector<Eigen::Vector2d>> seen_px(result.cameras.size());
  for (std::size_t g = 0; g < at.network.corner_of_measurement.size(); ++g) {
    const int c = at.network.corner_of_measurement[g];
    if (c < 0) continue;
    const Corner& corner = problem.corners[static_cast<std::size_t>(c)];
    base::CalibrationResidual residual;
    residual.view = view_index[static_cast<std::size_t>(corner.view)];
    residual.corner = corner.point;
    residual.measured_px = corner.px;
    residual.sigma_px = state.sigma_px * corner.relative_sigma;
    residual.residual_px = residual.sigma_px * at.solution.rows.residual(static_cast<int>(g));
    residual.w = w[static_cast<std::size_t>(c)];
    base::CalibratedView& view = result.views[static_cast<std::size_t>(residual.view)];
    base::CalibratedCamera& camera = result.cameras[static_cast<std::size_t>(problem.view_of(corner).camera)];
    const double square = residual.residual_px.squaredNorm();
    view.rms_px += square;
    view.max_px = std::max(view.max_px, std::sqrt(square));
    ++view.corners;
    camera.rms_px += square;
    ++camera.corners;
    camera.area.add(corner.px);
    seen_px[static_cast<std::size_t>(problem.view_of(corner).camera)].push_back(corner.px);
    total += square;
    ++count;
    result.residuals.push_back(residual);
  }
  for (std::size_t c = 0; c < seen_px.size(); ++c) {
    if (!seen_px[c].empty()) result.cameras[c].camera.set_valid_region(hull_of(std::move(seen_px[c])));
  }
  for (auto& view : result.views) view.rms_px = std::sqrt(view.rms_px / std::max(1, view.corners));
  for (auto& camera : result.cameras) {
    camera.rms_px = std::sqrt(camera.rms_px / std::max(1, camera.corners));
    camera.camera.set_valid_region(camera.area.outline_px());
  }
  result.rms_px = count > 0 ? std::sqrt(total / count) : 0.0;

  result.rejected = problem.refused;
  for (std::size_t v = 0; v < problem.views.size(); ++v) {
    const View& view = problem.views[v];
    if (view_index[v] < 0) {
      result.rejected.push_back(
          {view.image, -1, state.view_reasons[v].empty() ? "it has no pose" : state.view_reasons[v], 0.0});
      continue;
    }
    for (const int c : view.corners) {
      if (state.active[static_cast<std::size_t>(c)]) continue;
      ++result.views[static_cast<std::size_t>(view_index[v])].rejected;
      result.rejected.push_back({view.image, problem.corners[static_cast<std::size_t>(c)].point,
                                 "blunder: it lies too far from where all others expect it", w[static_cast<std::size_t>(c)]});
    }
  }
}

void add_rig(const Problem& problem, const State& state, const Estimate& at, const std::vector<Place>& places,
             Calibration& result) {
  if (at.network.mount_block < 0) return;
  base::CalibratedRig rig;
  rig.left = problem.cameras[0];
  rig.right = problem.cameras[1];
  rig.right_from_left = state.left_from_right->inverse();
  rig.cov = block_of(result, places[static_cast<std::size_t>(at.network.mount_block)]);
  const Baseline baseline = baseline_of(rig.right_from_left, rig.cov);
  rig.baseline_mm = baseline.mm;
  rig.baseline_sigma_mm = baseline.sigma_mm;
  rig.stations = static_cast<int>(
      std::count_if(result.stations.begin(), result.stations.end(), [](const auto& station) { return station.paired; }));
  result.rig = rig;
}

/// Out of the best plane, and in the plane after shift, turn and scale.
void add_deviations(const Problem& problem, base::CalibratedBoard& board) {
  const Eigen::Index count = board.points.cols();
  const Eigen::MatrixX3d plane =
      (Eigen::MatrixX3d(count, 3) << problem.nominal.topRows<2>().transpose(), Eigen::VectorXd::Ones(count)).finished();
  const Eigen::VectorXd heights = board.points.row(2).transpose();
  const Eigen::VectorXd bent = heights - plane * plane.colPivHouseholderQr().solve(heights);
  board.bend_rms_mm = std::sqrt(bent.squaredNorm() / static_cast<double>(count));
  Eigen::MatrixXd motion(2 * count, 4);
  Eigen::VectorXd shifts(2 * count);
  for (Eigen::Index i = 0; i < count; ++i) {
    const double x = problem.nominal(0, i);
    const double y = problem.nominal(1, i);
    motion.row(2 * i) << 1.0, 0.0, -y, x;
    motion.row(2 * i + 1) << 0.0, 1.0, x, y;
    shifts.segment<2>(2 * i) = (board.points.col(i) - problem.nominal.col(i)).head<2>();
  }
  const Eigen::VectorXd left = shifts - motion * motion.colPivHouseholderQr().solve(shifts);
  board.in_plane_rms_mm = std::sqrt(left.squaredNorm() / static_cast<double>(count));
}

void add_board(const Problem& problem, const State& state, const Estimate& at, const math::Cofactors& cofactors,
               const std::vector<Place>& places, Calibration& result) {
  base::CalibratedBoard& board = result.board;
  board.board = problem.board;
  board.points = state.points;
  board.sigma = Eigen::Matrix3Xd::Zero(3, state.points.cols());
  if (!problem.board.free) return;
  for (Eigen::Index i = 0; i < board.sigma.cols(); ++i) {
    const int block = at.network.point_block[static_cast<std::size_t>(i)];
    board.sigma.col(i) = cofactors.block(block, block).diagonal().cwiseMax(0.0).cwiseSqrt();
  }
  for (std::size_t m = 0; m < problem.modes.size(); ++m) {
    const Place place = places[static_cast<std::size_t>(at.network.mode_block)];
    const Eigen::Index row = place.first + static_cast<Eigen::Index>(m);
    board.modes.push_back({problem.modes[m].name, problem.modes[m].unit, problem.modes[m].sigma,
                           state.modes(static_cast<Eigen::Index>(m)), std::sqrt(std::max(0.0, result.covariance(row, row)))});
  }
  board.prior_ratio = at.prior_redundancy > 0.0 ? at.prior_square_sum / at.prior_redundancy : 0.0;
  add_deviations(problem, board);
}

}  // namespace

Baseline baseline_of(const base::Pose& right_from_left, const base::Matrix6d& cov) {
  // |t| does not change when the pose is turned about the origin: only the translation part of the perturbation counts.
  const Eigen::Vector3d direction = right_from_left.translation_mm.normalized();
  return {right_from_left.translation_mm.norm(),
          std::sqrt(std::max(0.0, direction.dot(cov.bottomRightCorner<3, 3>() * direction)))};
}

Result<Calibration> make_outcome(const Problem& problem, const State& state, const Estimate& at) {
  const auto cofactors = math::Cofactors::make(at.solution.equations, at.solution.equations.null_space());
  if (!cofactors) return tl::unexpected(cofactors.error());
  Calibration result;
  result.sigma0 = at.solution.sigma0();
  result.sigma0_px = state.sigma_px * at.sigma_factor();
  result.observations = at.solution.observations;
  result.unknowns = at.solution.unknowns;
  result.redundancy = at.solution.redundancy;
  result.iterations = state.iterations;
  std::tie(result.least_eigenvalue, result.weakest) = at.solution.equations.weakest();
  const std::vector<Place> places = add_covariance(state, at, *cofactors, result);
  if (auto ok = add_cameras(problem, state, at, places, result); !ok) return fail(std::move(ok));
  add_views(problem, state, at, result);
  add_rig(problem, state, at, places, result);
  add_board(problem, state, at, *cofactors, places, result);
  result.warnings = problem.warnings;
  return result;
}

}  // namespace crosstie::calib::detail
