#include "bundle/detail/network_model.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>
#include <Eigen/Cholesky>
#include <Eigen/QR>

#include "bundle/detail/distance.h"
#include "math/prior.h"

namespace crosstie::bundle::detail {
namespace {

math::Block camera_block(const base::NetworkCamera& camera, const Eigen::VectorXd& lens, std::vector<int> free) {
  math::Block block;
  block.name = "camera " + camera.name;
  block.values.assign(lens.data(), lens.data() + lens.size());
  const auto names = base::parameter_names(camera.camera.model());
  const auto units = base::parameter_units(camera.camera.model());
  for (std::size_t i = 0; i < names.size(); ++i) {
    block.components.push_back(units[i].empty() ? std::string(names[i]) : fmt::format("{} [{}]", names[i], units[i]));
  }
  block.free = std::move(free);
  return block;
}

/// The root of the weights of some coordinates when the others are unknown: these are eliminated from `whitening`.
Eigen::MatrixXd without_unknowns(const Eigen::MatrixXd& whitening, const std::vector<Eigen::Index>& columns) {
  const auto all = whitening.cols();
  if (static_cast<Eigen::Index>(columns.size()) == all) return whitening;
  std::vector<Eigen::Index> unknown;
  for (Eigen::Index i = 0; i < all; ++i) {
    if (!std::binary_search(columns.begin(), columns.end(), i)) unknown.push_back(i);
  }
  const Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr(whitening(Eigen::all, unknown));
  const Eigen::MatrixXd kept = qr.householderQ().transpose() * whitening(Eigen::all, columns);
  return kept.bottomRows(whitening.rows() - qr.rank());
}

/// What a group of rows observes; -1 for what it does not.
void add_group(NetworkModel& network, std::unique_ptr<math::Measurement> measurement, int ray, int bar, int control) {
  network.model.measurements.push_back(std::move(measurement));
  network.ray_of_group.push_back(ray);
  network.bar_of_group.push_back(bar);
  network.control_of_group.push_back(control);
}

void add_bars(const Survey& survey, double ratio, NetworkModel& network) {
  for (std::size_t i = 0; i < survey.bars.size(); ++i) {
    const Bar& bar = survey.bars[i];
    const int a = network.point_block[static_cast<std::size_t>(bar.point_a)];
    const int b = network.point_block[static_cast<std::size_t>(bar.point_b)];
    if (bar.bar.role != base::ScaleBarRole::kUsed || a < 0 || b < 0) continue;
    add_group(network, std::make_unique<Distance>(a, b, bar.bar.length_at_temperature_mm(), ratio * bar.bar.sigma_mm), -1,
              static_cast<int>(i), -1);
  }
}

void add_control(const Survey& survey, double ratio, NetworkModel& network) {
  for (std::size_t c = 0; c < survey.control.size(); ++c) {
    const Control& control = survey.control[c];
    std::vector<int> blocks;
    std::vector<Eigen::Index> columns;
    for (std::size_t k = 0; k < control.points.size(); ++k) {
      const int block = network.point_block[static_cast<std::size_t>(control.points[k])];
      if (block < 0) continue;
      blocks.push_back(block);
      math::Block& point = network.model.blocks[static_cast<std::size_t>(block)];
      for (std::size_t axis = 0; axis < 3; ++axis) {
        if (!control.held[k][axis]) continue;
        point.values[axis] = control.xyz_mm(3 * static_cast<Eigen::Index>(k) + static_cast<Eigen::Index>(axis));
        std::erase(point.free, static_cast<int>(axis));
      }
      for (Eigen::Index axis = 0; axis < 3; ++axis) columns.push_back(3 * static_cast<Eigen::Index>(k) + axis);
    }
    if (blocks.empty() || control.whitening.rows() == 0) continue;
    std::vector<int> sizes(blocks.size(), 3);
    // Points that do not take part are unknown: the covariance of the others stays what it is, which for a root of the inverse
    // means to eliminate their columns.
    add_group(network,
              std::make_unique<math::Prior>(std::move(blocks), std::move(sizes), control.xyz_mm(columns),
                                            without_unknowns(control.whitening, columns) / ratio),
              -1, -1, static_cast<int>(c));
  }
}

void add_priors(const Survey& survey, const ModelPlan& plan, NetworkModel& network) {
  for (std::size_t c = 0; c < plan.lens_prior.size(); ++c) {
    if (!plan.lens_prior[c] || network.camera_block[c] < 0 || plan.free_lens[c].empty()) continue;
    // Held parameters are known: the prior is that of the free ones alone, those aside of which it tells nothing.
    std::vector<int> free = plan.free_lens[c];
    std::erase_if(free, [&](int k) { return !std::isfinite((*plan.lens_prior[c])(k, k)); });
    if (free.empty()) continue;
    const Eigen::MatrixXd cov = (*plan.lens_prior[c])(free, free);
    const Eigen::LLT<Eigen::MatrixXd> llt(cov);
    const auto count = static_cast<Eigen::Index>(free.size());
    const auto all = static_cast<int>(survey.cameras[c].camera.parameters().size());
    Eigen::MatrixXd whitening = Eigen::MatrixXd::Zero(count, all);
    const Eigen::MatrixXd inverse = llt.matrixL().solve(Eigen::MatrixXd::Identity(count, count));
    for (std::size_t i = 0; i < free.size(); ++i) whitening.col(free[i]) = inverse.col(static_cast<Eigen::Index>(i));
    add_group(network,
              std::make_unique<math::Prior>(std::vector<int>{network.camera_block[c]}, std::vector<int>{all}, plan.lens_mean[c],
                                            std::move(whitening)),
              -1, -1, -1);
  }
}

/// Blocks of the mounts and poses of all images that are used; those of one station share the pose of its rig.
void add_poses(const Survey& survey, const State& state, const ModelPlan& plan, const std::vector<char>& image_used,
               NetworkModel& network) {
  std::vector<char> mounted(survey.cameras.size(), 0);
  std::vector<int> block_of_station(survey.stations.size(), -1);
  const auto mount_of = [&](std::size_t image) -> const std::optional<base::Pose>& {
    return state.mounts[static_cast<std::size_t>(survey.camera_of_image[image])];
  };
  const auto add = [&](math::Block block) {
    if (plan.hold_poses) block.free.clear();
    return network.model.add(std::move(block));
  };
  for (std::size_t i = 0; i < survey.images.size(); ++i) {
    if (image_used[i] && survey.station_of_image[i] >= 0 && mount_of(i))
      mounted[static_cast<std::size_t>(survey.camera_of_image[i])] = 1;
  }
  for (std::size_t c = 0; c < survey.cameras.size(); ++c) {
    if (!mounted[c] || survey.leads_rig(static_cast<int>(c))) continue;
    math::Block block = math::pose_block("mount " + survey.cameras[c].name, *state.mounts[c]);
    block.kind = math::Block::Kind::kMount;
    network.mount_block[c] = add(std::move(block));
  }
  for (std::size_t i = 0; i < survey.images.size(); ++i) {
    if (!image_used[i]) continue;
    const int station = survey.station_of_image[i];
    if (station < 0 || !mount_of(i)) {
      network.image_block[i] = add(math::pose_block("image " + survey.images[i], *state.poses[i]));
      continue;
    }
    int& shared = block_of_station[static_cast<std::size_t>(station)];
    if (shared < 0) {
      shared = add(math::pose_block("station " + survey.stations[static_cast<std::size_t>(station)].name,
                                    *state.poses[i] * mount_of(i)->inverse()));
    }
    network.image_block[i] = shared;
  }
}

}  // namespace

std::unique_ptr<math::ImagePoint> NetworkModel::image_point(const Survey& survey, int ray,
                                                            const Eigen::Matrix2d& whitening) const {
  const Ray& observed = survey.rays[static_cast<std::size_t>(ray)];
  const auto image = static_cast<std::size_t>(observed.image);
  const auto camera = static_cast<std::size_t>(survey.camera_of_image[image]);
  const int mount = survey.station_of_image[image] >= 0 ? mount_block[camera] : -1;
  return std::make_unique<math::ImagePoint>(
      math::ImagePoint::Blocks{camera_block[camera], image_block[image], point_block[static_cast<std::size_t>(observed.point)],
                               mount},
      survey.lens(observed.image), observed.measured_px, whitening);
}

NetworkModel build_model(const Survey& survey, const State& state, const ModelPlan& plan) {
  NetworkModel network;
  network.camera_block.assign(survey.cameras.size(), -1);
  network.mount_block.assign(survey.cameras.size(), -1);
  network.image_block.assign(survey.images.size(), -1);
  network.point_block.assign(survey.ids.size(), -1);
  std::vector<char> takes_part(survey.rays.size(), 0);
  std::vector<char> sees(survey.cameras.size(), 0);
  std::vector<char> image_used(survey.images.size(), 0);
  std::vector<char> point_used(survey.ids.size(), 0);
  for (std::size_t r = 0; r < survey.rays.size(); ++r) {
    const Ray& ray = survey.rays[r];
    if (!state.active[r] || !state.knows(ray) || !predicted_px(survey, state, ray)) continue;
    takes_part[r] = 1;
    image_used[static_cast<std::size_t>(ray.image)] = 1;
    point_used[static_cast<std::size_t>(ray.point)] = 1;
    sees[static_cast<std::size_t>(survey.camera_of_image[static_cast<std::size_t>(ray.image)])] = 1;
  }
  for (std::size_t c = 0; c < survey.cameras.size(); ++c) {
    if (!sees[c]) continue;
    network.camera_block[c] = network.model.add(
        camera_block(survey.cameras[c], state.lenses[c], c < plan.free_lens.size() ? plan.free_lens[c] : std::vector<int>()));
  }
  add_poses(survey, state, plan, image_used, network);
  for (std::size_t p = 0; p < survey.ids.size(); ++p) {
    if (!point_used[p]) continue;
    math::Block block = math::point_block(fmt::format("point {}", survey.ids[p]), *state.points[p]);
    if (plan.hold_points) block.free.clear();
    network.point_block[p] = network.model.add(std::move(block));
  }
  for (std::size_t r = 0; r < survey.rays.size(); ++r) {
    if (!takes_part[r]) continue;
    add_group(network,
              network.image_point(survey, static_cast<int>(r),
                                  plan.whitening.empty() ? Eigen::Matrix2d::Identity() : plan.whitening[r]),
              static_cast<int>(r), -1, -1);
  }
  if (plan.known_sizes) {
    add_bars(survey, plan.bar_ratio, network);
    add_control(survey, plan.control_ratio, network);
  }
  add_priors(survey, plan, network);
  return network;
}

void read_back(const Survey& survey, const NetworkModel& network, State& state) {
  const auto values = [&](int block) -> const std::vector<double>& {
    return network.model.blocks[static_cast<std::size_t>(block)].values;
  };
  for (std::size_t c = 0; c < network.camera_block.size(); ++c) {
    if (network.camera_block[c] < 0) continue;
    state.lenses[c] = Eigen::Map<const Eigen::VectorXd>(values(network.camera_block[c]).data(), state.lenses[c].size());
  }
  for (std::size_t c = 0; c < network.mount_block.size(); ++c) {
    if (network.mount_block[c] >= 0) state.mounts[c] = math::pose_from_values(values(network.mount_block[c]).data());
  }
  for (std::size_t i = 0; i < network.image_block.size(); ++i) {
    if (network.image_block[i] < 0) continue;
    state.poses[i] = math::pose_from_values(values(network.image_block[i]).data());
    const auto& mount = state.mounts[static_cast<std::size_t>(survey.camera_of_image[i])];
    if (survey.station_of_image[i] >= 0 && mount) state.poses[i] = *state.poses[i] * *mount;
  }
  for (std::size_t p = 0; p < network.point_block.size(); ++p) {
    if (network.point_block[p] >= 0) state.points[p] = Eigen::Map<const Eigen::Vector3d>(values(network.point_block[p]).data());
  }
}

}  // namespace crosstie::bundle::detail
