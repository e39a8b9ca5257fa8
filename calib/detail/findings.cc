#include "calib/detail/findings.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include <fmt/format.h>
#include <Eigen/Geometry>

#include "calib/board_views.h"
#include "math/distributions.h"

namespace crosstie::calib::detail {
namespace {

using base::CalibratedCamera;
using base::Calibration;

constexpr double kDegree = std::numbers::pi / 180.0;
constexpr double kWeakFocal = 0.005;  // relative sigma
constexpr double kBadView = 3.0;      // rms over the median's
constexpr double kGap = 2.0;          // over its prediction
constexpr double kPriorLevel = 0.999;

void warn(Calibration& result, std::string code, std::string subject, std::string message) {
  result.warnings.push_back({std::move(code), std::move(subject), std::move(message)});
}

std::vector<const base::CalibratedView*> views_of(const Calibration& result, const std::string& camera) {
  std::vector<const base::CalibratedView*> views;
  for (const auto& view : result.views) {
    if (view.camera == camera) views.push_back(&view);
  }
  return views;
}

void about_views(const CalibratedCamera& camera, Calibration& result) {
  const auto views = views_of(result, camera.name);
  if (static_cast<int>(views.size()) < kFewViews) {
    warn(result, "few_views", camera.name,
         fmt::format("camera {}: {} images of the board only; 25 or more, tilted and turned, make a calibration that holds",
                     camera.name, views.size()));
  }
  std::vector<base::Pose> poses;
  for (const auto* view : views) poses.push_back(view->board_from_camera);
  const auto [tilt, roll] = spread_of(poses);
  if (tilt < kLittleTilt_rad) {
    warn(result, "little_tilt", camera.name,
         fmt::format(
             "camera {}: the images show the board within {:.0f} degrees of one direction: focal length and distance are "
             "hard to tell apart. Tilt the board by 30 to 45 degrees in both directions",
             camera.name, tilt / kDegree));
  }
  if (roll < kRolled_rad) {
    warn(result, "not_rolled", camera.name,
         fmt::format(
             "camera {}: the board was never turned about the line of sight (by {:.0f} degrees at most): principal point and "
             "board shape are hard to tell apart. Turn it by 90 degrees in some images",
             camera.name, roll / kDegree));
  }
}

void about_coverage(const CalibratedCamera& camera, Calibration& result) {
  const base::CalibratedArea& area = camera.area;
  const std::string empty = fmt::format("{}", fmt::join(empty_corners(area), ", "));
  if (area.inner_share() >= kPoorCoverage && empty.empty()) return;
  warn(result, "poor_coverage", camera.name,
       fmt::format(
           "camera {}: the board was seen in {:.0f} % of the image's cells (border: {:.0f} %){}{}; elsewhere the lens model is "
           "extrapolated and not calibrated. Fill the image up to its corners, in some images at least",
           camera.name, 100.0 * area.inner_share(), 100.0 * area.border_share(), empty.empty() ? "" : ", never in the corners ",
           empty));
}

void about_parameters(const CalibratedCamera& camera, Calibration& result) {
  const Eigen::MatrixXd& cov = camera.camera.covariance();
  const double relative = std::sqrt(cov(0, 0)) / camera.camera.focal_px().x();
  if (relative > kWeakFocal) {
    warn(result, "weak_parameter", camera.name,
         fmt::format("camera {}: its focal length is known to {:.2f} % only; take images at stronger tilts and different "
                     "distances",
                     camera.name, 100.0 * relative));
  }
  if (camera.correlations.empty()) return;
  std::string pairs;
  for (const auto& c : camera.correlations) {
    pairs += fmt::format("{}{}-{} {:+.3f}", pairs.empty() ? "" : ", ", c.a, c.b, c.value);
  }
  warn(result, "high_correlation", camera.name,
       fmt::format("camera {}: these parameters are correlated by more than 0.95: {}. Each alone means little; together they "
                   "describe the lens",
                   camera.name, pairs));
}

void about_bad_views(Calibration& result) {
  for (const CalibratedCamera& camera : result.cameras) {
    const auto views = views_of(result, camera.name);
    std::vector<double> rms;
    for (const auto* view : views) rms.push_back(view->rms_px);
    if (rms.size() < 3) continue;
    std::sort(rms.begin(), rms.end());
    const double middle = rms[rms.size() / 2];
    for (const auto* view : views) {
      if (view->rms_px <= kBadView * middle) continue;
      warn(result, "bad_view", view->image,
           fmt::format(
               "image {}: rms {:.3f} px, more than three times the median of camera {} ({:.3f} px): blurred, or the board "
               "moved?",
               view->image, view->rms_px, camera.name, middle));
    }
  }
  for (const auto& rejected : result.rejected) {
    if (rejected.corner >= 0) continue;
    warn(result, "image_left_out", rejected.image, fmt::format("image {} takes no part: {}", rejected.image, rejected.reason));
  }
}

void about_pairs(const Problem& problem, Calibration& result) {
  if (problem.cameras.size() < 2) return;
  std::string single;
  for (const auto& station : result.stations) {
    if (!station.paired) single += (single.empty() ? "" : ", ") + station.name;
  }
  if (!result.rig) {
    warn(result, "no_pairs", "",
         "no two images of the cameras belong to one moment: both are calibrated, but not where they sit to each other. Images "
         "are "
         "paired by the numbers in their names");
    return;
  }
  if (!single.empty()) {
    warn(result, "unpaired_images", single,
         fmt::format("these stations have no pair of usable images and tell nothing of the rig: {}", single));
  }
  const Eigen::Vector3d& t = result.rig->right_from_left.translation_mm;
  if (t.x() > 0.0 && t.x() > std::abs(t.y()) && t.x() > std::abs(t.z())) {
    warn(result, "cameras_swapped", "",
         fmt::format(
             "camera {} sits to the left of camera {} as the images stand: are the two exchanged? If the head hangs upside "
             "down, this is as it should be",
             result.rig->right, result.rig->left));
  }
}

void about_board(const Calibration& found, const Problem& problem, Calibration& result) {
  const double dof = 3.0 * static_cast<double>(problem.nominal.cols());
  if (problem.board.free && found.board.prior_ratio > math::chi_square_quantile(kPriorLevel, dof) / dof) {
    warn(result, "board_prior_too_tight", "",
         fmt::format(
             "the board deviates from its nominal shape {:.1f} times as much as its sigmas say (out of its plane {:.3f} mm, in "
             "the plane {:.3f} mm rms): state larger ones (sigma_mm, bend_sigma_mm), or the sigmas of the result are too "
             "small",
             std::sqrt(found.board.prior_ratio), found.board.bend_rms_mm, found.board.in_plane_rms_mm));
  }
}

void about_validation(Calibration& result) {
  if (!result.validation) return;
  const base::CrossValidation& v = *result.validation;
  if (result.rig && v.halves.size() == 2 && std::abs(v.baseline_gap_mm) > kGap * v.baseline_gap_sigma_mm) {
    warn(result, "halves_contradict", "",
         fmt::format(
             "the baselines of odd and even views differ by {:.3f} mm, their sigmas predict {:.3f} mm: something is not in "
             "the model (lens, board, a rig that bends), and the sigmas are too small",
             v.baseline_gap_mm, v.baseline_gap_sigma_mm));
  }
  for (std::size_t c = 0; c < v.model_difference_px.size(); ++c) {
    if (!(v.model_difference_px[c] > kGap * v.model_difference_predicted_px[c])) continue;
    warn(result, "lens_model_error", result.cameras[c].name,
         fmt::format(
             "camera {}: the lenses of odd and even views differ by {:.3f} px, their sigmas predict {:.3f} px: the lens model "
             "or the board's does not hold",
             result.cameras[c].name, v.model_difference_px[c], v.model_difference_predicted_px[c]));
  }
}

}  // namespace

base::Result<> check_baseline(const Calibration& result, const CalibrateOptions& options) {
  constexpr double kFarOff = 1.25;
  if (!result.rig || !options.expected_baseline_mm) return {};
  const double ratio = result.rig->baseline_mm / *options.expected_baseline_mm;
  if (ratio < kFarOff && ratio > 1.0 / kFarOff) return {};
  const auto near = [&](double unit) { return std::max(ratio / unit, unit / ratio) < kFarOff; };
  return base::fail(
      base::ErrorCode::kBadInput,
      fmt::format(
          "the cameras come out {:.4g} mm apart, {:.4g} mm were expected: {}compare the board's pitch_mm ({:.4g} mm) with the "
          "board itself",
          result.rig->baseline_mm, *options.expected_baseline_mm,
          near(1.0 / 25.4)   ? "is the pitch in inches? "
          : near(25.4)       ? "is the expected distance in inches? "
          : near(0.1)        ? "is the pitch in cm? "
          : near(1.0 / 1000) ? "is the pitch in m? "
                             : "",
          result.board.board.pitch_mm));
}

void add_findings(const Problem& problem, Calibration& result) {
  const std::vector<CalibratedCamera> cameras = result.cameras;
  for (const CalibratedCamera& camera : cameras) {
    about_views(camera, result);
    about_coverage(camera, result);
    about_parameters(camera, result);
  }
  about_pairs(problem, result);
  about_bad_views(result);
  about_board(result, problem, result);
  about_validation(result);
}

}  // namespace crosstie::calib::detail
