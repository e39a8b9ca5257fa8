// Spheres of a known diameter in a cloud: find_spheres of verify/acceptance.h.
#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include <Eigen/Cholesky>

#include "verify/acceptance.h"

namespace crosstie::verify {
namespace {

using Eigen::Vector3d;
using Cell = std::array<long, 3>;

constexpr std::size_t kMostPoints = 400;   // of a local fit
constexpr std::size_t kFewestPoints = 40;  // of a sphere that is taken for one
constexpr double kRadius = 0.15;           // share by which a local fit may miss the radius
constexpr double kScatter = 0.05;          // of its points, over the radius

struct Candidate {
  Vector3d centre;
  std::size_t support = 0;
};

/// x'x = 2 c'x + d by least squares about the points' centroid; radius 0 where they do not tell.
std::pair<Vector3d, double> algebraic_sphere(const std::vector<Vector3d>& points) {
  Vector3d mean = Vector3d::Zero();
  for (const Vector3d& p : points) mean += p / static_cast<double>(points.size());
  Eigen::Matrix4d normal = Eigen::Matrix4d::Zero();
  Eigen::Vector4d right = Eigen::Vector4d::Zero();
  for (const Vector3d& p : points) {
    const Vector3d q = p - mean;
    const Eigen::Vector4d row(2.0 * q.x(), 2.0 * q.y(), 2.0 * q.z(), 1.0);
    normal += row * row.transpose();
    right += q.squaredNorm() * row;
  }
  const Eigen::Vector4d x = normal.ldlt().solve(right);
  const double square = x(3) + x.head<3>().squaredNorm();
  if (!x.allFinite() || !(square > 0.0)) return {Vector3d::Zero(), 0.0};
  return {mean + x.head<3>(), std::sqrt(square)};
}

class Grid {
 public:
  Grid(const std::vector<Vector3d>& points, double edge) : points_(points), edge_(edge) {
    for (std::size_t i = 0; i < points.size(); ++i) cells_[cell(points[i])].push_back(i);
  }
  [[nodiscard]] const std::map<Cell, std::vector<std::size_t>>& cells() const { return cells_; }
  /// Indices of the points in the cells within `reach` cells of a place.
  [[nodiscard]] std::vector<std::size_t> about(const Vector3d& p, long reach) const {
    std::vector<std::size_t> result;
    const Cell c = cell(p);
    for (long x = -reach; x <= reach; ++x) {
      for (long y = -reach; y <= reach; ++y) {
        for (long z = -reach; z <= reach; ++z) {
          const auto found = cells_.find({c[0] + x, c[1] + y, c[2] + z});
          if (found != cells_.end()) result.insert(result.end(), found->second.begin(), found->second.end());
        }
      }
    }
    return result;
  }

 private:
  [[nodiscard]] Cell cell(const Vector3d& p) const {
    return {std::lround(std::floor(p.x() / edge_)), std::lround(std::floor(p.y() / edge_)),
            std::lround(std::floor(p.z() / edge_))};
  }
  const std::vector<Vector3d>& points_;
  double edge_;
  std::map<Cell, std::vector<std::size_t>> cells_;
};

}  // namespace

std::vector<Vector3d> find_spheres(const base::Cloud& cloud, double diameter_mm) {
  const double radius = 0.5 * diameter_mm;
  const Grid grid(cloud.points, radius);
  std::vector<Candidate> candidates;
  for (const auto& [cell, members] : grid.cells()) {
    if (members.size() < 4) continue;
    const Vector3d& seed = cloud.points[members[members.size() / 2]];
    std::vector<Vector3d> near;
    for (const std::size_t i : grid.about(seed, 1)) {
      if ((cloud.points[i] - seed).norm() < 0.9 * radius) near.push_back(cloud.points[i]);
    }
    if (near.size() < kFewestPoints) continue;
    std::vector<Vector3d> few;
    for (std::size_t k = 0; k < near.size(); k += std::max<std::size_t>(1, near.size() / kMostPoints)) few.push_back(near[k]);
    Candidate candidate;
    bool good = false;
    // From the neighbourhood to the whole sphere, leaving out what is off it.
    for (int round = 0; round < 5; ++round) {
      const auto [centre, found] = algebraic_sphere(few);
      good = std::abs(found - radius) < (round == 0 ? 2.0 : 1.0) * kRadius * radius;
      if (!good) break;
      double squares = 0.0;
      for (const Vector3d& p : few) squares += std::pow((p - centre).norm() - found, 2);
      good = std::sqrt(squares / static_cast<double>(few.size())) < kScatter * radius;
      if (!good) break;
      std::vector<Vector3d> on;
      for (const std::size_t i : grid.about(centre, 2)) {
        if (std::abs((cloud.points[i] - centre).norm() - radius) < 2.0 * kScatter * radius) on.push_back(cloud.points[i]);
      }
      candidate = {centre, on.size()};
      good = on.size() >= kFewestPoints;
      if (!good) break;
      few.clear();
      for (std::size_t k = 0; k < on.size(); k += std::max<std::size_t>(1, on.size() / kMostPoints)) few.push_back(on[k]);
    }
    if (good) candidates.push_back(candidate);
  }
  std::stable_sort(candidates.begin(), candidates.end(), [](const auto& a, const auto& b) { return a.support > b.support; });
  std::vector<Vector3d> centres;
  for (const Candidate& candidate : candidates) {
    const bool known =
        std::any_of(centres.begin(), centres.end(), [&](const Vector3d& c) { return (c - candidate.centre).norm() < radius; });
    if (!known) centres.push_back(candidate.centre);
  }
  return centres;
}

}  // namespace crosstie::verify
