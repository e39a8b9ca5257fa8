#pragma once

#include <cmath>
#include <limits>
#include <random>

#include <fmt/format.h>

#include "base/cloud.h"
#include "base/stitching.h"
#include "tests/support/synthetic_commissioning.h"

namespace crosstie::tests {

/// Three stations on a tower with two overlaps, six markers and one that was left out, drawn at random: a stitching to be shown and
/// written, not one that was computed.
inline base::Stitching synthetic_stitching(unsigned seed = 1) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  const auto vector = [&](double sigma) {
    return Eigen::Vector3d(sigma * normal(random), sigma * normal(random), sigma * normal(random));
  };
  base::Stitching result;
  result.frame = "machine";
  result.segment = {base::Segment::Kind::kCylinder, {0.0, 0.0, 0.0}, Eigen::Vector3d::UnitX(), 2150.0, 0.0, 0.08, false};
  result.head = synthetic_commissioning(seed).head;
  const Eigen::Index parameters = result.head->parameter_count();
  const char* const names[] = {"axial", "tangential", "radial", "roll", "pitch", "yaw"};
  for (int k = 0; k < 3; ++k) {
    base::StitchedStation& station = result.stations.emplace_back();
    station.name = fmt::format("x{:04}", 400 * k);
    station.axis_mm = 400.0 * k;
    station.machine_from_rig = {Eigen::Quaterniond(Eigen::AngleAxisd(3.0, Eigen::Vector3d(1.0, 0.02 * k, 0.01).normalized())),
                                {400.0 * k, 12.0, 3450.0}};
    station.centre_mm = {400.0 * k + 350.0, 0.0, 2150.0};
    for (int i = 0; i < 6; ++i) {
      station.directions.push_back(
          {names[i], i >= 3, i < 3 ? 0.01 + 0.002 * i : 1e-5, {0.5, 0.2, 0.1, i == 2 ? 0.15 : 0.0, i == 2 ? 0.05 : 0.2}});
    }
    station.markers = 4;
    station.points = 250000 + k;
    station.off_axis = base::Vector6d::Constant(1e-5 * k);
    station.off_axis_w = 0.8;
  }
  for (int k = 0; k < 2; ++k) {
    base::StitchedOverlap& overlap = result.overlaps.emplace_back();
    overlap.a = k;
    overlap.b = k + 1;
    overlap.matches = 640;
    overlap.mean_mm = 0.001;
    overlap.sigma_mm = 0.0008;
    overlap.rms_mm = 0.012;
    overlap.normalised = 1.1;
    overlap.not_seen = {"axial", "roll"};
    for (int i = 0; i < 24; ++i) {
      overlap.cells.push_back(
          {{400.0 * k + 400.0 + 60.0 * (i % 4), 80.0 * (i / 4) - 200.0, 2140.0}, 0.004 * normal(random), 0.003});
    }
  }
  for (int id = 1; id <= 6; ++id) {
    base::StitchedMarker& marker = result.markers.emplace_back();
    marker.id = id;
    marker.xyz_mm = {150.0 * id, id % 2 == 0 ? 200.0 : -200.0, 2140.0};
    marker.cov_mm2 = Eigen::Matrix3d::Identity() * 1e-4;
    marker.stations = {id / 3, std::min(2, id / 3 + 1)};
    marker.max_w = 1.2;
    marker.in_reference = id != 3;
    if (marker.in_reference) marker.reference_residual_mm = vector(0.01);
  }
  result.rejected.push_back(
      {1, 7, "it lies 4.20 mm from where station 'x0000' has it: the marker was moved in between, or misread", 4.2, 0.0});
  result.rejected.push_back({-1, 3, "its place in the list is off", 0.2, 8.0});
  for (int k = 1; k < 3; ++k) {
    result.drift.push_back({0,
                            k,
                            400.0 * k,
                            {0.01, 0.012, 0.008},
                            {0.02 * k, 0.05 * k, k == 1 ? 0.03 : std::numeric_limits<double>::quiet_NaN()}});
  }
  result.iterations = {{1300, 0.02, 0.015}, {1302, 1e-4, 0.012}};
  result.machine_from_part = base::Pose{Eigen::Quaterniond::Identity(), {1.0, 2.0, 3.0}};
  result.machine_from_part_cov.diagonal().setConstant(1e-6);
  result.marker_ratio = 0.9;
  result.reference_ratio = 1.1;
  result.calibration_shift = 0.4;
  result.observations = 1500;
  result.unknowns = 60;
  result.redundancy = 1440;
  const Eigen::Index size = 18 + parameters;
  Eigen::MatrixXd root = Eigen::MatrixXd::NullaryExpr(size, size, [&] { return 1e-4 * normal(random); });
  result.covariance = root * root.transpose();
  for (Eigen::Index i = 0; i < size; ++i) result.labels.push_back(fmt::format("parameter {} [mm]", i + 1));
  for (Eigen::Index k = 0; k < 3; ++k)
    result.stations[static_cast<std::size_t>(k)].cov = result.covariance.block<6, 6>(6 * k, 6 * k);
  result.head->cov = result.covariance.bottomRightCorner(parameters, parameters);
  return result;
}

/// A merged cloud as the merger makes it.
inline base::Cloud synthetic_merged_cloud() {
  base::Cloud cloud;
  cloud.frame = "machine";
  std::vector<double> stations, difference;
  for (int i = 0; i < 40; ++i) {
    for (int k = 0; k < 20; ++k) {
      cloud.points.emplace_back(30.0 * i, 20.0 * k - 200.0, 2140.0);
      cloud.normals.emplace_back(0.0, 0.0, 1.0);
      cloud.cov_mm2.emplace_back(Eigen::Matrix3d::Identity() * 1e-4);
      stations.push_back(1.0 + (i % 13 < 5 ? 1.0 : 0.0));
      difference.push_back(i % 13 < 5 ? 0.1 * k - 1.0 : 0.0);
    }
  }
  cloud.fields.push_back({"stations", std::move(stations)});
  cloud.fields.push_back({"difference", std::move(difference)});
  return cloud;
}

}  // namespace crosstie::tests
