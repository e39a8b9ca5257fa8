#pragma once

#include <cmath>
#include <random>

#include <fmt/format.h>

#include "base/machine.h"
#include "tests/support/synthetic_calibration.h"

namespace crosstie::tests {

/// A head that saw a cross of 12 markers and four balls from five stations over a metre, with residuals drawn at random: a
/// commissioning to be shown and written, not one that was computed.
inline base::Commissioning synthetic_commissioning(unsigned seed = 1) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  const auto vector = [&](double sigma) {
    return Eigen::Vector3d(sigma * normal(random), sigma * normal(random), sigma * normal(random));
  };
  const base::Calibration calibration = synthetic_calibration(seed);
  base::Commissioning result{.head = {.left_name = "left",
                                      .right_name = "right",
                                      .left = calibration.cameras[0].camera,
                                      .right = calibration.cameras[1].camera,
                                      .right_from_left = calibration.rig->right_from_left,
                                      .cov = 0.5 * calibration.covariance,
                                      .temperature_c = 31.0}};
  result.baseline_mm = result.head.right_from_left.translation_mm.norm();
  result.baseline_sigma_mm = 0.015;
  base::LinearAxis& axis = result.frame.axis;
  axis.direction_in_machine = Eigen::Vector3d(1.0, 4e-4, -2e-4).normalized();
  axis.direction_cov.diagonal() << 0.0, 4e-10, 9e-10;
  axis.scale_ppm = 48.0;
  axis.scale_sigma_ppm = 12.0;
  axis.scale_p = 6e-5;
  axis.scale_significant = true;
  axis.from_mm = -100.0;
  axis.to_mm = 900.0;
  axis.reading_sigma_mm = 0.005;
  axis.terms = {{"EXX", 2, false, 0.003, 0.004, 0.45, false},
                {"EYX", 2, false, 0.031, 0.005, 6e-10, true, true, 0.031},
                {"EZX", 2, false, -0.002, 0.006, 0.74, false, true, -0.0004},
                {"EAX", 1, true, 4e-6, 6e-6, 0.5, false},
                {"EBX", 1, true, 2.5e-5, 4e-6, 4e-10, true, true, 2.5e-5},
                {"ECX", 1, true, -1e-6, 5e-6, 0.84, false}};
  result.frame.machine_from_rig_at_middle = {
      Eigen::Quaterniond(Eigen::AngleAxisd(3.0, Eigen::Vector3d(1.0, 0.02, 0.01).normalized())), {400.0, 12.0, 1300.0}};
  result.frame.across << 4e-4, 2e-4, -1.0, 0.0, 0.0, 1.0;
  base::Matrix6d pose_cov = base::Matrix6d::Zero();
  pose_cov.diagonal() << 4e-10, 4e-10, 9e-10, 1e-4, 1e-4, 4e-4;
  result.frame.cov = Eigen::MatrixXd::Zero(12, 12);
  result.frame.cov.topLeftCorner<6, 6>() = pose_cov;
  result.frame.cov.diagonal().tail<6>() << 4e-10, 9e-10, 144.0, 2.5e-5, 1.6e-5, 1.6e-11;
  result.machine_from_rig_at_zero = *result.frame.at(0.0);
  result.zero_in_travel = true;
  result.machine_from_cross = {Eigen::Quaterniond::Identity(), {350.0, 20.0, 5.0}};
  result.machine_from_cross_cov.diagonal() << 1e-10, 1e-10, 2e-10, 5e-5, 5e-5, 6e-5;
  result.growth_ppm = 47.0;
  result.growth_sigma_ppm = 5.0;
  result.growth_stated_ppm = 46.0;
  result.growth_stated_sigma_ppm = 6.0;
  for (int id = 1; id <= 4; ++id) {
    base::CommissionedSphere& sphere = result.spheres.emplace_back();
    sphere.id = id;
    sphere.centre_mm = {350.0 + (id % 2 == 0 ? 700.0 : -700.0), id < 3 ? 500.0 : -500.0, 20.0};
    sphere.cov_mm2 = Eigen::Matrix3d::Identity() * 1.4e-4;
    sphere.residual_mm = vector(0.012);
    sphere.sigma_mm.setConstant(0.02);
    sphere.w = sphere.residual_mm.norm() / 0.02 / std::sqrt(3.0);
    sphere.left_out_mm = vector(0.04);
    sphere.left_out_sigma_mm.setConstant(0.04);
    result.fre_mm += sphere.residual_mm.squaredNorm() / 4.0;
  }
  result.fre_mm = std::sqrt(result.fre_mm);
  result.sphere_scale_ppm = 9.0;
  result.sphere_scale_sigma_ppm = 14.0;
  for (int id = 1; id <= 12; ++id)
    result.markers.push_back({id, 8, {100.0 * id, 50.0 * (id % 5), 0.0}, vector(0.004), Eigen::Vector3d::Constant(0.01)});
  for (int s = 0; s < 5; ++s) {
    const double reading = axis.from_mm + 250.0 * s;
    const base::HeadPose pose = *result.frame.at(reading);
    result.checked_at.push_back(pose);
    base::CommissionedStation& station = result.stations.emplace_back();
    station.name = fmt::format("x{:04}", s);
    station.axis_mm = reading;
    station.machine_from_rig = pose.machine_from_rig;
    station.cov = pose.cov + pose.stop_cov;
    station.off_axis << vector(2e-6), vector(0.004);
    station.off_along_mm = station.off_axis(3);
    station.w = 0.8;
    for (const char* camera : {"left", "right"}) {
      const auto index = static_cast<int>(result.images.size());
      base::CommissionedImage image{station.name + "/" + camera, camera, s, 12, 0.0, 0.0};
      for (int id = 1; id <= 12; ++id) {
        base::CommissionedRay ray{index, id, {100.0 + 85.0 * id, 80.0 + 70.0 * ((7 * id) % 12)}, {}, {0.03, 0.03}, 0.0};
        ray.residual_px = 0.03 * Eigen::Vector2d(normal(random), normal(random));
        ray.w = ray.residual_px.norm() / 0.03 / std::sqrt(2.0);
        image.rms_px += ray.residual_px.squaredNorm() / 12.0;
        image.max_px = std::max(image.max_px, ray.residual_px.norm());
        result.residuals.push_back(ray);
      }
      image.rms_px = std::sqrt(image.rms_px);
      result.images.push_back(std::move(image));
    }
    result.tre.push_back({reading,
                          {400.0, 0.0, 1300.0},
                          pose.machine_from_rig * Eigen::Vector3d(400.0, 0.0, 1300.0),
                          Eigen::Matrix3d::Identity() * 4e-4});
  }
  result.rejected = {{"image x0002/left", 7, "blunder: it lies too far from where all others expect it", 7.2}};
  result.datum = "best fit of 4 spheres";
  result.sigma0 = 1.02;
  result.image_sigma_factor = 1.6;
  result.sigma0_px = 0.031;
  result.rms_px = 0.041;
  result.largest_eccentricity_px = 0.012;
  result.groups = {{"image points", 240, 190.0, 1.01}, {"cross", 36, 30.0, 0.9},
                   {"spheres", 12, 6.0, 0.7},          {"axis", 5, 2.0, 1.1},
                   {"calibration", 24, 10.0, 1.2},     {"temperature", 1, 0.2, 0.03}};
  result.observations = 318;
  result.unknowns = 80;
  result.redundancy = 238;
  result.chi2_p = 0.74;
  result.iterations = 6;
  result.least_eigenvalue = 2e-4;
  result.weakest = "axis direction and spheres";
  result.warnings = {{"few_spheres", "machine", "four spheres: one that is wrong shows, but not which"}};
  result.labels = calibration.labels;
  for (const char* part : {"rx [rad]", "ry [rad]", "rz [rad]", "tx [mm]", "ty [mm]", "tz [mm]"})
    result.labels.push_back(fmt::format("head at middle {}", part));
  for (const char* name : {"axis across 1 [rad]", "axis across 2 [rad]", "axis scale [ppm]", "axis EYX 2 [mm]",
                           "axis EZX 2 [mm]", "axis EBX 1 [rad]"})
    result.labels.emplace_back(name);
  result.covariance = Eigen::MatrixXd::Zero(36, 36);
  result.covariance.topLeftCorner<24, 24>() = result.head.cov;
  result.covariance.bottomRightCorner<12, 12>() = result.frame.cov;
  return result;
}

}  // namespace crosstie::tests
