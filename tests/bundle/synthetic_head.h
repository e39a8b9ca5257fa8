#pragma once

#include <cmath>
#include <random>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <Eigen/Cholesky>
#include <Eigen/Geometry>

#include "bundle/commission.h"

namespace crosstie::tests {

/// A commissioning as it might happen: a cross of 1.4 m x 1.0 m with 40 markers and a ball at each arm's end, two cameras 0.8 m apart
/// and 1.3 m from it, stations along X. All that is drawn is drawn from the sigmas that the input states. Exact projections with the
/// camera's own formula; nothing of the solver is used.
struct HeadPlan {
  int stations = 5;
  int pairs = 1;       ///< of photographs at each stop
  double depth = 1.0;  ///< factor of the heights of markers and balls: 0 is a flat cross
  double from_mm = 350.0;
  double to_mm = 1350.0;
  double image_sigma_px = 0.03;
  double sphere_sigma_mm = 0.02;
  double reading_sigma_mm = 0.003;
  double cross_sigma_mm = 0.01;
  double rig_sigma_rad = 20e-6;
  double rig_sigma_mm = 0.02;
  double focal_sigma_px = 0.3;
  double temperature_sigma_c = 0.3;
  double stop_sigma_mm = 0.0;  ///< scatter of the carriage
  double stop_sigma_rad = 0.0;
  /// Error motions over the travel, t = -1 to 1.
  double pitch_rad = 0.0;        ///< EBX, t times half of it: its range over the travel
  double straightness_mm = 0.0;  ///< EZX: parabola, peak to valley over the travel, about its own chord
  double scale_ppm = 0.0;
  Eigen::Vector3d direction = Eigen::Vector3d(1.0, 3e-4, -2e-4);
};

struct SyntheticHead {
  bundle::CommissionInput input;
  HeadPlan plan;
  base::Pose machine_from_rig_at_middle;
  base::Pose machine_from_cross;
  base::Pose right_from_left;
  base::Camera left;
  base::Camera right;
  std::vector<Eigen::Vector3d> markers;  ///< true, in cross, on the machine
  std::vector<Eigen::Vector3d> spheres;  ///< true, in machine, by id - 1

  [[nodiscard]] const Eigen::Vector3d& sphere(int id) const { return spheres[static_cast<std::size_t>(id - 1)]; }

  /// Where the head truly is, without the scatter of a stop.
  [[nodiscard]] base::Pose machine_from_rig(double s_mm) const {
    const double middle = 0.5 * (plan.from_mm + plan.to_mm);
    const double t = (s_mm - middle) / (0.5 * (plan.to_mm - plan.from_mm));
    const Eigen::Vector3d direction = plan.direction.normalized();
    Eigen::Vector3d shift = direction * (s_mm - middle) * (1.0 + 1e-6 * plan.scale_ppm);
    shift.z() += plan.straightness_mm * t * t;  // its mean belongs to the pose
    const Eigen::Quaterniond turn(Eigen::AngleAxisd(0.5 * plan.pitch_rad * t, Eigen::Vector3d::UnitY()));
    const Eigen::Vector3d pivot = direction * middle;
    return base::Pose{turn, shift + pivot - turn * pivot} * machine_from_rig_at_middle;
  }

