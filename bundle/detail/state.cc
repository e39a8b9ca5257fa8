#include "bundle/detail/state.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace crosstie::bundle::detail {

State start_state(const Survey& survey) {
  State state;
  for (const auto& camera : survey.cameras) state.lenses.push_back(camera.camera.parameters());
  state.poses.resize(survey.images.size());
  state.mounts.resize(survey.cameras.size());
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
  for (auto* poses : {&state.poses, &state.mounts}) {
    for (auto& pose : *poses) {
      if (pose) pose->translation_mm *= scale;
    }
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

double robust_sigma_px(const Survey& survey, const State& state) {
  std::vector<double> residuals;
  for (std::size_t r = 0; r < survey.rays.size(); ++r) {
    if (!state.active[r] || !state.knows(survey.rays[r])) continue;
    const auto pixel = predicted_px(survey, state, survey.rays[r]);
    if (!pixel) continue;
    residuals.push_back(std::abs(pixel->x() - survey.rays[r].measured_px.x()));
    residuals.push_back(std::abs(pixel->y() - survey.rays[r].measured_px.y()));
  }
  if (residuals.empty()) return std::numeric_limits<double>::infinity();
  const auto middle = residuals.begin() + static_cast<std::ptrdiff_t>(residuals.size() / 2);
  std::nth_element(residuals.begin(), middle, residuals.end());
  return 1.4826 * *middle;
}

}  // namespace crosstie::bundle::detail
