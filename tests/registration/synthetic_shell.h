#pragma once

#include <cmath>
#include <cstdint>
#include <functional>
#include <numbers>
#include <random>
#include <vector>

#include <Eigen/Cholesky>
#include <Eigen/Geometry>

#include "base/cloud.h"
#include "base/pose.h"
#include "registration/stitch.h"

namespace crosstie::tests {

/// A part of a tower's shell that the head scans from outside: x along the axis, the surface at radius R.
struct Shell {
  double radius_mm = 2150.0;

  /// Place at `along` (axis) and `arc` (round it) [mm].
  [[nodiscard]] Eigen::Vector3d at(double along, double arc) const {
    const double angle = arc / radius_mm;
    return {along, radius_mm * std::sin(angle), radius_mm * std::cos(angle)};
  }
  [[nodiscard]] Eigen::Vector3d normal(double arc) const { return {0.0, std::sin(arc / radius_mm), std::cos(arc / radius_mm)}; }
};

/// What a station looks at.
struct Window {
  double along_mm = 0.0;  ///< its middle
  double arc_mm = 0.0;
  double length_mm = 900.0;
  double height_mm = 700.0;
};

class Scanner {
 public:
  explicit Scanner(std::uint64_t seed) : random_(seed) {}

  double normal() { return normal_(random_); }
  double uniform(double from, double to) { return std::uniform_real_distribution<double>(from, to)(random_); }
  Eigen::Vector3d normal3(double sigma) {
    const double x = normal();
    const double y = normal();
    const double z = normal();
    return sigma * Eigen::Vector3d(x, y, z);
  }

  /// A head 1300 mm before the window's middle, turned at random: no scan shares its axes with another.
  base::Pose pose(const Shell& shell, const Window& window) {
    const Eigen::Vector3d off = normal3(20.0);
    const Eigen::Quaterniond turn = Eigen::Quaterniond(normal(), normal(), normal(), normal()).normalized();
    return {turn, shell.at(window.along_mm, window.arc_mm) + 1300.0 * shell.normal(window.arc_mm) + off};
  }

  /// About `count` points on a grid that is turned, shifted and shaken at random, with noise along the normal; places for which
  /// `material` is false are left out.
  base::Cloud cloud(const Shell& shell, const Window& window, const base::Pose& machine_from_rig, int count, double sigma_mm,
                    const std::function<bool(double along, double arc)>& material = {}) {
    const double spacing = std::sqrt(window.length_mm * window.height_mm / count);
    const double turn = uniform(0.0, std::numbers::pi);
    const Eigen::Vector2d shift(uniform(0.0, spacing), uniform(0.0, spacing));
    const int half = static_cast<int>(std::hypot(window.length_mm, window.height_mm) / spacing);
    const base::Pose rig_from_machine = machine_from_rig.inverse();
    base::Cloud cloud;
    cloud.frame = "rig";
    for (int i = -half; i <= half; ++i) {
      for (int k = -half; k <= half; ++k) {
        const double u = spacing * (i + uniform(-0.3, 0.3)) + shift.x();
        const double v = spacing * (k + uniform(-0.3, 0.3)) + shift.y();
        const double along = u * std::cos(turn) - v * std::sin(turn);
        const double arc = u * std::sin(turn) + v * std::cos(turn);
        if (std::abs(along) > window.length_mm / 2.0 || std::abs(arc) > window.height_mm / 2.0) continue;
        if (material && !material(window.along_mm + along, window.arc_mm + arc)) continue;
        const double error = sigma_mm * normal();
        cloud.points.push_back(rig_from_machine * (shell.at(window.along_mm + along, window.arc_mm + arc) +
                                                   error * shell.normal(window.arc_mm + arc)));
      }
    }
    return cloud;
  }

  registration::Sighting sighting(int id, const Eigen::Vector3d& p_in_machine, const base::Pose& machine_from_rig,
                                  double sigma_mm) {
    return {id, machine_from_rig.inverse() * p_in_machine + normal3(sigma_mm),
            sigma_mm * sigma_mm * Eigen::Matrix3d::Identity()};
  }

 private:
  std::mt19937_64 random_;
  std::normal_distribution<double> normal_;
};

}  // namespace crosstie::tests