  /// What both cameras see of the cross from a pose of the head, with noise.
  [[nodiscard]] std::vector<base::ImageObservations> photographs(const base::Pose& rig_in_machine, const std::string& name,
                                                                 const base::Pose& right_from_left_now, std::mt19937_64& random,
                                                                 double noise_px) const {
    std::normal_distribution<double> normal;
    std::vector<base::ImageObservations> pair;
    for (int c = 0; c < 2; ++c) {
      const base::Camera& camera = c == 0 ? left : right;
      base::ImageObservations image{.image = name + (c == 0 ? "_l" : "_r"),
                                    .camera = c == 0 ? "left" : "right",
                                    .family = "ring10",
                                    .width_px = camera.width_px(),
                                    .height_px = camera.height_px(),
                                    .observations = {}};
      const base::Pose camera_from_rig = c == 0 ? base::Pose{} : right_from_left_now;
      const base::Pose camera_from_cross = camera_from_rig * rig_in_machine.inverse() * machine_from_cross;
      for (std::size_t m = 0; m < markers.size(); ++m) {
        const auto px = camera.project(camera_from_cross * markers[m]);
        if (!px || px->x() < 20.0 || px->y() < 20.0 || px->x() > camera.width_px() - 20.0 ||
            px->y() > camera.height_px() - 20.0) {
          continue;
        }
        base::Observation seen;
        seen.id = static_cast<int>(m) + 1;
        seen.status = base::ObservationStatus::kCoded;
        seen.centre_px = *px + noise_px * Eigen::Vector2d(normal(random), normal(random));
        seen.cov_px2 = Eigen::Matrix2d::Identity() * plan.image_sigma_px * plan.image_sigma_px;
        image.observations.push_back(seen);
      }
      pair.push_back(std::move(image));
    }
    return pair;
  }
};

inline base::Camera head_camera(double focal_px, double cx_px) {
  Eigen::VectorXd parameters(9);
  parameters << focal_px, focal_px + 0.4, cx_px, 1502.0, -0.08, 0.05, 2e-4, -1e-4, 0.01;
  return *base::Camera::make(base::LensModel::kOpenCv5, 4096, 3000, parameters);
}

inline SyntheticHead make_head(const HeadPlan& plan, std::uint64_t seed) {
  std::mt19937_64 random(seed * 7919 + 13);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  const auto draw3 = [&](double sigma) -> Eigen::Vector3d {
    return sigma * Eigen::Vector3d(normal(random), normal(random), normal(random));
  };
  const base::Camera left = head_camera(3520.0, 2040.0);
  const base::Camera right = head_camera(3515.0, 2055.0);
  SyntheticHead head{.input = {.head = {.left = left, .right = right, .right_from_left = {}},
                               .cross = {},
                               .probed = {},
                               .stations = {},
                               .images = {}},
                     .plan = plan,
                     .machine_from_rig_at_middle = {},
                     .machine_from_cross = {},
                     .right_from_left = {},
                     .left = left,
                     .right = right,
                     .markers = {},
                     .spheres = {}};
  bundle::CommissionInput& input = head.input;
  // Stated lens and rig, the true ones drawn about them.
  const double toe_in = 0.30;
  const base::Pose left_from_right{Eigen::Quaterniond(Eigen::AngleAxisd(-2.0 * toe_in, Eigen::Vector3d::UnitY())),
                                   Eigen::Vector3d(800.0 * std::cos(toe_in), 0.0, 800.0 * std::sin(toe_in))};
  input.head.right_from_left = left_from_right.inverse();
  Eigen::VectorXd sigma(9 + 9 + 6);
  Eigen::VectorXd lens(9);
  lens << plan.focal_sigma_px, plan.focal_sigma_px, 0.3, 0.3, 2e-4, 4e-4, 1e-5, 1e-5, 3e-4;
  sigma << lens, lens, Eigen::VectorXd::Constant(3, plan.rig_sigma_rad), Eigen::VectorXd::Constant(3, plan.rig_sigma_mm);
  input.head.cov = sigma.cwiseAbs2().asDiagonal();
  Eigen::MatrixXd about = Eigen::MatrixXd::Identity(24, 24);  // sigmas of the rig are those of the right camera's own shift
  about.block<3, 3>(21, 18) = base::skew(input.head.right_from_left.translation_mm);
  input.head.cov = about * input.head.cov * about.transpose();
  Eigen::VectorXd off(24);
  for (Eigen::Index i = 0; i < 24; ++i) off(i) = sigma(i) * normal(random);
  off = about * off;
  head.left = *base::Camera::make(left.model(), 4096, 3000, left.parameters() + off.head<9>());
  head.right = *base::Camera::make(right.model(), 4096, 3000, right.parameters() + off.segment<9>(9));
  head.right_from_left = base::perturbed(input.head.right_from_left, off.tail<6>());

  // The cross: true places, the list drawn about them at 20 degrees C.
  input.cross.temperature_c = 24.0;
  input.cross.temperature_sigma_c = plan.temperature_sigma_c;
  input.cross.cte_per_k = 11.5e-6;
  input.cross.cte_sigma_per_k = 0.5e-6;
  const double growth = input.cross.growth() + input.cross.growth_sigma() * normal(random);
  std::mt19937_64 same(17);  // every cross is built alike
  const auto place = [&](double limit) { return limit * (2.0 * (static_cast<double>(same() % 10000) / 10000.0) - 1.0); };
  const auto add = [&](const Eigen::Vector3d& at_20) { return Eigen::Vector3d((1.0 + growth) * at_20); };
  for (int i = 0; i < 40; ++i) {
    Eigen::Vector3d at;
    if (i < 22) {
      at = {-650.0 + 62.0 * i, place(35.0), 40.0 + place(45.0)};
    } else {
      at = {place(35.0), -460.0 + 54.0 * (i - 22), 40.0 + place(45.0)};
    }
    at.z() *= plan.depth;
    head.markers.push_back(add(at));
    input.cross.markers.push_back({i + 1, at + draw3(plan.cross_sigma_mm),
                                   Eigen::Matrix3d(Eigen::Matrix3d::Identity() * plan.cross_sigma_mm * plan.cross_sigma_mm)});
  }
  head.machine_from_cross = {Eigen::Quaterniond(Eigen::AngleAxisd(0.02, Eigen::Vector3d(0.3, -0.5, 0.8).normalized())),
                             {850.0, 300.0, -250.0}};
  int id = 0;
  for (Eigen::Vector3d at :
       {Eigen::Vector3d(700, 0, 10), Eigen::Vector3d(0, 500, -5), Eigen::Vector3d(-700, 5, 20), Eigen::Vector3d(-5, -500, 0)}) {
    ++id;
    at.z() *= plan.depth;
    input.cross.spheres.push_back(
        {id, at + draw3(plan.cross_sigma_mm), Eigen::Matrix3d::Identity() * plan.cross_sigma_mm * plan.cross_sigma_mm, 30.0});
    head.spheres.emplace_back(head.machine_from_cross * add(at));
    input.probed.push_back({id, head.spheres.back() + draw3(plan.sphere_sigma_mm),
                            Eigen::Matrix3d::Identity() * plan.sphere_sigma_mm * plan.sphere_sigma_mm});
  }
  // The head looks along machine -Z; both cameras' axes meet in the cross's plane. Left camera at -400 mm of the middle.
  Eigen::Matrix3d looking;  // camera x = machine X, y = -Y, z = -Z
  looking << 1, 0, 0, 0, -1, 0, 0, 0, -1;
  head.machine_from_rig_at_middle = {
      Eigen::Quaterniond(looking) * Eigen::Quaterniond(Eigen::AngleAxisd(toe_in, Eigen::Vector3d::UnitY())) *
          Eigen::Quaterniond(Eigen::AngleAxisd(0.01, Eigen::Vector3d(1.0, 0.4, -0.7).normalized())),
      {850.0 - 400.0, 300.0, -250.0 + 1300.0}};
  input.reading_sigma_mm = plan.reading_sigma_mm;
  for (int k = 0; k < plan.stations; ++k) {
    const double s = plan.stations > 1 ? plan.from_mm + (plan.to_mm - plan.from_mm) * k / (plan.stations - 1) : plan.from_mm;
    base::Pose pose = head.machine_from_rig(s);
    pose.rotation = base::rotation_exp(draw3(plan.stop_sigma_rad)) * pose.rotation;
    pose.translation_mm += draw3(plan.stop_sigma_mm);
    const std::string name = fmt::format("x{:04.0f}", s);
    for (int pair = 0; pair < plan.pairs; ++pair) {
      const std::string own = pair == 0 ? name : fmt::format("{}_{}", name, pair + 1);
      for (auto& image : head.photographs(pose, own, head.right_from_left, random, plan.image_sigma_px)) {
        if (pair > 0) input.repeated.push_back({name + (image.camera == "left" ? "_l" : "_r"), image.image});
        input.images.push_back(std::move(image));
      }
    }
    input.stations.push_back({name, s + plan.reading_sigma_mm * normal(random), name + "_l", name + "_r"});
  }
  return head;
}

}  // namespace crosstie::tests
