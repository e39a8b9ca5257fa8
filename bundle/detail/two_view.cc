#include "bundle/detail/two_view.h"

#include <cmath>
#include <limits>
#include <optional>

#include <Eigen/Geometry>
#include <Eigen/SVD>

#include "bundle/detail/minimal_solvers.h"
#include "bundle/detail/sampling.h"

namespace crosstie::bundle::detail {
namespace {

using Directions = std::vector<Eigen::Vector3d>;

constexpr int kTrials = 300;  // of five pairs each: with 20 % wrong ones the chance of no clean sample is 1e-52
constexpr std::uint64_t kSeed = 20'040'601;

double homography_error(const Eigen::Matrix3d& h, const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  const Eigen::Vector3d mapped = (h * b).normalized();
  return std::min((mapped - a).squaredNorm(), (mapped + a).squaredNorm());
}

/// Sampson's approximation of the squared angle by which a pair misses the epipolar constraint.
double essential_error(const Eigen::Matrix3d& e, const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  const Eigen::Vector3d line_a = e * b;
  const Eigen::Vector3d line_b = e.transpose() * a;
  const double miss = a.dot(line_a);
  const double weight = line_a.cross(a).squaredNorm() + line_b.cross(b).squaredNorm();
  return weight > 0.0 ? miss * miss / weight : std::numeric_limits<double>::infinity();
}

template <typename Model, typename ErrorOf>
double total_cost(const Model& model, const Directions& a, const Directions& b, double tolerance, const ErrorOf& error) {
  double cost = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i) cost += truncated_cost(error(model, a[i], b[i]), tolerance);
  return cost;
}

std::optional<Eigen::Matrix3d> robust_homography(const Directions& a, const Directions& b, double tolerance) {
  Sampler sampler(static_cast<int>(a.size()), kSeed);
  std::optional<Eigen::Matrix3d> best;
  double best_cost = std::numeric_limits<double>::infinity();
  std::array<int, 4> sample{};
  for (int trial = 0; trial < kTrials; ++trial) {
    sampler.draw(sample);
    Directions some_a;
    Directions some_b;
    for (const int i : sample) {
      some_a.push_back(a[static_cast<std::size_t>(i)]);
      some_b.push_back(b[static_cast<std::size_t>(i)]);
    }
    const Eigen::Matrix3d h = homography(some_a, some_b);
    const double cost = total_cost(h, a, b, tolerance, homography_error);
    if (cost < best_cost) {
      best_cost = cost;
      best = h;
    }
  }
  if (!best) return {};
  Directions inlier_a;
  Directions inlier_b;
  for (std::size_t i = 0; i < a.size(); ++i) {
    if (homography_error(*best, a[i], b[i]) > tolerance * tolerance) continue;
    inlier_a.push_back(a[i]);
    inlier_b.push_back(b[i]);
  }
  if (inlier_a.size() < 5) return {};
  return homography(inlier_a, inlier_b);
}

/// Whether both rays go forwards to where they meet.
bool in_front(const base::Pose& a_from_b, const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  const Eigen::Vector3d turned = a_from_b.rotation * b;
  // s a = r turned + t in least squares.
  Eigen::Matrix<double, 3, 2> m;
  m << a, -turned;
  const Eigen::Vector2d depths = (m.transpose() * m).inverse() * m.transpose() * a_from_b.translation_mm;
  return depths.x() > 0.0 && depths.y() > 0.0;
}

std::optional<base::Pose> robust_essential_motion(const Directions& a, const Directions& b, double tolerance) {
  Sampler sampler(static_cast<int>(a.size()), kSeed);
  std::optional<Eigen::Matrix3d> best;
  double best_cost = std::numeric_limits<double>::infinity();
  std::array<int, 5> sample{};
  for (int trial = 0; trial < kTrials; ++trial) {
    sampler.draw(sample);
    std::array<Eigen::Vector3d, 5> some_a;
    std::array<Eigen::Vector3d, 5> some_b;
    for (std::size_t i = 0; i < sample.size(); ++i) {
      some_a[i] = a[static_cast<std::size_t>(sample[i])];
      some_b[i] = b[static_cast<std::size_t>(sample[i])];
    }
    for (const Eigen::Matrix3d& e : five_point_essentials(some_a, some_b)) {
      const double cost = total_cost(e, a, b, tolerance, essential_error);
      if (cost < best_cost) {
        best_cost = cost;
        best = e;
      }
    }
  }
  if (!best) return {};
  std::optional<base::Pose> chosen;
  int most = 0;
  for (const base::Pose& motion : motions_of_essential(*best)) {
    int front = 0;
    for (std::size_t i = 0; i < a.size(); ++i) {
      const bool inlier = essential_error(*best, a[i], b[i]) < tolerance * tolerance;
      front += inlier && in_front(motion, a[i], b[i]) ? 1 : 0;
    }
    if (front > most) {
      most = front;
      chosen = motion;
    }
  }
  return chosen;
}

}  // namespace

double parallax(const Directions& directions_a, const Directions& directions_b) {
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  for (std::size_t i = 0; i < directions_a.size(); ++i) sum += directions_a[i] * directions_b[i].transpose();
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(sum, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Matrix3d u = svd.matrixU();
  if ((u * svd.matrixV().transpose()).determinant() < 0.0) u.col(2) *= -1.0;
  const Eigen::Matrix3d rotation = u * svd.matrixV().transpose();
  double square = 0.0;
  for (std::size_t i = 0; i < directions_a.size(); ++i) square += (directions_a[i] - rotation * directions_b[i]).squaredNorm();
  return std::sqrt(square / static_cast<double>(directions_a.size()));
}

std::vector<base::Pose> relative_poses(const Directions& directions_a, const Directions& directions_b, double tolerance_rad) {
  std::vector<base::Pose> candidates;
  if (const auto h = robust_homography(directions_a, directions_b, tolerance_rad)) {
    candidates = motions_of_homography(*h, directions_a, directions_b);
  }
  // The essential matrix sees the epipolar direction only, which the lens bends less than the whole direction.
  if (const auto motion = robust_essential_motion(directions_a, directions_b, 0.3 * tolerance_rad))
    candidates.push_back(*motion);
  return candidates;
}

}  // namespace crosstie::bundle::detail
