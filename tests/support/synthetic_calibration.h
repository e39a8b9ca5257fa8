#pragma once

#include <array>
#include <cmath>
#include <random>
#include <string>

#include <fmt/format.h>
#include <Eigen/Geometry>

#include "base/calibration.h"

namespace crosstie::tests {

inline base::Camera calibrated_camera(double shift_px) {
  Eigen::VectorXd parameters(9);
  parameters << 1053.2 + shift_px, 1053.0 + shift_px, 639.1 - shift_px, 513.7, -0.0912, 0.1134, 2.1e-4, -3.9e-4, -0.021;
  auto camera = base::Camera::make(base::LensModel::kOpenCv5, 1280, 1024, parameters);
  Eigen::VectorXd sigma(9);
  sigma << 0.21, 0.20, 0.32, 0.38, 2.1e-4, 1.6e-3, 1.1e-5, 1.2e-5, 3.4e-3;
  Eigen::MatrixXd correlation = Eigen::MatrixXd::Identity(9, 9);
  for (const auto& [i, j, r] :
       {std::tuple(0, 1, 0.97), std::tuple(4, 5, -0.93), std::tuple(5, 8, -0.985), std::tuple(4, 8, 0.87)})
    correlation(i, j) = correlation(j, i) = r;
  camera->set_covariance(sigma.asDiagonal() * correlation * sigma.asDiagonal());
  return *camera;
}

/// Two cameras 120 mm apart that saw a board of 11 x 8 corners at 14 moments, with residuals drawn at random: a calibration to be
/// shown and written, not one that was computed.
inline base::Calibration synthetic_calibration(unsigned seed = 1) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  base::Calibration result;
  result.sigma0_px = 0.061;
  result.sigma0 = 1.0;
  for (const char* name : {"left", "right"}) {
    base::CalibratedCamera camera{.name = name, .camera = calibrated_camera(name[0] == 'l' ? 0.0 : 2.0)};
    camera.rms_heldout_px = 0.097;
    camera.temperature_c = 31.5;
    camera.area = {1280, 1024};
    camera.significance_p = Eigen::VectorXd::Constant(9, std::nan(""));
    camera.significance_p.tail<5>() << 1e-30, 2e-12, 0.069, 3e-9, 0.0417;
    camera.correlations = {{"k2", "k3", -0.985}};
    result.cameras.push_back(std::move(camera));
  }
  base::CalibratedRig rig{.left = "left", .right = "right", .right_from_left = {}, .stations = 14};
  rig.right_from_left = {Eigen::Quaterniond(Eigen::AngleAxisd(-0.12, Eigen::Vector3d::UnitY())), {-119.3, 0.8, 9.1}};
  base::Vector6d rig_sigma;
  rig_sigma << 4e-5, 5e-5, 2e-5, 0.021, 0.017, 0.043;
  rig.cov = rig_sigma.cwiseAbs2().asDiagonal();
  rig.baseline_mm = rig.right_from_left.translation_mm.norm();
  rig.baseline_sigma_mm = 0.022;
  result.rig = rig;

  base::Board board;
  board.columns = 11;
  board.rows = 8;
  board.pitch_mm = 19.0;
  board.certificate = {"B-17", base::parse_date("2025-03-01").value(), base::parse_date("2027-03-01").value()};
  result.board.board = board.with_default_prior();
  result.board.points = board.nominal_points();
  result.board.sigma = Eigen::Matrix3Xd::Constant(3, board.count(), 0.012);
  for (const base::BoardMode& mode : result.board.board.modes()) {
    const double value = 0.4 * mode.sigma * normal(random);
    result.board.points += value * mode.displacement;
    result.board.modes.push_back({mode.name, mode.unit, mode.sigma, value, 0.2 * mode.sigma});
  }
  for (Eigen::Index i = 0; i < result.board.points.cols(); ++i) {
    for (int k = 0; k < 3; ++k) result.board.points(k, i) += 0.02 * normal(random);
  }
  result.board.bend_rms_mm = 0.11;
  result.board.in_plane_rms_mm = 0.024;
  result.board.prior_ratio = 0.31;

