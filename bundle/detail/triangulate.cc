#include "bundle/detail/triangulate.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>

namespace crosstie::bundle::detail {
namespace {

constexpr int kMaxPairs = 60;  // pairs of rays that are tried for one point

double angle_between(const Eigen::Vector3d& a, const Eigen::Vector3d& b) { return std::atan2(a.cross(b).norm(), a.dot(b)); }

}  // namespace

std::vector<std::optional<Eigen::Vector3d>> ray_directions(const Survey& survey, const State& state) {
  std::vector<std::optional<Eigen::Vector3d>> directions(survey.rays.size());
  std::vector<base::Result<base::Camera>> cameras;
  for (std::size_t c = 0; c < survey.cameras.size(); ++c) {
    const base::Camera& start = survey.cameras[c].camera;
    cameras.push_back(base::Camera::make(start.model(), start.width_px(), start.height_px(), state.lenses[c]));
  }
  for (std::size_t r = 0; r < survey.rays.size(); ++r) {
    const auto& camera =
        cameras[static_cast<std::size_t>(survey.camera_of_image[static_cast<std::size_t>(survey.rays[r].image)])];
    if (camera) directions[r] = camera->unproject(survey.rays[r].measured_px);
  }
  return directions;
}

std::optional<Eigen::Vector3d> nearest_point(const std::vector<Eigen::Vector3d>& origins,
                                             const std::vector<Eigen::Vector3d>& directions) {
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  Eigen::Vector3d right = Eigen::Vector3d::Zero();
  for (std::size_t i = 0; i < origins.size(); ++i) {
    const Eigen::Matrix3d across = Eigen::Matrix3d::Identity() - directions[i] * directions[i].transpose();
    normal += across;
    right += across * origins[i];
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(normal);
  if (!(eigen.eigenvalues()(0) > 1e-12 * eigen.eigenvalues()(2))) return {};
  return eigen.eigenvectors() * eigen.eigenvalues().cwiseInverse().asDiagonal() * eigen.eigenvectors().transpose() * right;
}

std::optional<Triangulation> triangulate(const Survey& survey, const State& state,
                                         const std::vector<std::optional<Eigen::Vector3d>>& directions,
                                         const std::vector<int>& candidates, double tolerance_px, double min_angle_rad) {
  std::vector<int> rays;
  std::vector<Eigen::Vector3d> origins;
  std::vector<Eigen::Vector3d> lines;
  for (const int r : candidates) {
    const auto& pose = state.poses[static_cast<std::size_t>(survey.rays[static_cast<std::size_t>(r)].image)];
    if (!pose || !directions[static_cast<std::size_t>(r)]) continue;
    rays.push_back(r);
    origins.push_back(pose->translation_mm);
    lines.push_back(pose->rotation * *directions[static_cast<std::size_t>(r)]);
  }
  const auto agreeing = [&](const Eigen::Vector3d& point, double& cost) {
    std::vector<std::size_t> agree;
    cost = 0.0;
    for (std::size_t i = 0; i < rays.size(); ++i) {
      const Ray& ray = survey.rays[static_cast<std::size_t>(rays[i])];
      const auto pixel = project_into(survey, state, ray.image, point);
      const double distance = pixel ? (*pixel - ray.measured_px).norm() : tolerance_px;
      if (distance < tolerance_px) agree.push_back(i);
      cost += std::min(distance, tolerance_px);
    }
    return agree;
  };

  std::vector<std::size_t> best;
  double best_cost = 0.0;
  int tried = 0;
  // Distant pairs in the list first: neighbours tend to be taken from nearly the same place.
  for (std::size_t step = rays.size() / 2 + 1; step-- > 1 && tried < kMaxPairs;) {
    for (std::size_t i = 0; i < rays.size() && tried < kMaxPairs; ++i) {
      const std::size_t j = (i + step) % rays.size();
      if (j == i || (2 * step == rays.size() && j < i)) continue;
      if (angle_between(lines[i], lines[j]) < min_angle_rad) continue;
      ++tried;
      const auto point = nearest_point({origins[i], origins[j]}, {lines[i], lines[j]});
      if (!point) continue;
      double cost = 0.0;
      auto agree = agreeing(*point, cost);
      if (agree.size() > best.size() || (agree.size() == best.size() && cost < best_cost)) {
        best = std::move(agree);
        best_cost = cost;
      }
    }
  }
  if (best.size() < 2) return {};
  std::vector<Eigen::Vector3d> best_origins;
  std::vector<Eigen::Vector3d> best_lines;
  Triangulation result;
  for (const std::size_t i : best) {
    best_origins.push_back(origins[i]);
    best_lines.push_back(lines[i]);
    result.rays.push_back(rays[i]);
    for (const Eigen::Vector3d& other : best_lines)
      result.angle_rad = std::max(result.angle_rad, angle_between(lines[i], other));
  }
  const auto point = nearest_point(best_origins, best_lines);
  if (!point) return {};
  result.point = *point;
  return result;
}

double largest_angle(const Survey& survey, const State& state, const std::vector<int>& rays) {
  double largest = 0.0;
  std::vector<Eigen::Vector3d> lines;
  for (const int r : rays) {
    const Ray& ray = survey.rays[static_cast<std::size_t>(r)];
    lines.push_back(*state.points[static_cast<std::size_t>(ray.point)] -
                    state.poses[static_cast<std::size_t>(ray.image)]->translation_mm);
    for (const Eigen::Vector3d& other : lines) largest = std::max(largest, angle_between(lines.back(), other));
  }
  return largest;
}

}  // namespace crosstie::bundle::detail
