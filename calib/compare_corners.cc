#include "calib/compare_corners.h"

#include <algorithm>
#include <cmath>
#include <map>

namespace crosstie::calib {
namespace {

/// Sum of squared distances and their number between the corners of one image; `turned`: b counted from the other end.
std::pair<double, int> apart(const base::BoardImage& a, const base::BoardImage& b, int count, bool turned) {
  std::map<int, Eigen::Vector2d> places;
  for (const auto& corner : b.corners) places.emplace(turned ? count - 1 - corner.index : corner.index, corner.px);
  std::pair<double, int> result{0.0, 0};
  for (const auto& corner : a.corners) {
    const auto other = places.find(corner.index);
    if (other == places.end()) continue;
    result.first += (corner.px - other->second).squaredNorm();
    ++result.second;
  }
  return result;
}

double difference_px(const BoardViews& views, const BoardViews& used) {
  double sum = 0.0;
  int count = 0;
  for (const base::BoardImage& image : used.images) {
    for (const base::BoardImage& other : views.images) {
      if (other.image != image.image || other.camera != image.camera) continue;
      const auto as_is = apart(image, other, used.board.count(), false);
      const auto turned = apart(image, other, used.board.count(), true);
      const auto& nearer = turned.second > 0 && turned.first < as_is.first ? turned : as_is;
      sum += nearer.first;
      count += nearer.second;
    }
  }
  return count > 0 ? std::sqrt(sum / count) : 0.0;
}

}  // namespace

base::DetectorTrial compare_corners(const std::string& detector, const BoardViews& corners, const BoardViews& used,
                                    base::LensModel lens, CalibrateOptions options, const base::Progress& progress) {
  base::DetectorTrial trial;
  trial.detector = detector;
  for (const base::BoardImage& image : corners.images) {
    trial.images += image.corners.empty() ? 0 : 1;
    trial.corners += static_cast<int>(image.corners.size());
  }
  trial.difference_px = difference_px(corners, used);
  options.lens = lens;
  options.cross_validate = false;
  const auto result = calibrate(corners, options, progress);
  if (!result) {
    trial.failure = result.error().message;
    return trial;
  }
  trial.rms_px = result->rms_px;
  for (const auto& camera : result->cameras) trial.focal_px.push_back(camera.camera.focal_px().x());
  if (result->rig) trial.baseline_mm = result->rig->baseline_mm;
  return trial;
}

}  // namespace crosstie::calib
