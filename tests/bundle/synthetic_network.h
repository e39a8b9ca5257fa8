#pragma once

#include <cmath>
#include <cstdint>
#include <functional>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "base/network.h"

namespace crosstie::tests {

/// A network whose truth is known: cameras, poses and points are laid out, projected and disturbed by hand; nothing of `bundle`
/// takes part.
struct SyntheticNetwork {
  base::Network network;
  std::vector<base::Camera> cameras;            ///< true ones
  std::vector<base::Pose> network_from_camera;  ///< of network.images
  std::vector<base::Pose> rig_from_camera;      ///< of the cameras, where they are on a rig
  std::vector<int> ids;
  std::vector<Eigen::Vector3d> points;

  [[nodiscard]] double distance(int id_a, int id_b) const { return (point(id_a) - point(id_b)).norm(); }
  [[nodiscard]] const Eigen::Vector3d& point(int id) const {
    for (std::size_t i = 0; i < ids.size(); ++i) {
      if (ids[i] == id) return points[i];
    }
    std::abort();
  }
};

struct SyntheticOptions {
  int cameras = 1;
  bool rig = false;  ///< the cameras (two or more) sit on one bar and take their images at the same moments
  int images = 12;
  int columns = 6;  ///< of points, 90 mm apart
  int rows = 5;
  double depth_mm = 150.0;  ///< of the points about their plane; 0: flat
  double noise_px = 0.02;
  double stated_sigma_px = 0.02;  ///< what the observations say of themselves
  double focal_error = 0.03;      ///< of the start value
  bool rolled = true;             ///< some images turned by 90 degrees
  bool moving = true;             ///< false: every image is taken from one place
  double k1 = -0.1;               ///< true distortion; start values have none
  base::LensModel model = base::LensModel::kOpenCv5;
  bool bars = true;
  std::uint64_t seed = 1;
};

/// Numbers of our own making: the same for every standard library.
class Random {
 public:
  explicit Random(std::uint64_t seed) : generator_(seed) {}
  double uniform() { return (static_cast<double>(generator_() >> 11) + 0.5) * 0x1p-53; }
  double uniform(double low, double high) { return low + (high - low) * uniform(); }
  double normal() { return std::sqrt(-2.0 * std::log(uniform())) * std::cos(2.0 * std::numbers::pi * uniform()); }

