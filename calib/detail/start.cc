#include "calib/detail/start.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <utility>

#include <fmt/format.h>

#include "calib/detail/camera_fit.h"
#include "calib/detail/homography.h"
#include "calib/detail/rig_start.h"
#include "calib/detail/spline_lens.h"

namespace crosstie::calib::detail {
namespace {

using base::ErrorCode;
using base::fail;
using base::Progress;
using base::Result;

constexpr int kLeastViews = 3;
constexpr double kRobustSigmas = 3.0;
constexpr double kOffPlane = 0.15;       // rms of a homography over the corners' spacing above which it is no image of the grid
constexpr double kLeastTilt_rad = 0.05;  // largest angle between two views' normals: 3 degrees
constexpr double kBadView = 5.0;         // rms over the median of all views at which one leaves
constexpr base::LensModel kStartModel = base::LensModel::kOpenCv4;

struct PlaneView {
  int view = 0;
  Eigen::Matrix3d homography = Eigen::Matrix3d::Identity();
};

struct Pixels {
  Eigen::Matrix2Xd plane;
  Eigen::Matrix2Xd pixels;
  double spacing_px = 0.0;  ///< of neighbouring corners
};

/// A view's corners with the places of the points they are said to show; `transposed`: as if columns and rows were exchanged.
Pixels pixels_of(const Problem& problem, const View& view, bool transposed) {
  const auto count = static_cast<Eigen::Index>(view.corners.size());
  Pixels result{Eigen::Matrix2Xd(2, count), Eigen::Matrix2Xd(2, count), 0.0};
  base::Board other = problem.board;
  std::swap(other.columns, other.rows);
  const Eigen::Matrix3Xd places = transposed ? other.nominal_points() : problem.nominal;
  for (Eigen::Index i = 0; i < count; ++i) {
    const Corner& corner = problem.corners[static_cast<std::size_t>(view.corners[static_cast<std::size_t>(i)])];
    result.plane.col(i) = places.col(corner.point).head<2>();
    result.pixels.col(i) = corner.px;
  }
  const auto extent = [](const Eigen::Matrix2Xd& points) {
    return std::sqrt((points.colwise() - points.rowwise().mean()).colwise().squaredNorm().mean());
  };
  result.spacing_px = problem.board.pitch_mm * extent(result.pixels) / extent(result.plane);
  return result;
}

/// The homography of each view. Views whose corners do not lie in the grid's order leave; where most do not, the whole is refused.
Result<std::vector<PlaneView>> plane_views(Problem& problem, State& state, int camera) {
  std::vector<PlaneView> good;
  int all = 0;
  int turned = 0;
  for (std::size_t v = 0; v < problem.views.size(); ++v) {
    const View& view = problem.views[v];
    if (view.camera != camera) continue;
    ++all;
    const Pixels as_said = pixels_of(problem, view, false);
    const auto homography = fit_homography(as_said.plane, as_said.pixels);
    if (homography && homography->rms_px < kOffPlane * as_said.spacing_px) {
      good.push_back({static_cast<int>(v), homography->h});
      continue;
    }
    state.view_reasons[v] = "its corners do not lie in the order of the board's grid";
    const Pixels exchanged = pixels_of(problem, view, true);
    const auto other = fit_homography(exchanged.plane, exchanged.pixels);
    turned += other && other->rms_px < kOffPlane * exchanged.spacing_px ? 1 : 0;
  }
  const std::string& name = problem.cameras[static_cast<std::size_t>(camera)];
  if (all > 0 && 2 * turned > all) {
    return fail(ErrorCode::kBadInput,
                fmt::format("camera {}: the corners are those of a board of {} x {}, not of {} x {}: columns and rows are "
                            "exchanged",
                            name, problem.board.rows, problem.board.columns, problem.board.columns, problem.board.rows));
  }
  if (all >= kLeastViews && 2 * good.size() < static_cast<std::size_t>(all)) {
    return fail(
        ErrorCode::kBadInput,
        fmt::format("camera {}: in {} of {} images the corners do not lie in a grid of {} x {}; is the board another one?",
                    name, all - static_cast<int>(good.size()), all, problem.board.columns, problem.board.rows));
  }
  if (static_cast<int>(good.size()) < kLeastViews) {
    return fail(ErrorCode::kNoUniqueSolution,
                fmt::format("camera {}: {} usable images of the board; at least {} are needed, {} or more are advisable", name,
                            good.size(), kLeastViews, 25));
  }
  return good;
}

/// The pose from the homography and from its mirror image, whichever fits better.
std::optional<PoseFit> pose_of(const Problem& problem, const State& state, const PlaneView& view, double focal_px,
                               const Eigen::Vector2d& centre) {
  const auto camera_from_board = plane_pose(view.homography, focal_px, centre);
  if (!camera_from_board) return {};
  const auto camera = static_cast<std::size_t>(problem.views[static_cast<std::size_t>(view.view)].camera);
  const PoseData data = pose_data(problem, state, view.view);
  auto best = fit_pose(state.lens_model, state.lenses[camera], data, camera_from_board->inverse());
  if (!best) return {};
  const auto other = fit_pose(state.lens_model, state.lenses[camera], data, mirrored_pose(best->board_from_camera));
  return other && other->square_sum < best->square_sum ? other : best;
}

/// The largest angle between the board's normals as one camera saw them.
double tilt_range_rad(const State& state, const std::vector<PlaneView>& views) {
  double range = 0.0;
  for (const PlaneView& a : views) {
    for (const PlaneView& b : views) {
      const auto& pose_a = state.board_from_camera[static_cast<std::size_t>(a.view)];
      const auto& pose_b = state.board_from_camera[static_cast<std::size_t>(b.view)];
      if (!pose_a || !pose_b) continue;
      const Eigen::Vector3d normal_a = pose_a->rotation.conjugate() * Eigen::Vector3d::UnitZ();
      const Eigen::Vector3d normal_b = pose_b->rotation.conjugate() * Eigen::Vector3d::UnitZ();
      range = std::max(range, std::atan2(normal_a.cross(normal_b).norm(), normal_a.dot(normal_b)));
    }
  }
  return range;
}

double view_rms_px(const Problem& problem, const State& state, int view) {
  double sum = 0.0;
  int count = 0;
  for (const int c : problem.views[static_cast<std::size_t>(view)].corners) {
    if (!state.active[static_cast<std::size_t>(c)]) continue;
    sum += std::pow(distance_px(problem, state, problem.corners[static_cast<std::size_t>(c)]), 2);
    ++count;
  }
  return count > 0 ? std::sqrt(sum / count) : 0.0;
}

/// A robust minimum of one camera's views alone.
Result<> settle_camera(const Problem& problem, State& state, int camera) {
  State alone = state;
  std::vector<std::size_t> used;
  for (std::size_t v = 0; v < problem.views.size(); ++v) {
    if (problem.views[v].camera != camera) {
      alone.board_from_camera[v].reset();
    } else if (alone.board_from_camera[v]) {
      used.push_back(v);
    }
  }
  alone.sigma_px = std::max(kLeastSigma_px, robust_sigma_px(problem, alone));
  const auto c = static_cast<std::size_t>(camera);
  CameraFit fit{state.lenses[c], {}, 0};
  std::vector<PoseData> views;
  for (const std::size_t v : used) {
    fit.board_from_camera.push_back(*state.board_from_camera[v]);
    views.push_back(pose_data(problem, alone, static_cast<int>(v)));
  }
  if (!fit_camera(state.lens_model, views, kRobustSigmas, fit)) {
    return fail(ErrorCode::kNoUniqueSolution,
                fmt::format("camera {}: its corners lead to no start values; do they belong to one camera and one board?",
                            problem.cameras[c]));
  }
  state.lenses[c] = fit.lens;
  for (std::size_t i = 0; i < used.size(); ++i) state.board_from_camera[used[i]] = fit.board_from_camera[i];
  state.iterations += fit.iterations;
  return {};
}

/// Views that fit far worse than the others leave.
int drop_bad_views(const Problem& problem, State& state, int camera) {
  std::vector<double> rms(problem.views.size(), 0.0);
  std::vector<double> sorted;
  for (std::size_t v = 0; v < problem.views.size(); ++v) {
    if (problem.views[v].camera != camera || !state.takes_part(static_cast<int>(v))) continue;
    rms[v] = view_rms_px(problem, state, static_cast<int>(v));
    sorted.push_back(rms[v]);
  }
  if (sorted.size() <= static_cast<std::size_t>(kLeastViews)) return 0;
  std::sort(sorted.begin(), sorted.end());
  const double middle = sorted[(sorted.size() - 1) / 2];
  int dropped = 0;
  for (std::size_t v = 0; v < problem.views.size(); ++v) {
    if (rms[v] <= kBadView * middle || rms[v] < 0.5) continue;
    state.board_from_camera[v].reset();
    state.view_reasons[v] =
        fmt::format("its corners fit no image of the board: rms {:.2f} px, the median of all images {:.2f} px", rms[v], middle);
    ++dropped;
  }
  return dropped;
}

Result<> start_camera(Problem& problem, State& state, int camera, const Progress& progress) {
  auto views = plane_views(problem, state, camera);
  if (!views) return fail(std::move(views));
  const auto c = static_cast<std::size_t>(camera);
  const Eigen::Vector2d centre = 0.5 * (problem.size_px[c].cast<double>() - Eigen::Vector2d::Ones());
  std::vector<Eigen::Matrix3d> homographies;
  for (const PlaneView& view : *views) homographies.push_back(view.homography);
  // Frontal views leave it open; then any focal length serves as a start and the tilt is judged afterwards.
  const double width = problem.size_px[c].cast<double>().maxCoeff();
  const auto told = focal_from_homographies(homographies, centre);
  const double focal = told ? std::clamp(*told, 0.2 * width, 50.0 * width) : 1.2 * width;
  state.lenses[c] = Eigen::VectorXd::Zero(base::parameter_count(kStartModel));
  state.lenses[c].head<4>() << focal, focal, centre.x(), centre.y();
  for (const PlaneView& view : *views) {
    const auto fit = pose_of(problem, state, view, focal, centre);
    if (fit) {
      state.board_from_camera[static_cast<std::size_t>(view.view)] = fit->board_from_camera;
    } else {
      state.view_reasons[static_cast<std::size_t>(view.view)] = "no pose of the board explains its corners";
    }
  }
  for (int round = 0; round < 3; ++round) {
    if (progress.cancelled()) return base::cancelled("the calibration");
    if (auto ok = settle_camera(problem, state, camera); !ok) return ok;
    if (drop_bad_views(problem, state, camera) == 0) break;
  }
  const double tilt = tilt_range_rad(state, *views);
  if (tilt < kLeastTilt_rad) {
    return fail(
        ErrorCode::kNoUniqueSolution,
        fmt::format("camera {}: all images show the board at one angle (within {:.1f} degrees): focal length and distance "
                    "cannot be told apart. Tilt the board by 30 to 45 degrees in both directions",
                    problem.cameras[c], tilt * 180.0 / 3.14159265358979));
  }
  return {};
}

}  // namespace

double distance_px(const Problem& problem, const State& state, const Corner& corner) {
  const auto& pose = state.board_from_camera[static_cast<std::size_t>(corner.view)];
  constexpr double kFar = std::numeric_limits<double>::infinity();
  if (!pose) return kFar;
  const auto camera = static_cast<std::size_t>(problem.view_of(corner).camera);
  const Eigen::Vector3d p_in_camera = pose->inverse() * Eigen::Vector3d(state.points.col(corner.point));
  Eigen::Vector2d pixel;
  if (!base::project_bare(state.lens_model, state.lenses[camera].data(), p_in_camera.data(), pixel.data(), nullptr, nullptr)) {
    return kFar;
  }
  return (pixel - corner.px).norm();
}

double robust_sigma_px(const Problem& problem, const State& state) {
  constexpr double kMedianOfLength = 1.17741;  // of two normal coordinates, in sigmas
  std::vector<double> distances;
  for (std::size_t c = 0; c < problem.corners.size(); ++c) {
    if (!state.active[c] || !state.takes_part(problem.corners[c].view)) continue;
    distances.push_back(distance_px(problem, state, problem.corners[c]) / problem.corners[c].relative_sigma);
  }
  if (distances.empty()) return 1.0;
  const auto middle = distances.begin() + static_cast<std::ptrdiff_t>(distances.size() / 2);
  std::nth_element(distances.begin(), middle, distances.end());
  return *middle / kMedianOfLength;
}

void change_lens(State& state, base::LensModel to) {
  const base::LensModel from = state.lens_model;
  if (from == to) return;
  for (Eigen::VectorXd& lens : state.lenses) {
    if (to.is_splined()) {
      lens = as_spline(lens, from, to);
      continue;
    }
    const auto known = base::parameter_names(from);
    const auto wanted = base::parameter_names(to);
    Eigen::VectorXd changed = Eigen::VectorXd::Zero(base::parameter_count(to));
    for (std::size_t i = 0; i < wanted.size(); ++i) {
      const auto at = std::find(known.begin(), known.end(), wanted[i]);
      if (at != known.end()) changed(static_cast<Eigen::Index>(i)) = lens(at - known.begin());
    }
    lens = std::move(changed);
  }
  state.lens_model = to;
  state.lens_means = to.is_splined() ? state.lenses : std::vector<Eigen::VectorXd>();
}

Result<State> start(Problem& problem, const Progress& progress) {
  State state;
  state.lens_model = kStartModel;
  state.lenses.resize(problem.cameras.size());
  for (auto& lens : state.lenses) {
    lens = Eigen::VectorXd::Zero(base::parameter_count(kStartModel));
    lens.head<2>().setOnes();
  }
  state.board_from_camera.resize(problem.views.size());
  state.view_reasons.resize(problem.views.size());
  state.points = problem.nominal;
  state.modes = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(problem.modes.size()));
  state.active.assign(problem.corners.size(), 1);
  for (std::size_t c = 0; c < problem.cameras.size(); ++c) {
    progress("start", c, problem.cameras.size());
    if (auto ok = start_camera(problem, state, static_cast<int>(c), progress); !ok) return fail(std::move(ok));
  }
  progress("start", problem.cameras.size(), problem.cameras.size());
  if (auto ok = start_rig(problem, state); !ok) return fail(std::move(ok));
  state.sigma_px = std::max(kLeastSigma_px, robust_sigma_px(problem, state));
  return state;
}

}  // namespace crosstie::calib::detail
