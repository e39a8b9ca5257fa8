#include "bundle/detail/resection.h"

#include <algorithm>
#include <limits>

#include <Eigen/Eigenvalues>

#include "bundle/detail/minimal_solvers.h"
#include "bundle/detail/network_model.h"
#include "bundle/detail/sampling.h"
#include "math/minimise.h"

namespace crosstie::bundle::detail {
namespace {

constexpr int kTrials = 200;
constexpr int kLeastRays = 4;
constexpr double kFlat = 0.2;  // least over middle extent of the points below which a second minimum is looked for
constexpr std::uint64_t kSeed = 20'110'620;

double cost_of(const Survey& survey, const State& state, const std::vector<int>& rays, double tolerance_px,
               int* inliers = nullptr) {
  double cost = 0.0;
  if (inliers != nullptr) *inliers = 0;
  for (const int r : rays) {
    const double distance = distance_px(survey, state, survey.rays[static_cast<std::size_t>(r)]);
    cost += truncated_cost(distance * distance, tolerance_px);
    if (inliers != nullptr && distance < tolerance_px) ++*inliers;
  }
  return cost;
}

/// Least squares of this one pose with a robust loss.
void refine(const Survey& survey, State& state, int image, const std::vector<int>& rays, double tolerance_px) {
  State alone = state;
  std::fill(alone.active.begin(), alone.active.end(), char{0});
  for (const int r : rays) alone.active[static_cast<std::size_t>(r)] = 1;
  ModelPlan plan;
  plan.hold_points = true;
  NetworkModel network = build_model(survey, alone, plan);
  if (network.model.measurements.empty()) return;
  if (!math::minimise(network.model, {.max_iterations = 30, .robust_scale = 0.3 * tolerance_px, .function_tolerance = 1e-6}))
    return;
  read_back(survey, network, alone);
  state.poses[static_cast<std::size_t>(image)] = alone.poses[static_cast<std::size_t>(image)];
}

/// The pose from which a flat set of points looks nearly the same: its plane mirrored at the plane across the line of sight.
std::optional<base::Pose> mirrored_pose(const State& state, const Survey& survey, const std::vector<int>& rays,
                                        const base::Pose& network_from_camera) {
  Eigen::Matrix3Xd points(3, static_cast<Eigen::Index>(rays.size()));
  for (std::size_t i = 0; i < rays.size(); ++i) {
    const Ray& ray = survey.rays[static_cast<std::size_t>(rays[i])];
    points.col(static_cast<Eigen::Index>(i)) = *state.points[static_cast<std::size_t>(ray.point)];
  }
  const Eigen::Vector3d centre = points.rowwise().mean();
  points.colwise() -= centre;
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(points * points.transpose());
  if (eigen.eigenvalues()(0) > kFlat * kFlat * eigen.eigenvalues()(1)) return {};
  Eigen::Matrix3d network_from_plane;
  network_from_plane << eigen.eigenvectors().col(2), eigen.eigenvectors().col(1),
      eigen.eigenvectors().col(2).cross(eigen.eigenvectors().col(1));
  const Eigen::Matrix3d camera_from_network = network_from_camera.rotation.toRotationMatrix().transpose();
  const Eigen::Vector3d centre_in_camera = network_from_camera.inverse() * centre;
  const Eigen::Vector3d sight = centre_in_camera.normalized();
  const Eigen::Matrix3d mirror = Eigen::Matrix3d::Identity() - 2.0 * sight * sight.transpose();
  const Eigen::Matrix3d camera_from_plane =
      mirror * camera_from_network * network_from_plane * Eigen::Vector3d(1.0, 1.0, -1.0).asDiagonal();
  const Eigen::Quaterniond turned((network_from_plane * camera_from_plane.transpose()).eval());
  return base::Pose{turned.normalized(), centre - turned * centre_in_camera};
}

}  // namespace

std::optional<Resection> resect(const Survey& survey, const State& state,
                                const std::vector<std::optional<Eigen::Vector3d>>& directions, int image, double tolerance_px) {
  std::vector<int> rays;
  for (const int r : survey.rays_of_image[static_cast<std::size_t>(image)]) {
    const Ray& ray = survey.rays[static_cast<std::size_t>(r)];
    const bool usable = state.active[static_cast<std::size_t>(r)] != 0 && directions[static_cast<std::size_t>(r)].has_value();
    if (usable && state.points[static_cast<std::size_t>(ray.point)]) rays.push_back(r);
  }
  if (static_cast<int>(rays.size()) < kLeastRays) return {};

  State trial = state;
  auto& pose = trial.poses[static_cast<std::size_t>(image)];
  Sampler sampler(static_cast<int>(rays.size()), kSeed + static_cast<std::uint64_t>(image));
  std::array<int, 3> sample{};
  std::optional<base::Pose> best;
  double best_cost = std::numeric_limits<double>::infinity();
  for (int k = 0; k < kTrials; ++k) {
    sampler.draw(sample);
    std::array<Eigen::Vector3d, 3> sights;
    std::array<Eigen::Vector3d, 3> points;
    for (std::size_t i = 0; i < sample.size(); ++i) {
      const int r = rays[static_cast<std::size_t>(sample[i])];
      sights[i] = *directions[static_cast<std::size_t>(r)];
      points[i] = *state.points[static_cast<std::size_t>(survey.rays[static_cast<std::size_t>(r)].point)];
    }
    for (const base::Pose& candidate : three_point_poses(sights, points)) {
      pose = candidate;
      const double cost = cost_of(survey, trial, rays, tolerance_px);
      if (cost < best_cost) {
        best_cost = cost;
        best = candidate;
      }
    }
  }
  if (!best) return {};

  std::vector<base::Pose> starts{*best};
  pose = *best;
  refine(survey, trial, image, rays, tolerance_px);
  starts.push_back(*pose);
  if (const auto other = mirrored_pose(state, survey, rays, *pose)) {
    pose = *other;
    refine(survey, trial, image, rays, tolerance_px);
    starts.push_back(*pose);
  }
  Resection result;
  best_cost = std::numeric_limits<double>::infinity();
  for (const base::Pose& candidate : starts) {
    pose = candidate;
    int inliers = 0;
    const double cost = cost_of(survey, trial, rays, tolerance_px, &inliers);
    if (cost >= best_cost) continue;
    best_cost = cost;
    result = {candidate, inliers, static_cast<int>(rays.size())};
  }
  if (result.inliers < kLeastRays || 2 * result.inliers < result.rays) return {};
  return result;
}

}  // namespace crosstie::bundle::detail
