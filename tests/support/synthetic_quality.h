#pragma once

#include <cmath>

#include "base/calibration.h"
#include "base/calibration_quality.h"

namespace crosstie::tests {

/// A map that rises from the middle of the image to its corners, where the last cells are not calibrated.
inline base::ProjectionSigmas rising_sigmas(double middle_px) {
  base::ProjectionSigmas map;
  map.grid = base::ImageGrid::over(1280, 1024, 10);
  map.distance_mm = 480.0;
  map.sigma_px.resize(map.grid.count());
  for (int i = 0; i < map.grid.count(); ++i) {
    const double r = (map.grid.middle_px(i) - Eigen::Vector2d(639.5, 511.5)).norm() / 820.0;
    map.sigma_px(i) = middle_px * (1.0 + 4.0 * r * r);
    map.calibrated.push_back(r < 0.85 ? 1 : 0);
  }
  map.minor_px = 0.7 * map.sigma_px;
  map.sigma_mm = map.distance_mm / 1053.0 * map.sigma_px;
  return map;
}

/// Maps, pairs and the change since another one, to be shown with synthetic_calibration().
inline base::CalibrationQuality synthetic_quality(const base::Calibration& calibration) {
  base::CalibrationQuality quality;
  base::CalibrationMaps maps;
  maps.distance_mm = 480.0;
  maps.cameras = {rising_sigmas(0.02), rising_sigmas(0.03)};
  base::TriangulationSigmas points;
  points.grid = maps.cameras[0].grid;
  points.distance_mm = 480.0;
  points.sigma_depth_mm = 4.0 * maps.cameras[0].sigma_mm;
  points.sigma_across_mm = maps.cameras[0].sigma_mm;
  points.sigma_mm = points.sigma_depth_mm;
  points.sigma_depth_mm(3) = std::nan("");  // the right camera does not see it
  points.calibrated = maps.cameras[0].calibrated;
  maps.in_rig = points;
  maps.on_boards = points;
  quality.maps = std::move(maps);
  for (const base::CalibratedStation& station : calibration.stations)
    quality.epipolar.push_back({station.name, 88, 0.004, 0.085, 0.31, 0.086});
  quality.epipolar.back().rms_px = 0.4;
  base::CalibrationChange change{.previous = "january/results/calibrate", .distance_mm = 480.0, .cameras = {}, .rig = {}};
  base::ProjectionDifference difference;
  difference.grid = quality.maps->cameras[0].grid;
  difference.difference_px = Eigen::Matrix2Xd::Constant(2, difference.grid.count(), 0.05);
  difference.before_px = 10.0 * difference.difference_px;
  difference.compared = quality.maps->cameras[0].calibrated;
  difference.cells = 60;
  difference.rms_px = 0.07;
  difference.max_px = 0.07;
  difference.sigma_px = Eigen::VectorXd::Constant(difference.grid.count(), 0.04);
  difference.test = base::DifferenceTest{.rms_sigma_px = 0.04, .degrees = 3.0, .p = 0.02, .limit_px = 0.09};
  change.cameras.push_back({"left", difference, ""});
  change.cameras.push_back({"right", {}, "the models have 3 of 80 cells in common"});
  base::CalibrationChange::Rig rig;
  rig.change << 1e-5, -2e-5, 3e-5, 0.2, 0.01, -0.02;
  rig.sigma << 4e-5, 5e-5, 2e-5, 0.03, 0.02, 0.05;
  rig.baseline_before_mm = 119.2;
  rig.baseline_change_mm = 0.21;
  rig.baseline_sigma_mm = 0.03;
  change.rig = rig;
  quality.change = std::move(change);
  return quality;
}

}  // namespace crosstie::tests
