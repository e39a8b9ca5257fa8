#include "calib/second_opinion.h"

#include <algorithm>
#include <cmath>
#include <map>

#include <fmt/format.h>
#include <Eigen/Cholesky>
#include <Eigen/Geometry>

#include "calib/calibrate.h"
#include "calib/detail/mrcal_solve.h"
#include "calib/detail/spline_lens.h"
#include "math/projection_difference.h"

namespace crosstie::calib {
namespace {

using base::Calibration;
using base::ErrorCode;
using base::fail;
using base::Result;
using base::SecondOpinion;
using detail::MrcalProblem;
using Eigen::VectorXd;

Result<> check(const Calibration& calibration, const SecondOpinionOptions& options) {
  if (options.lens == base::LensModel::kAicon) return fail(ErrorCode::kUsage, "mrcal has no lens model AICON");
  const base::BoardPattern pattern = calibration.board.board.pattern;
  if (pattern != base::BoardPattern::kChessboard && pattern != base::BoardPattern::kCircles) {
    return fail(ErrorCode::kUsage, fmt::format("mrcal knows boards that are square grids only, not {}", pattern_name(pattern)));
  }
  if (calibration.residuals.empty() || calibration.cameras.empty()) {
    return fail(ErrorCode::kBadInput, "the calibration holds no corners");
  }
  return {};
}

/// Parameters of `wanted` that project as `camera` does as nearly as they can: of OpenCV's models those that both have, by their names,
/// zero for what only `wanted` has.
VectorXd start_of(const base::Camera& camera, base::LensModel wanted) {
  if (camera.model() == wanted) return camera.parameters();
  if (wanted.is_splined()) return detail::as_spline(camera.parameters(), camera.model(), wanted);
  VectorXd parameters = VectorXd::Zero(base::parameter_count(wanted));
  const auto from = base::parameter_names(camera.model());
  const auto to = base::parameter_names(wanted);
  for (std::size_t i = 0; i < to.size(); ++i) {
    const auto found = std::find(from.begin(), from.end(), to[i]);
    if (found != from.end()) parameters(static_cast<Eigen::Index>(i)) = camera.parameters()(found - from.begin());
  }
  return parameters;
}

/// The calibration as mrcal's problem, its board with the first corner as origin.
MrcalProblem problem_of(const Calibration& calibration, const SecondOpinionOptions& options) {
  const base::Board& board = calibration.board.board;
  MrcalProblem problem;
  problem.lens = options.lens;
  problem.bent = options.bent;
  problem.reject_outliers = options.reject_outliers;
  problem.columns = board.columns;
  problem.rows = board.rows;
  const Eigen::Matrix3Xd nominal = board.nominal_points();
  problem.pitch_mm = (nominal.col(1) - nominal.col(0)).norm();
  for (const auto& one : calibration.cameras) {
    const base::Camera& camera = one.camera;
    problem.cameras.push_back({camera.width_px(), camera.height_px(), start_of(camera, options.lens)});
  }
  if (calibration.rig) problem.right_from_left = calibration.rig->right_from_left;
  const base::Pose middle_from_first{Eigen::Quaterniond::Identity(), nominal.col(0)};
  std::map<std::pair<int, int>, int> moments;  // station and, where its views stand apart, view
  for (std::size_t v = 0; v < calibration.views.size(); ++v) {
    const base::CalibratedView& view = calibration.views[v];
    const bool paired = calibration.stations[static_cast<std::size_t>(view.station)].paired;
    const int camera = view.camera == calibration.cameras[0].name ? 0 : 1;
    const auto [moment, is_new] = moments.try_emplace({view.station, paired ? -1 : static_cast<int>(v)},
                                                      static_cast<int>(problem.left_from_board.size()));
    if (is_new) {
      base::Pose left_from_board = view.board_from_camera.inverse() * middle_from_first;
      if (camera > 0) left_from_board = problem.right_from_left.inverse() * left_from_board;
      problem.left_from_board.push_back(left_from_board);
    }
    Eigen::Matrix3Xd corners = Eigen::Matrix3Xd::Constant(3, board.count(), -1.0);
    problem.views.push_back({camera, moment->second, std::move(corners)});
  }
  double common_px = calibration.residuals[0].sigma_px;
  for (const auto& corner : calibration.residuals) common_px = std::min(common_px, corner.sigma_px);
  for (const auto& corner : calibration.residuals) {
    problem.views[static_cast<std::size_t>(corner.view)].corners.col(corner.corner) << corner.measured_px,
        corner.sigma_px > 0.0 ? common_px / corner.sigma_px : 1.0;
  }
  return problem;
}

/// Our own solver on the same corners with a rigid board and the same lens model.
void add_ours(const Calibration& calibration, const SecondOpinionOptions& options, SecondOpinion& opinion,
              const base::Progress& progress) {
  BoardViews views{calibration.board.board, {}, {}};
  views.board.free = false;
  for (const auto& camera : calibration.cameras) views.cameras.push_back(camera.name);
  for (const auto& view : calibration.views) {
    const auto camera = std::find_if(calibration.cameras.begin(), calibration.cameras.end(),
                                     [&](const auto& one) { return one.name == view.camera; });
    views.images.push_back({view.image, view.camera, camera->camera.width_px(), camera->camera.height_px(), {}});
  }
  for (const auto& corner : calibration.residuals) {
    views.images[static_cast<std::size_t>(corner.view)].corners.push_back({corner.corner, corner.measured_px, corner.sigma_px});
  }
  const auto ours = calibrate(views, {.lens = options.lens, .cross_validate = false, .reject_outliers = false}, progress);
  if (!ours) return;
  opinion.our_rms_px = ours->rms_px;
  for (const auto& camera : ours->cameras) opinion.our_focal_px.push_back(camera.camera.focal_px().x());
  if (ours->rig) opinion.our_baseline_mm = ours->rig->baseline_mm;
}

double middle_distance_mm(const Calibration& calibration) {
  std::vector<double> distances;
  for (const auto& view : calibration.views) distances.push_back(view.distance_mm);
  const auto middle = distances.begin() + static_cast<std::ptrdiff_t>(distances.size() / 2);
  std::nth_element(distances.begin(), middle, distances.end());
  return *middle;
}

/// Between mrcal's lenses and the calibration's, where corners were seen.
void add_differences(const Calibration& calibration, const MrcalProblem& solved, SecondOpinion& opinion) {
  opinion.distance_mm = middle_distance_mm(calibration);
  for (std::size_t c = 0; c < calibration.cameras.size(); ++c) {
    base::Camera ours = calibration.cameras[c].camera;
    ours.set_valid_region(calibration.cameras[c].area.outline_px());
    const auto theirs = base::Camera::make(solved.lens, ours.width_px(), ours.height_px(), solved.cameras[c].parameters);
    if (!theirs) {
      opinion.failure = "mrcal ended with an impossible lens: " + theirs.error().message;
      return;
    }
    const auto difference = math::projection_difference(ours, *theirs, {.distance_mm = opinion.distance_mm});
    if (!difference) {
      opinion.failure = "the projections cannot be compared: " + difference.error().message;
      return;
    }
    opinion.difference_rms_px.push_back(difference->rms_px);
    opinion.difference_max_px.push_back(difference->max_px);
  }
}

}  // namespace

Result<SecondOpinion> second_opinion(const Calibration& calibration, const SecondOpinionOptions& options,
                                     const base::Progress& progress) {
  if (auto ok = check(calibration, options); !ok) return fail(std::move(ok));
  MrcalProblem problem = problem_of(calibration, options);
  for (const auto& camera : problem.cameras) {
    if (!camera.parameters.allFinite()) return fail(ErrorCode::kBadInput, "the calibration's lenses are no start");
  }
  const auto answer = detail::solve(problem, progress);
  if (!answer) return tl::unexpected(answer.error());
  SecondOpinion opinion;
  opinion.program = "mrcal 2.2";
  opinion.lens = options.lens;
  opinion.board = options.bent ? "two bends" : "rigid";
  opinion.rms_px = answer->rms_px;
  opinion.rejected = answer->rejected;
  opinion.bends_mm = answer->bends_mm;
  for (const auto& camera : problem.cameras) opinion.parameters.push_back(camera.parameters);
  if (problem.cameras.size() > 1) {
    opinion.right_from_left = problem.right_from_left;
    opinion.baseline_mm = problem.right_from_left.translation_mm.norm();
  }
  if (!options.bent && !options.lens.is_splined()) add_ours(calibration, options, opinion, progress);
  add_differences(calibration, problem, opinion);
  return opinion;
}

}  // namespace crosstie::calib