 private:
  std::mt19937_64 generator_;
};

/// A camera at `position` that looks at `target`, turned by `roll_rad` about its axis.
inline base::Pose looking_at(const Eigen::Vector3d& position, const Eigen::Vector3d& target, double roll_rad) {
  const Eigen::Vector3d z = (target - position).normalized();
  const Eigen::Vector3d x = Eigen::Vector3d::UnitY().cross(z).normalized();
  Eigen::Matrix3d rotation;
  rotation << x, z.cross(x), z;
  return {Eigen::Quaterniond(rotation) * Eigen::Quaterniond(Eigen::AngleAxisd(roll_rad, Eigen::Vector3d::UnitZ())), position};
}

inline SyntheticNetwork make_synthetic(const SyntheticOptions& options) {
  SyntheticNetwork synthetic;
  Random random(options.seed);
  Random layout(4711);  // the scene is the same for every seed; only the noise differs
  const int width = 2000;
  const int height = 1333;
  const double focal = 2100.0;
  for (int c = 0; c < options.cameras; ++c) {
    Eigen::VectorXd parameters = Eigen::VectorXd::Zero(base::parameter_count(options.model));
    parameters.head<4>() << focal + 3.0 * c, focal - 2.0 + 3.0 * c, 0.5 * width + 12.0, 0.5 * height - 7.0 - 2.0 * c;
    if (parameters.size() > 4) parameters(4) = options.k1;
    if (parameters.size() > 5) parameters(5) = 0.05;
    if (parameters.size() > 7) parameters.segment<2>(6) << 4e-4, -3e-4;
    synthetic.cameras.push_back(*base::Camera::make(options.model, width, height, parameters));
    synthetic.network.cameras.push_back(
        {fmt::format("c{}", c), *base::Camera::nominal(options.model, width, height, focal * (1.0 + options.focal_error)),
         true});
  }
  for (int row = 0; row < options.rows; ++row) {
    for (int column = 0; column < options.columns; ++column) {
      synthetic.ids.push_back(10 + row * options.columns + column);
      synthetic.points.emplace_back(90.0 * (column - 0.5 * (options.columns - 1)) + layout.uniform(-10.0, 10.0),
                                    90.0 * (row - 0.5 * (options.rows - 1)) + layout.uniform(-10.0, 10.0),
                                    options.depth_mm * layout.uniform(-0.5, 0.5));
    }
  }
  if (options.rig) synthetic.network.rigs.push_back({"bar", {}, {}});
  for (int c = 0; options.rig && c < options.cameras; ++c) {
    synthetic.network.rigs.front().cameras.push_back(fmt::format("c{}", c));
    synthetic.rig_from_camera.push_back(
        {base::rotation_exp(c * Eigen::Vector3d(0.02, -0.2, 0.01)), c * Eigen::Vector3d(260.0, 4.0, -9.0)});
  }
  base::Pose network_from_rig;
  for (int i = 0; i < options.images; ++i) {
    const int c = i % options.cameras;
    const double around = 2.0 * std::numbers::pi * i / options.images + 0.3;
    const double out = 350.0 + 250.0 * (i % 3);
    Eigen::Vector3d position(out * std::cos(around), out * std::sin(around), 950.0 + 90.0 * (i % 4));
    Eigen::Vector3d target(layout.uniform(-30.0, 30.0), layout.uniform(-30.0, 30.0), 0.0);
    if (!options.moving) position = Eigen::Vector3d(0.0, 0.0, 1200.0);
    if (!options.moving) target *= 4.0;
    const double roll = options.rolled ? 0.5 * std::numbers::pi * (i % 4) : 0.0;
    base::Pose pose = looking_at(position, target, roll);
    if (options.rig) {
      if (c == 0) {
        network_from_rig = pose;
        synthetic.network.rigs.front().stations.emplace_back();
      }
      pose = network_from_rig * synthetic.rig_from_camera[static_cast<std::size_t>(c)];
      synthetic.network.rigs.front().stations.back().push_back(fmt::format("i{:02}", i));
    }
    synthetic.network_from_camera.push_back(pose);
    base::ImageObservations image;
    image.image = fmt::format("i{:02}", i);
    image.camera = fmt::format("c{}", c);
    image.family = "ring10";
    image.width_px = width;
    image.height_px = height;
    for (std::size_t p = 0; p < synthetic.ids.size(); ++p) {
      const auto pixel = synthetic.cameras[static_cast<std::size_t>(c)].project(pose.inverse() * synthetic.points[p]);
      const double dx = options.noise_px * random.normal();
      const double dy = options.noise_px * random.normal();
      if (!pixel || pixel->x() < 10 || pixel->y() < 10 || pixel->x() > width - 10 || pixel->y() > height - 10) continue;
      base::Observation observation;
      observation.id = synthetic.ids[p];
      observation.centre_px = *pixel + Eigen::Vector2d(dx, dy);
      observation.cov_px2 = std::pow(options.stated_sigma_px, 2) * Eigen::Matrix2d::Identity();
      observation.semi_major_px = 7.0;
      observation.semi_minor_px = 6.0;
      observation.status = base::ObservationStatus::kCoded;
      image.observations.push_back(observation);
    }
    synthetic.network.images.push_back(std::move(image));
  }
  if (options.bars) {
    const int last = synthetic.ids.back();
    const int corner = synthetic.ids[static_cast<std::size_t>(options.columns) - 1];
    for (const auto& [a, b] : {std::pair{10, last}, std::pair{corner, last - options.columns + 1}}) {
      const double known = synthetic.distance(a, b) + 0.01 * random.normal();
      synthetic.network.scale_bars.push_back({a, b, known, 0.01, 20.0, 0.0, base::ScaleBarRole::kUsed, ""});
    }
  }
  return synthetic;
}

/// The observation of an id in an image; null where it is not there.
inline base::Observation* find_observation(base::Network& network, const std::string& image, int id) {
  for (auto& observations : network.images) {
    if (observations.image != image) continue;
    for (auto& observation : observations.observations) {
      if (observation.id == id) return &observation;
    }
  }
  return nullptr;
}

}  // namespace crosstie::tests
