#pragma once

// Corners of a board whose shape is drawn from its prior, seen by one or two cameras: exact projections by a formula written for this
// purpose, and noise. Nothing of the code under test takes part, but for the nouns and the fields of the board's modes.

#include <cmath>
#include <random>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "calib/calibrate.h"

namespace crosstie::tests {

struct TrueCamera {
  int width = 1920;
  int height = 1200;
  /// fx fy cx cy k1 k2 p1 p2 k3
  std::vector<double> lens = {1500.0, 1502.0, 950.0, 610.0, -0.21, 0.09, 4e-4, -3e-4, -0.01};
  double ripple_px = 0.0;                                  ///< of a wave over the image that no polynomial follows
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();  ///< camera_from_rig
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();   ///< mm

  [[nodiscard]] Eigen::Vector2d project(const Eigen::Vector3d& p_in_camera) const {
    const double x = p_in_camera.x() / p_in_camera.z();
    const double y = p_in_camera.y() / p_in_camera.z();
    const double r2 = x * x + y * y;
    const double radial = 1.0 + lens[4] * r2 + lens[5] * r2 * r2 + (lens.size() > 8 ? lens[8] : 0.0) * r2 * r2 * r2;
    const double u = x * radial + 2.0 * lens[6] * x * y + lens[7] * (r2 + 2.0 * x * x);
    const double v = y * radial + lens[6] * (r2 + 2.0 * y * y) + 2.0 * lens[7] * x * y;
    const double wave = ripple_px * std::sin(14.0 * x) * std::cos(11.0 * y);
    return {lens[0] * u + lens[2] + wave, lens[1] * v + lens[3] - wave};
  }
  [[nodiscard]] bool shows(const Eigen::Vector2d& pixel) const {
    return pixel.x() > 5.0 && pixel.y() > 5.0 && pixel.x() < width - 6.0 && pixel.y() < height - 6.0;
  }
};

struct TrueScene {
  base::Board board;
  std::vector<TrueCamera> cameras;
  Eigen::Matrix3Xd points;                  ///< of this board
  std::vector<base::Pose> left_from_board;  ///< of every station
  calib::BoardViews views;
};

struct SceneOptions {
  int stations = 16;
  double sigma_px = 0.05;
  std::uint64_t seed = 1;
  bool two_cameras = true;
  double distance_mm = 1300.0;
  double tilt_rad = 0.6;  ///< at most, about either axis
  bool roll = true;
  double ripple_px = 0.0;
};

inline base::Board scene_board() {
  base::Board board{.columns = 10, .rows = 7, .pitch_mm = 55.0};
  board.prior = {0.05, 0.15, 200.0};
  return board;
}

inline TrueScene make_scene(const base::Board& board, const SceneOptions& options) {
  std::mt19937_64 random(options.seed);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  TrueScene scene;
  scene.board = board;
  TrueCamera left;
  TrueCamera right;
  right.lens = {1497.0, 1496.0, 968.0, 590.0, -0.22, 0.10, -5e-4, 2e-4, -0.02};
  right.rotation = Eigen::AngleAxisd(0.30, Eigen::Vector3d(0.02, 0.9995, 0.03).normalized()).toRotationMatrix();
  right.translation = right.rotation * Eigen::Vector3d(-400.0, 4.0, 6.0);
  left.ripple_px = right.ripple_px = options.ripple_px;
  scene.cameras.push_back(left);
  if (options.two_cameras) scene.cameras.push_back(right);

  scene.points = board.nominal_points();
  if (board.free) {
    for (const base::BoardMode& mode : board.modes()) scene.points += mode.sigma * normal(random) * mode.displacement;
    for (double& value : scene.points.reshaped()) value += board.prior.sigma_mm * normal(random);
  }
  scene.views.board = board;
  scene.views.cameras = options.two_cameras ? std::vector<std::string>{"left", "right"} : std::vector<std::string>{"left"};
  const Eigen::Vector3d middle(options.two_cameras ? 190.0 : 0.0, 0.0, options.distance_mm);
  for (int s = 0; s < options.stations; ++s) {
    const double roll = options.roll ? 1.57 * static_cast<double>(s % 4) + 0.2 * uniform(random) : 0.05 * uniform(random);
    const Eigen::Matrix3d turn = (Eigen::AngleAxisd(options.tilt_rad * uniform(random), Eigen::Vector3d::UnitX()) *
                                  Eigen::AngleAxisd(options.tilt_rad * uniform(random), Eigen::Vector3d::UnitY()) *
                                  Eigen::AngleAxisd(roll, Eigen::Vector3d::UnitZ()))
                                     .toRotationMatrix();
    const Eigen::Vector3d place =
        middle + 0.25 * options.distance_mm * Eigen::Vector3d(uniform(random), 0.6 * uniform(random), 0.6 * uniform(random));
    scene.left_from_board.push_back({Eigen::Quaterniond(turn), place});
    for (std::size_t c = 0; c < scene.cameras.size(); ++c) {
      const TrueCamera& camera = scene.cameras[c];
      base::BoardImage image{
          (c == 0 ? "left" : "right") + std::to_string(100 + s), scene.views.cameras[c], camera.width, camera.height, {}};
      for (Eigen::Index i = 0; i < scene.points.cols(); ++i) {
        const Eigen::Vector3d p_in_rig = turn * scene.points.col(i) + place;
        const Eigen::Vector2d pixel = camera.project(camera.rotation * p_in_rig + camera.translation);
        const Eigen::Vector2d noise(options.sigma_px * normal(random), options.sigma_px * normal(random));
        if (camera.shows(pixel)) image.corners.push_back({static_cast<int>(i), pixel + noise, 0.0});
      }
      scene.views.images.push_back(std::move(image));
    }
  }
  return scene;
}

}  // namespace crosstie::tests
