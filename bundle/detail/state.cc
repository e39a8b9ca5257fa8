#include "bundle/detail/state.h"

#include <limits>

#include <fmt/format.h>
#include <Eigen/Cholesky>

#include "bundle/detail/distance.h"
#include "bundle/detail/image_point.h"
#include "bundle/detail/prior.h"

namespace crosstie::bundle::detail {
namespace {

std::string unit_of(int parameter) { return parameter < 4 ? " [px]" : ""; }

Block camera_block(const base::NetworkCamera& camera, const Eigen::VectorXd& lens, std::vector<int> free) {
  Block block;
  block.name = "camera " + camera.name;
  block.values.assign(lens.data(), lens.data() + lens.size());
  const auto names = base::parameter_names(camera.camera.model());
  for (int i = 0; i < lens.size(); ++i)
    block.components.push_back(std::string(names[static_cast<std::size_t>(i)]) + unit_of(i));
  block.free = std::move(free);
  return block;
}

void add_bars(const Survey& survey, NetworkModel& network) {
  for (std::size_t i = 0; i < survey.bars.size(); ++i) {
    const Bar& bar = survey.bars[i];
    const int a = network.point_block[static_cast<std::size_t>(bar.point_a)];
    const int b = network.point_block[static_cast<std::size_t>(bar.point_b)];
    if (bar.bar.role != base::ScaleBarRole::kUsed || a < 0 || b < 0) continue;
    network.model.measurements.push_back(
        std::make_unique<Distance>(a, b, bar.bar.length_at_temperature_mm(), bar.bar.sigma_mm));
    network.ray_of_group.push_back(-1);
    network.bar_of_group.push_back(static_cast<int>(i));
  }
}

void add_priors(const Survey& survey, const ModelPlan& plan, NetworkModel& network) {
  for (std::size_t c = 0; c < plan.lens_prior.size(); ++c) {
    if (!plan.lens_prior[c] || network.camera_block[c] < 0 || plan.free_lens[c].empty()) continue;
    // Held parameters are known: the prior is that of the free ones alone.
    const std::vector<int>& free = plan.free_lens[c];
    const Eigen::MatrixXd cov = (*plan.lens_prior[c])(free, free);
    const Eigen::LLT<Eigen::MatrixXd> llt(cov);
    const auto count = static_cast<Eigen::Index>(free.size());
    Eigen::MatrixXd whitening = Eigen::MatrixXd::Zero(count, survey.cameras[c].camera.parameters().size());
    const Eigen::MatrixXd inverse = llt.matrixL().solve(Eigen::MatrixXd::Identity(count, count));
    for (std::size_t i = 0; i < free.size(); ++i) whitening.col(free[i]) = inverse.col(static_cast<Eigen::Index>(i));
    network.model.measurements.push_back(
        std::make_unique<Prior>(network.camera_block[c], plan.lens_mean[c], std::move(whitening)));
    network.ray_of_group.push_back(-1);
    network.bar_of_group.push_back(-1);
  }
}

}  // namespace

State start_state(const Survey& survey) {
  State state;
  for (const auto& camera : survey.cameras) state.lenses.push_back(camera.camera.parameters());
  state.poses.resize(survey.images.size());
  state.points.resize(survey.ids.size());
  for (const Ray& ray : survey.rays) state.active.push_back(ray.twin ? 0 : 1);
  return state;
}

std::optional<Eigen::Vector2d> project_into(const Survey& survey, const State& state, int image, const Eigen::Vector3d& point) {
  const auto index = static_cast<std::size_t>(image);
  const Eigen::Vector3d p_in_camera = state.poses[index]->inverse() * point;
  const auto& lens = state.lenses[static_cast<std::size_t>(survey.camera_of_image[index])];
  Eigen::Vector2d pixel;
  if (!base::project_bare(survey.lens(image), lens.data(), p_in_camera.data(), pixel.data(), nullptr, nullptr)) return {};
  return pixel;
}

std::optional<Eigen::Vector2d> predicted_px(const Survey& survey, const State& state, const Ray& ray) {
  return project_into(survey, state, ray.image, *state.points[static_cast<std::size_t>(ray.point)]);
}

double distance_px(const Survey& survey, const State& state, const Ray& ray) {
  const auto pixel = predicted_px(survey, state, ray);
  return pixel ? (*pixel - ray.measured_px).norm() : std::numeric_limits<double>::infinity();
}

void rescale(State& state, double scale) {
  for (auto& pose : state.poses) {
    if (pose) pose->translation_mm *= scale;
  }
  for (auto& point : state.points) {
    if (point) *point *= scale;
  }
}

void transform(State& state, const base::Pose& other_from_network) {
  for (auto& pose : state.poses) {
    if (pose) pose = other_from_network * *pose;
  }
  for (auto& point : state.points) {
    if (point) point = other_from_network * *point;
  }
}

NetworkModel build_model(const Survey& survey, const State& state, const ModelPlan& plan) {
  NetworkModel network;
  network.camera_block.assign(survey.cameras.size(), -1);
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
  for (std::size_t i = 0; i < survey.images.size(); ++i) {
    if (!image_used[i]) continue;
    Block block = pose_block("image " + survey.images[i], *state.poses[i]);
    if (plan.hold_poses) block.free.clear();
    network.image_block[i] = network.model.add(std::move(block));
  }
  for (std::size_t p = 0; p < survey.ids.size(); ++p) {
    if (!point_used[p]) continue;
    Block block = point_block(fmt::format("point {}", survey.ids[p]), *state.points[p]);
    if (plan.hold_points) block.free.clear();
    network.point_block[p] = network.model.add(std::move(block));
  }
  for (std::size_t r = 0; r < survey.rays.size(); ++r) {
    if (!takes_part[r]) continue;
    const Ray& ray = survey.rays[r];
    const auto camera = static_cast<std::size_t>(survey.camera_of_image[static_cast<std::size_t>(ray.image)]);
    network.model.measurements.push_back(std::make_unique<ImagePoint>(
        network.camera_block[camera], network.image_block[static_cast<std::size_t>(ray.image)],
        network.point_block[static_cast<std::size_t>(ray.point)], survey.lens(ray.image), ray.measured_px,
        plan.whitening.empty() ? Eigen::Matrix2d::Identity() : plan.whitening[r]));
    network.ray_of_group.push_back(static_cast<int>(r));
    network.bar_of_group.push_back(-1);
  }
  if (plan.used_bars) add_bars(survey, network);
  add_priors(survey, plan, network);
  return network;
}

void read_back(const NetworkModel& network, State& state) {
  const auto values = [&](int block) -> const std::vector<double>& {
    return network.model.blocks[static_cast<std::size_t>(block)].values;
  };
  for (std::size_t c = 0; c < network.camera_block.size(); ++c) {
    if (network.camera_block[c] < 0) continue;
    state.lenses[c] = Eigen::Map<const Eigen::VectorXd>(values(network.camera_block[c]).data(), state.lenses[c].size());
  }
  for (std::size_t i = 0; i < network.image_block.size(); ++i) {
    if (network.image_block[i] >= 0) state.poses[i] = pose_from_values(values(network.image_block[i]).data());
  }
  for (std::size_t p = 0; p < network.point_block.size(); ++p) {
    if (network.point_block[p] >= 0) state.points[p] = Eigen::Map<const Eigen::Vector3d>(values(network.point_block[p]).data());
  }
}

}  // namespace crosstie::bundle::detail
