#include "calib/quality.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <optional>
#include <utility>

#include "calib/uncertainty.h"
#include "math/projection_difference.h"
#include "math/projection_sigmas.h"

namespace crosstie::calib {
namespace {

using base::Calibration;
using base::fail;
using base::Result;
using Eigen::Vector2d;
using Eigen::Vector3d;

/// A ray of unit length and its change with the pixel.
struct Ray {
  Vector3d direction;
  Eigen::Matrix<double, 3, 2> by_pixel;
};

std::optional<Ray> ray_of(const base::Camera& camera, const Vector2d& pixel) {
  const auto direction = camera.unproject(pixel);
  Eigen::Matrix<double, 2, 3> by_point;
  if (!direction || !camera.project(*direction, &by_point)) return {};
  return Ray{*direction, math::across(by_point)};
}

/// Sums over the corners of one pair of images.
struct Sums {
  int corners = 0;
  double sum = 0.0;
  double squares = 0.0;
  double expected = 0.0;
  double largest = 0.0;

  void add(double distance_px, double variance_px2) {
    ++corners;
    sum += distance_px;
    squares += distance_px * distance_px;
    expected += variance_px2;
    largest = std::max(largest, std::abs(distance_px));
  }
};

/// Of each station and corner: the pixels in left and right image.
using Matches = std::map<std::pair<int, int>, std::array<std::optional<Vector2d>, 2>>;

Matches matches_of(const Calibration& calibration) {
  Matches matches;
  for (const base::CalibrationResidual& one : calibration.residuals) {
    const base::CalibratedView& view = calibration.views[static_cast<std::size_t>(one.view)];
    const std::size_t side = view.camera == calibration.rig->left ? 0 : 1;
    matches[{view.station, one.corner}][side] = one.measured_px;
  }
  return matches;
}

}  // namespace

double working_distance_mm(const Calibration& calibration) {
  std::vector<double> distances;
  for (const base::CalibratedView& view : calibration.views) distances.push_back(view.distance_mm);
  if (distances.empty()) return 0.0;
  const auto middle = distances.begin() + static_cast<std::ptrdiff_t>(distances.size() / 2);
  std::nth_element(distances.begin(), middle, distances.end());
  return *middle;
}

Result<base::CalibrationMaps> calibration_maps(const Calibration& calibration, double distance_mm) {
  base::CalibrationMaps maps;
  maps.distance_mm = distance_mm;
  const math::ProjectionSigmasOptions options{.distance_mm = distance_mm};
  for (std::size_t c = 0; c < calibration.cameras.size(); ++c) {
    auto sigmas = projection_sigmas(calibration, static_cast<int>(c), options);
    if (!sigmas) return fail(std::move(sigmas));
    maps.cameras.push_back(*std::move(sigmas));
  }
  if (!calibration.rig) return maps;
  for (const auto& [frame, target] :
       {std::pair{PointFrame::kRig, &maps.in_rig}, std::pair{PointFrame::kBoards, &maps.on_boards}}) {
    auto sigmas = triangulation_sigmas(calibration, frame, options);
    if (!sigmas) return fail(std::move(sigmas));
    *target = *std::move(sigmas);
  }
  return maps;
}

std::vector<base::EpipolarPair> epipolar_pairs(const Calibration& calibration) {
  if (!calibration.rig || calibration.cameras.size() != 2) return {};
  const base::Pose& right_from_left = calibration.rig->right_from_left;
  const Eigen::Matrix3d rotation = right_from_left.rotation.toRotationMatrix();
  const double variance_px2 = calibration.sigma0_px * calibration.sigma0_px;
  std::map<int, Sums> pairs;
  for (const auto& [key, pixels] : matches_of(calibration)) {
    if (!pixels[0] || !pixels[1]) continue;
    const auto left = ray_of(calibration.cameras[0].camera, *pixels[0]);
    const auto right = ray_of(calibration.cameras[1].camera, *pixels[1]);
    if (!left || !right) continue;
    const Vector3d normal = right_from_left.translation_mm.cross(rotation * left->direction);
    const Vector2d by_right = right->by_pixel.transpose() * normal;
    const Vector2d by_left = (rotation * left->by_pixel).transpose() * right->direction.cross(right_from_left.translation_mm);
    const double slope = by_right.norm();
    if (!(slope > 0.0)) continue;
    pairs[key.first].add(right->direction.dot(normal) / slope,
                         variance_px2 * (1.0 + by_left.squaredNorm() / by_right.squaredNorm()));
  }
  std::vector<base::EpipolarPair> result;
  for (const auto& [station, sums] : pairs) {
    result.push_back({.station = calibration.stations[static_cast<std::size_t>(station)].name,
                      .corners = sums.corners,
                      .mean_px = sums.sum / sums.corners,
                      .rms_px = std::sqrt(sums.squares / sums.corners),
                      .max_px = sums.largest,
                      .expected_px = std::sqrt(sums.expected / sums.corners)});
  }
  return result;
}

base::CalibrationChange calibration_change(const Calibration& previous, const Calibration& now, double distance_mm) {
  base::CalibrationChange change;
  change.distance_mm = distance_mm;
  for (const base::CalibratedCamera& camera : now.cameras) {
    const auto before = std::find_if(previous.cameras.begin(), previous.cameras.end(),
                                     [&](const base::CalibratedCamera& one) { return one.name == camera.name; });
    if (before == previous.cameras.end()) continue;
    base::CalibrationChange::Lens& lens = change.cameras.emplace_back();
    lens.name = camera.name;
    auto difference = math::projection_difference(before->camera, camera.camera, {.distance_mm = distance_mm});
    if (difference) {
      lens.difference = *std::move(difference);
    } else {
      lens.failure = difference.error().message;
    }
  }
  const bool same_rig = previous.rig && now.rig && previous.rig->left == now.rig->left && previous.rig->right == now.rig->right;
  if (!same_rig) return change;
  base::CalibrationChange::Rig rig;
  rig.change = base::difference(previous.rig->right_from_left, now.rig->right_from_left);
  rig.sigma = (previous.rig->cov + now.rig->cov).diagonal().cwiseMax(0.0).cwiseSqrt();
  rig.baseline_before_mm = previous.rig->baseline_mm;
  rig.baseline_change_mm = now.rig->baseline_mm - previous.rig->baseline_mm;
  rig.baseline_sigma_mm = std::hypot(previous.rig->baseline_sigma_mm, now.rig->baseline_sigma_mm);
  change.rig = rig;
  return change;
}

}  // namespace crosstie::calib
