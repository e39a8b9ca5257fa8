#include "calib/detail/mrcal_solve.h"

#include <cmath>
#include <cstdint>

#include <fmt/format.h>
#include <Eigen/Geometry>

#include "calib/detail/quiet_stderr.h"

extern "C" {
#include <mrcal/mrcal.h>
}

namespace crosstie::calib::detail {
namespace {

using base::ErrorCode;
using base::fail;
using base::Result;

// What libmrcal was compiled with, as C.
static_assert(sizeof(mrcal_lensmodel_t) == 16 && sizeof(mrcal_pose_t) == 48 && sizeof(mrcal_observation_board_t) == 12 &&
              sizeof(mrcal_problem_selections_t) == 1 && sizeof(mrcal_calobject_warp_t) == 16);

/// mrcal_optimize puts its state on the stack: an eighth of the 8 MB that a thread has.
constexpr int kMaxStates = 1 << 17;
constexpr double kMetre = 1000.0;  // [mm]

mrcal_lensmodel_t mrcal_lens(base::LensModel lens) {
  mrcal_lensmodel_t result{};
  switch (lens) {
    case base::LensModel::kPinhole:
      result.type = MRCAL_LENSMODEL_PINHOLE;
      break;
    case base::LensModel::kOpenCv4:
      result.type = MRCAL_LENSMODEL_OPENCV4;
      break;
    case base::LensModel::kOpenCv5:
      result.type = MRCAL_LENSMODEL_OPENCV5;
      break;
    case base::LensModel::kOpenCv8:
      result.type = MRCAL_LENSMODEL_OPENCV8;
      break;
    case base::LensModel::kOpenCv12:
      result.type = MRCAL_LENSMODEL_OPENCV12;
      break;
    case base::LensModel::kAicon:
      result.type = MRCAL_LENSMODEL_INVALID;
      break;
    case base::LensModel::Kind::kSplined: {
      const base::SplineGrid grid = lens.grid();
      result.type = MRCAL_LENSMODEL_SPLINED_STEREOGRAPHIC;
      result.LENSMODEL_SPLINED_STEREOGRAPHIC__config = {
          static_cast<std::uint16_t>(grid.order), static_cast<std::uint16_t>(grid.columns),
          static_cast<std::uint16_t>(grid.rows), static_cast<std::uint16_t>(grid.fov_x_degrees)};
      break;
    }
  }
  return result;
}

mrcal_pose_t to_mrcal(const base::Pose& pose) {
  const Eigen::Vector3d r = base::rotation_log(pose.rotation);
  const Eigen::Vector3d t = pose.translation_mm / kMetre;
  mrcal_pose_t result{};
  for (int i = 0; i < 3; ++i) {
    result.r.xyz[i] = r(i);
    result.t.xyz[i] = t(i);
  }
  return result;
}

base::Pose from_mrcal(const mrcal_pose_t& pose) {
  return {base::rotation_exp({pose.r.x, pose.r.y, pose.r.z}), kMetre * Eigen::Vector3d(pose.t.x, pose.t.y, pose.t.z)};
}

/// The problem in mrcal's arrays.
struct Arrays {
  mrcal_lensmodel_t lens;
  std::vector<double> intrinsics;
  std::vector<int> sizes;
  std::vector<mrcal_pose_t> extrinsics;
  std::vector<mrcal_pose_t> frames;
  std::vector<mrcal_observation_board_t> boards;
  std::vector<mrcal_point3_t> corners;
  int not_seen = 0;
};

Arrays arrays_of(const MrcalProblem& problem) {
  Arrays arrays;
  arrays.lens = mrcal_lens(problem.lens);
  for (const auto& camera : problem.cameras) {
    arrays.intrinsics.insert(arrays.intrinsics.end(), camera.parameters.begin(), camera.parameters.end());
    arrays.sizes.insert(arrays.sizes.end(), {camera.width_px, camera.height_px});
  }
  if (problem.cameras.size() > 1) arrays.extrinsics.push_back(to_mrcal(problem.right_from_left));
  for (const base::Pose& pose : problem.left_from_board) arrays.frames.push_back(to_mrcal(pose));
  for (const auto& view : problem.views) {
    arrays.boards.push_back({{view.camera, view.camera - 1}, view.moment});
    for (Eigen::Index i = 0; i < view.corners.cols(); ++i) {
      mrcal_point3_t corner{};
      for (int k = 0; k < 3; ++k) corner.xyz[k] = view.corners(k, i);
      arrays.corners.push_back(corner);
      arrays.not_seen += corner.z < 0.0 ? 1 : 0;
    }
  }
  return arrays;
}

bool in_front(const MrcalProblem& problem, const MrcalProblem::View& view) {
  base::Pose camera_from_board = problem.left_from_board[static_cast<std::size_t>(view.moment)];
  if (view.camera > 0) camera_from_board = problem.right_from_left * camera_from_board;
  const Eigen::Vector3d end(problem.pitch_mm * (problem.columns - 1), problem.pitch_mm * (problem.rows - 1), 0.0);
  return camera_from_board.translation_mm.z() > 0.0 && (camera_from_board * end).z() > 0.0;
}

/// Square sum of residuals in px over the corners that took part, and their number.
std::pair<double, int> squares(const Arrays& arrays, const std::vector<double>& x) {
  double sum = 0.0;
  int count = 0;
  for (std::size_t i = 0; i < arrays.corners.size(); ++i) {
    const double weight = arrays.corners[i].z;
    if (!(weight > 0.0)) continue;
    sum += (x[2 * i] * x[2 * i] + x[2 * i + 1] * x[2 * i + 1]) / (weight * weight);
    ++count;
  }
  return {sum, count};
}

}  // namespace

Result<MrcalAnswer> solve(MrcalProblem& problem, const base::Progress& progress) {
  Arrays arrays = arrays_of(problem);
  mrcal_problem_selections_t selections{};
  // The core of a splined model and its control points say the same: mrcal holds the core.
  selections.do_optimize_intrinsics_core = !problem.lens.is_splined();
  selections.do_optimize_intrinsics_distortions = true;
  selections.do_optimize_extrinsics = true;
  selections.do_optimize_frames = true;
  selections.do_optimize_calobject_warp = problem.bent;
  selections.do_apply_regularization = true;
  selections.do_apply_outlier_rejection = problem.reject_outliers;
  const mrcal_problem_constants_t constants = {0.0, 1e9};
  const int cameras = static_cast<int>(problem.cameras.size());
  const int frames = static_cast<int>(arrays.frames.size());
  const int boards = static_cast<int>(arrays.boards.size());
  const int states = mrcal_num_states(cameras, cameras - 1, frames, 0, 0, boards, selections, &arrays.lens);
  const int measurements = mrcal_num_measurements(boards, 0, problem.columns, problem.rows, cameras, cameras - 1, frames, 0, 0,
                                                  selections, &arrays.lens);
  if (states <= 0 || states > kMaxStates || measurements <= 0) {
    return fail(ErrorCode::kUsage, fmt::format("{} unknowns; mrcal takes up to {}", states, kMaxStates));
  }
  if (progress.cancelled()) return base::cancelled("the second opinion");
  std::vector<double> x(static_cast<std::size_t>(measurements), 0.0);
  mrcal_calobject_warp_t warp{};
  const mrcal_stats_t stats = [&] {
    const QuietStderr quiet;
    return mrcal_optimize(nullptr, 0, x.data(), measurements * static_cast<int>(sizeof(double)), arrays.intrinsics.data(),
                          arrays.extrinsics.data(), arrays.frames.data(), nullptr, &warp, cameras, cameras - 1, frames, 0, 0,
                          arrays.boards.data(), nullptr, boards, 0, arrays.corners.data(), &arrays.lens, arrays.sizes.data(),
                          selections, &constants, problem.pitch_mm / kMetre, problem.columns, problem.rows, false, false);
  }();
  const auto [sum, count] = squares(arrays, x);
  bool finite = std::isfinite(sum) && count > 0;
  for (const double value : arrays.intrinsics) finite = finite && std::isfinite(value);
  if (!(stats.rms_reproj_error__pixels >= 0.0) || !finite) {
    return fail(ErrorCode::kNoUniqueSolution, "mrcal ended without a finite answer");
  }
  Eigen::Index first = 0;
  for (auto& camera : problem.cameras) {
    camera.parameters = Eigen::Map<const Eigen::VectorXd>(arrays.intrinsics.data() + first, camera.parameters.size());
    first += camera.parameters.size();
  }
  if (cameras > 1) problem.right_from_left = from_mrcal(arrays.extrinsics[0]);
  for (std::size_t i = 0; i < arrays.frames.size(); ++i) problem.left_from_board[i] = from_mrcal(arrays.frames[i]);
  for (const auto& view : problem.views) {
    if (!in_front(problem, view)) return fail(ErrorCode::kNoUniqueSolution, "mrcal ended with a board behind a camera");
  }
  return MrcalAnswer{stats.Noutliers - arrays.not_seen, std::sqrt(sum / count), kMetre * Eigen::Vector2d(warp.x2, warp.y2)};
}

}  // namespace crosstie::calib::detail
