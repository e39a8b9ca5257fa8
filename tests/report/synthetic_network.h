#pragma once

#include <cmath>
#include <random>
#include <string>

#include <Eigen/Geometry>

#include "base/network.h"
#include "report/context.h"

namespace crosstie::tests {

/// A cross of 44 points seen by two cameras in 24 images, with residuals and covariances drawn at random: a network to be
/// shown, not one that was adjusted.
inline base::AdjustedNetwork synthetic_network(unsigned seed = 1) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  base::AdjustedNetwork network;
  network.datum = "inner constraints";
  network.scale = "scale bars";
  for (const char* name : {"left", "right"}) {
    Eigen::VectorXd parameters(9);
    parameters << 2096.2 + 3.0 * normal(random), 2096.0, 986.9, 664.6, -0.11, 0.13, 2e-5, -4e-4, -0.02;
    auto camera = base::Camera::make(base::LensModel::kOpenCv5, 2000, 1333, parameters);
    Eigen::VectorXd sigma(9);
    sigma << 0.31, 0.30, 0.42, 0.38, 2.1e-4, 1.6e-3, 1.1e-5, 1.2e-5, 3.4e-3;
    Eigen::MatrixXd correlation = Eigen::MatrixXd::Identity(9, 9);
    for (const auto& [i, j, r] : {std::tuple(0, 1, 0.97), std::tuple(4, 5, -0.93), std::tuple(5, 8, -0.985),
                                  std::tuple(4, 8, 0.87), std::tuple(2, 7, 0.71), std::tuple(3, 6, 0.64)}) {
      correlation(i, j) = correlation(j, i) = r;
    }
    camera->set_covariance(sigma.asDiagonal() * correlation * sigma.asDiagonal());
    network.cameras.push_back({name, *camera, true, 0.81, Eigen::VectorXd::Constant(9, std::nan(""))});
    network.cameras.back().significance_p.tail<5>() << 1e-30, 2e-12, 0.069, 3e-9, 0.0417;
  }
  for (int id = 2; id < 46; ++id) {
    base::AdjustedPoint point;
    point.id = id;
    const double along = -500.0 + 1000.0 * ((id - 2) % 22) / 21.0;
    point.xyz_mm = id < 24 ? Eigen::Vector3d(along, 18.0 * normal(random), 30.0 * unit(random))
                           : Eigen::Vector3d(18.0 * normal(random), 0.7 * along, 30.0 * unit(random));
    const Eigen::Vector3d sigma = (1.0 + 1.5 * std::abs(along) / 500.0) * Eigen::Vector3d(0.0019, 0.0021, 0.0046);
    const Eigen::Matrix3d turn = Eigen::AngleAxisd(0.4 * normal(random), Eigen::Vector3d::UnitX()).toRotationMatrix();
    point.cov_mm2 = turn * sigma.cwiseAbs2().asDiagonal() * turn.transpose();
    point.angle_rad = 1.2 + 0.2 * normal(random);
    network.points.push_back(point);
  }
  for (int i = 0; i < 24; ++i) {
    base::AdjustedImage image;
    image.name = std::string(i < 12 ? "left_" : "right_") + (i % 12 < 10 ? "0" : "") + std::to_string(i % 12);
    image.camera = i < 12 ? "left" : "right";
    const double around = 2.0 * M_PI * i / 12.0;
    const Eigen::Vector3d centre(800.0 * std::cos(around) + (i < 12 ? 0.0 : 200.0), 500.0 * std::sin(around),
                                 1300.0 + 60.0 * normal(random));
    const Eigen::Vector3d forward = -centre.normalized();
    const Eigen::Vector3d right = Eigen::Vector3d(0.0, 1.0, 0.0).cross(-forward).normalized();
    Eigen::Matrix3d rotation;
    rotation << right, forward.cross(right), forward;
    const Eigen::AngleAxisd roll(i % 3 == 1 ? M_PI / 2.0 : 0.0, Eigen::Vector3d::UnitZ());
    image.network_from_camera = {Eigen::Quaterniond(Eigen::Matrix3d(rotation * roll)), centre};
    base::Vector6d sigma;
    sigma << 2e-5, 2e-5, 3e-5, 0.012, 0.012, 0.02;
    image.cov = sigma.cwiseAbs2().asDiagonal();
    const auto& camera = network.cameras[i < 12 ? 0 : 1].camera;
    double sum = 0.0;
    for (int p = 0; p < static_cast<int>(network.points.size()); ++p) {
      const auto pixel =
          camera.project(image.network_from_camera.inverse() * network.points[static_cast<std::size_t>(p)].xyz_mm);
      if (!pixel || pixel->x() < 20.0 || pixel->y() < 20.0 || pixel->x() > 1980.0 || pixel->y() > 1313.0) continue;
      base::AdjustedObservation one;
      one.image = i;
      one.point = p;
      one.measured_px = *pixel;
      one.sigma_px.setConstant(0.014 + 0.004 * unit(random));
      one.redundancy.setConstant(0.83 + 0.08 * unit(random));
      for (int axis = 0; axis < 2; ++axis) {
        one.residual_px(axis) = 1.04 * normal(random) * one.sigma_px(axis) * std::sqrt(one.redundancy(axis));
      }
      one.w = one.residual_px.norm() / (one.sigma_px.x() * std::sqrt(2.0 * one.redundancy.x()));
      auto& point = network.points[static_cast<std::size_t>(p)];
      ++point.rays;
      point.rms_px += one.residual_px.squaredNorm();
      point.max_w = std::max(point.max_w, one.w);
      point.max_px = std::max(point.max_px, one.residual_px.norm());
      point.least_redundancy = point.rays == 1 ? one.redundancy.x() : std::min(point.least_redundancy, one.redundancy.x());
      image.max_px = std::max(image.max_px, one.residual_px.norm());
      sum += one.residual_px.squaredNorm();
      ++image.rays;
      network.residuals.push_back(one);
    }
    image.rms_px = std::sqrt(sum / std::max(1, image.rays));
    image.coverage = 0.37;
    network.rms_px += sum;
    network.images.push_back(image);
  }
  for (auto& point : network.points) point.rms_px = std::sqrt(point.rms_px / std::max(1, point.rays));
  network.rms_px = std::sqrt(network.rms_px / static_cast<double>(network.residuals.size()));
  network.observations = 2 * static_cast<int>(network.residuals.size()) + 1;
  network.unknowns = 2 * 9 + 6 * 24 + 3 * 44;
  network.conditions = 6;
  network.redundancy = network.observations - network.unknowns + network.conditions;
  network.observed = {2 * static_cast<int>(network.residuals.size()), 1, 0, 0};
  network.estimated = {2 * 9, 6 * 24, 0, 3 * 44};
  network.structural_rank = network.unknowns;
  network.rank = network.unknowns - network.conditions;
  network.least_eigenvalue = 4e-6;
  network.weakest = "camera left k2, camera left k3";
  network.last_step = 3.1e-12;
  network.sigma0 = 1.04;
  network.sigma0_px = 0.0159;
  network.chi2_p = 0.021;
  network.iterations = 9;
  network.scale_bars.push_back(
      {{2, 23, 1000.0184, 0.004, 23.5, 1.2e-6, base::ScaleBarRole::kUsed, "K-1187"}, 1000.0221, 0.0031, 0.61});
  network.scale_bars.push_back(
      {{24, 45, 700.1107, 0.004, 23.5, 1.2e-6, base::ScaleBarRole::kCheck, "K-1188"}, 700.1049, 0.0035, -1.2});
  base::AdjustedRig rig{"head", 12, {{"left", {}, base::Matrix6d::Zero()}}};
  base::AdjustedMount mount{"right",
                            {Eigen::Quaterniond(Eigen::AngleAxisd(-0.31, Eigen::Vector3d::UnitY())), {412.5078, 3.1, 61.2}}};
  base::Vector6d mount_sigma;
  mount_sigma << 2e-5, 2e-5, 3e-5, 0.012, 0.014, 0.02;
  mount.cov = mount_sigma.cwiseAbs2().asDiagonal();
  rig.mounts.push_back(mount);
  network.rigs.push_back(rig);
  network.control.push_back({7, {0.0123, -0.0045, 0.0}, {0.01, 0.01, 0.0}, 4.2});
  network.rejected.push_back({"left_04", 31, "blunder", 18.4});
  network.rejected.push_back({"right_07", 72, "moved between images", 212.0});
  network.rejected.push_back({"right_09", 9, "one ray only", 0.0});
  network.warnings.push_back({"few_rays", "45", "point 45 has only 3 rays; photograph it from more sides"});
  return network;
}

inline report::ReportContext synthetic_context(const std::string& verb) {
  report::ReportContext context;
  context.title = "Bundle adjustment";
  context.job = "calibration cross, portal 3";
  context.envelope.verb = verb;
  context.envelope.frame = "network";
  context.envelope.inputs = {{"net/left_00.png", std::string(64, 'a')}, {"net/scale_bars.csv", std::string(64, 'b')}};
  context.envelope.verdicts = {
      {"sigma0", 1.04, 1.2, "", "default: the detector's sigmas hold to 20 %", base::VerdictLevel::kOk},
      {"largest sigma of a point", 0.0112, 0.012, "mm", "job", base::VerdictLevel::kWarning},
      {"rejected share", 0.3, 3.0, "%", "default: mrcal's advice", base::VerdictLevel::kOk}};
  context.options_json = "{\n  \"max_iterations\": 50,\n  \"note\": \"a < b & c\"\n}";
  return context;
}

}  // namespace crosstie::tests