  for (int s = 0; s < 14; ++s) {
    base::CalibratedStation station{fmt::format("{:02}", s + 1), true, {}};
    const Eigen::AngleAxisd tilt(0.15 + 0.05 * (s % 7), Eigen::Vector3d(std::cos(1.3 * s), std::sin(1.3 * s), 0.0));
    const Eigen::AngleAxisd roll(s % 4 == 3 ? M_PI / 2.0 : 0.0, Eigen::Vector3d::UnitZ());
    const base::Pose left_from_board{Eigen::Quaterniond(Eigen::Matrix3d(tilt * roll)),
                                     {60.0 + 90.0 * normal(random), 70.0 * normal(random), 420.0 + 25.0 * (s % 5)}};
    station.board_from_rig = left_from_board.inverse();
    for (std::size_t c = 0; c < 2; ++c) {
      base::CalibratedCamera& camera = result.cameras[c];
      const base::Pose camera_from_board = c == 0 ? left_from_board : rig.right_from_left * left_from_board;
      base::CalibratedView view{.image = fmt::format("{}_{:02}", camera.name, s + 1),
                                .camera = camera.name,
                                .station = s,
                                .board_from_camera = camera_from_board.inverse()};
      view.distance_mm = camera_from_board.translation_mm.norm();
      view.tilt_rad = tilt.angle();
      for (int p = 0; p < board.count(); ++p) {
        const auto pixel = camera.camera.project(camera_from_board * result.board.points.col(p));
        if (!pixel || pixel->minCoeff() < 4.0 || pixel->x() > 1275.0 || pixel->y() > 1019.0) continue;
        base::CalibrationResidual one;
        one.view = static_cast<int>(result.views.size());
        one.corner = p;
        one.measured_px = *pixel;
        one.sigma_px = result.sigma0_px;
        one.residual_px = result.sigma0_px * Eigen::Vector2d(normal(random), normal(random));
        one.w = one.residual_px.norm() / one.sigma_px / std::sqrt(2.0);
        camera.area.add(*pixel);
        ++camera.corners;
        ++view.corners;
        view.rms_px += one.residual_px.squaredNorm();
        view.max_px = std::max(view.max_px, one.residual_px.norm());
        camera.rms_px += one.residual_px.squaredNorm();
        result.rms_px += one.residual_px.squaredNorm();
        result.residuals.push_back(one);
      }
      view.rms_px = std::sqrt(view.rms_px / std::max(1, view.corners));
      ++camera.views;
      result.views.push_back(std::move(view));
    }
    result.stations.push_back(std::move(station));
  }
  for (base::CalibratedCamera& camera : result.cameras) camera.rms_px = std::sqrt(camera.rms_px / camera.corners);
  result.rms_px = std::sqrt(result.rms_px / static_cast<double>(result.residuals.size()));
  result.rejected = {{"left_03", 17, "blunder: it lies too far from where all others expect it", 6.3},
                     {"right_15", -1, "the board was not found in it", 0.0}};
  result.views[4].rejected = 1;
  result.observations = 2 * static_cast<int>(result.residuals.size());
  result.unknowns = 18 + 6 + 14 * 6;
  result.redundancy = result.observations - result.unknowns;
  result.iterations = 9;
  result.weakest = "board bend 20 and camera left cx";
  result.least_eigenvalue = 3e-5;

  base::CrossValidation validation;
  validation.halves = {{"odd", 7, {0.098, 0.096}, 119.62, 0.034}, {"even", 7, {0.097, 0.099}, 119.66, 0.036}};
  for (int fold = 1; fold <= 5; ++fold)
    validation.folds.push_back({fmt::format("{} of 5", fold), 11, {0.094 + 0.002 * fold, 0.098}, 119.6 + 0.01 * fold, 0.025});
  validation.baseline_gap_mm = 0.04;
  validation.baseline_gap_sigma_mm = 0.031;
  validation.model_difference_px = {0.061, 0.084};
  validation.model_difference_predicted_px = {0.052, 0.055};
  result.validation = validation;
  result.ladder = {{base::LensModel::kOpenCv4, 0.0901, 0.1033, 2.1, false, ""},
                   {base::LensModel::kOpenCv5, 0.0862, 0.0974, 0.0, true, ""},
                   {base::LensModel::kOpenCv8, 0.0860, 0.0981, 0.4, false, ""}};
  result.detectors = {{"classic", 28, 2464, 0.0, 0.0862, {1053.2, 1055.2}, 119.65, true, ""},
                      {"sb", 27, 2376, 0.084, 0.1121, {1053.6, 1055.9}, 119.58, false, ""}};
  base::SecondOpinion opinion;
  opinion.program = "mrcal 2.2";
  opinion.lens = base::LensModel::kOpenCv5;
  opinion.board = "rigid";
  opinion.rms_px = 0.1441;
  opinion.parameters = {result.cameras[0].camera.parameters(), result.cameras[1].camera.parameters()};
  opinion.right_from_left = rig.right_from_left;
  opinion.baseline_mm = rig.baseline_mm - 0.051;
  opinion.our_rms_px = 0.1441;
  opinion.our_focal_px = {1053.2004, 1055.1998};
  opinion.our_baseline_mm = rig.baseline_mm - 0.0512;
  opinion.rejected = 3;
  result.second_opinion = opinion;
  result.warnings = {{"high_correlation", "left", "camera left: k2-k3 -0.985"}};

  for (const base::CalibratedCamera& camera : result.cameras) {
    for (std::size_t i = 0; i < 9; ++i) {
      const auto name = base::parameter_names(base::LensModel::kOpenCv5)[i];
      const auto unit = base::parameter_units(base::LensModel::kOpenCv5)[i];
      result.labels.push_back(unit.empty() ? fmt::format("camera {} {}", camera.name, name)
                                           : fmt::format("camera {} {} [{}]", camera.name, name, unit));
    }
  }
  for (const char* part : {"rx [rad]", "ry [rad]", "rz [rad]", "tx [mm]", "ty [mm]", "tz [mm]"})
    result.labels.push_back(fmt::format("rig {}", part));
  result.covariance = Eigen::MatrixXd::Zero(24, 24);
  result.covariance.block<9, 9>(0, 0) = result.cameras[0].camera.covariance();
  result.covariance.block<9, 9>(9, 9) = result.cameras[1].camera.covariance();
  result.covariance.block<6, 6>(18, 18) = rig.cov;
  // A focal length that is too long sees the cameras too far apart.
  result.covariance(0, 21) = result.covariance(21, 0) = 0.3 * 0.21 * 0.021;
  return result;
}

}  // namespace crosstie::tests
