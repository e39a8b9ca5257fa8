#include "scan/detail/step_profile.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>

#include "math/edge_profile.h"

namespace crosstie::scan::detail {
namespace {

constexpr int kMaxIterations = 20;
constexpr double kConverged_px = 1e-3;
constexpr double kBelowBlack = 0.2;     // how far levels may fall below zero, over the highest
constexpr double kLeastDistance = 0.8;  // of two steps, in blurs: of nearer ones only height times distance can be told

using Normal = Eigen::Matrix<double, kMostSteps + 1, kMostSteps + 1>;
using Groups = Eigen::Matrix<double, kMostSteps, kMostSteps>;
using Column = Eigen::Matrix<double, kMostSteps + 1, 1>;

/// The model at given places, from one pass over the samples: levels solved, and what a change of the places would do.
struct Linear {
  std::array<Column, kMostEdgeImages> heights;       ///< L_0, L_1 - L_0, ...
  std::array<double, kMostEdgeImages> squares = {};  ///< of the residuals
  std::array<Column, kMostEdgeImages> pulls;         ///< d Phi_k / d x_k times the residuals, without its sign
  Normal projected;                                  ///< products of d Phi_k / d x_k after the levels took their part
  bool good = false;
};

Linear solve(std::span<const ProfileSample> samples, std::size_t images, double blur_px, std::span<const double> places) {
  Linear linear;
  const auto k = static_cast<Eigen::Index>(places.size());
  Normal steps = Normal::Zero();   // products of 1, Phi_1, ... with each other
  Normal cross = Normal::Zero();   // with the slopes
  Normal slopes = Normal::Zero();  // of the slopes with each other
  std::array<Column, kMostEdgeImages> by_step, by_slope;
  by_step.fill(Column::Zero());
  by_slope.fill(Column::Zero());
  std::array<double, kMostEdgeImages> own = {};
  const std::array<double, kMostEdgeImages> origin = samples.front().levels;  // keeps the sums of squares small
  std::array<double, kMostSteps + 1> g = {1.0};
  std::array<double, kMostSteps> p = {};
  const double scale = 1.0 / blur_px;
  for (const ProfileSample& sample : samples) {
    for (std::size_t j = 0; j < places.size(); ++j) {
      const math::EdgeProfile profile = math::edge_profile((sample.across_px - places[j]) * scale);
      g[j + 1] = profile.distribution;
      p[j] = profile.density * scale;
    }
    for (Eigen::Index a = 0; a <= k; ++a) {
      for (Eigen::Index b = 0; b <= a; ++b) steps(a, b) += g[static_cast<std::size_t>(a)] * g[static_cast<std::size_t>(b)];
      for (Eigen::Index b = 0; b < k; ++b) cross(a, b) += g[static_cast<std::size_t>(a)] * p[static_cast<std::size_t>(b)];
    }
    for (Eigen::Index a = 0; a < k; ++a) {
      for (Eigen::Index b = 0; b <= a; ++b) slopes(a, b) += p[static_cast<std::size_t>(a)] * p[static_cast<std::size_t>(b)];
    }
    for (std::size_t image = 0; image < images; ++image) {
      const double level = sample.levels[image] - origin[image];
      own[image] += level * level;
      for (Eigen::Index a = 0; a <= k; ++a) by_step[image](a) += g[static_cast<std::size_t>(a)] * level;
      for (Eigen::Index a = 0; a < k; ++a) by_slope[image](a) += p[static_cast<std::size_t>(a)] * level;
    }
  }
  // Unused steps get a unit on the diagonal.
  for (Eigen::Index a = k + 1; a <= kMostSteps; ++a) steps(a, a) = 1.0;
  const Normal full = steps.selfadjointView<Eigen::Lower>();
  const Eigen::LDLT<Normal> factor(full);
  if (factor.vectorD().minCoeff() < 1e-6) return linear;
  const Normal slopes_full = slopes.selfadjointView<Eigen::Lower>();
  linear.projected = slopes_full - cross.transpose() * factor.solve(cross);
  for (std::size_t image = 0; image < images; ++image) {
    linear.heights[image] = factor.solve(by_step[image]);
    linear.squares[image] = std::max(0.0, own[image] - linear.heights[image].dot(by_step[image]));
    linear.pulls[image] = by_slope[image] - cross.transpose() * linear.heights[image];
    linear.heights[image](0) += origin[image];
  }
  linear.good = true;
  return linear;
}

/// Normal equations of the places with each image's weight.
void accumulate(const Linear& linear, std::size_t images, const std::array<double, kMostEdgeImages>& weights, Eigen::Index k,
                Eigen::Matrix3d& normal, Eigen::Vector3d& right) {
  normal.setZero();
  right.setZero();
  for (std::size_t image = 0; image < images; ++image) {
    const Column& heights = linear.heights[image];
    for (Eigen::Index a = 0; a < k; ++a) {
      right(a) -= weights[image] * heights(a + 1) * linear.pulls[image](a);
      for (Eigen::Index b = 0; b < k; ++b)
        normal(a, b) += weights[image] * heights(a + 1) * heights(b + 1) * linear.projected(a, b);
    }
  }
  for (Eigen::Index a = k; a < kMostSteps; ++a) normal(a, a) = 1.0;  // steps that there are not
}

/// Steps that are tied move as one: a column for each group.
Groups groups_of(std::size_t count, const std::array<bool, kMostSteps>& tied) {
  Groups groups = Groups::Zero();
  Eigen::Index group = -1;
  for (std::size_t j = 0; j < count; ++j) {
    if (!tied[j]) ++group;
    groups(static_cast<Eigen::Index>(j), group) = 1.0;
  }
  for (Eigen::Index j = static_cast<Eigen::Index>(count); j < kMostSteps; ++j) groups(j, ++group) = 1.0;
  return groups;
}

/// The covariance of places of which some are tied; a zero matrix where they are not determined.
Eigen::Matrix3d tied_covariance(const Eigen::Matrix3d& normal, const Groups& groups) {
  Eigen::Matrix3d reduced = groups.transpose() * normal * groups;
  for (Eigen::Index j = 0; j < kMostSteps; ++j) {
    if (reduced(j, j) == 0.0) reduced(j, j) = 1.0;  // no such group
  }
  const Eigen::LDLT<Eigen::Matrix3d> factor(reduced);
  if (!(factor.vectorD().minCoeff() > 0.0)) return Eigen::Matrix3d::Zero();
  return groups * factor.solve(Eigen::Matrix3d(groups.transpose()));
}

/// One step of Gauss and Newton. Steps that would come nearer to each other than `least` are tied at that distance. Returns the largest
/// move, -1 where the equations have no solution.
double move_places(const Eigen::Matrix3d& normal, const Eigen::Vector3d& right, double least, double blur_px,
                   std::vector<double>& places, std::array<bool, kMostSteps>& tied) {
  const Eigen::Matrix3d cov = tied_covariance(normal, groups_of(places.size(), tied));
  if (cov.isZero(0.0)) return -1.0;
  const Eigen::Vector3d change = (cov * right).cwiseMax(-0.7 * blur_px).cwiseMin(0.7 * blur_px);
  bool collided = false;
  for (std::size_t j = 1; j < places.size(); ++j) {
    const double distance =
        places[j] + change(static_cast<Eigen::Index>(j)) - places[j - 1] - change(static_cast<Eigen::Index>(j) - 1);
    if (tied[j] || distance >= least) continue;
    tied[j] = true;
    collided = true;
    const double middle = 0.5 * (places[j] + places[j - 1]);
    places[j - 1] = middle - 0.5 * least;
    places[j] = middle + 0.5 * least;
  }
  if (collided) return 1.0;  // the equations belong to other places now
  double largest = 0.0;
  for (std::size_t j = 0; j < places.size(); ++j) {
    places[j] += change(static_cast<Eigen::Index>(j));
    largest = std::max(largest, std::abs(change(static_cast<Eigen::Index>(j))));
  }
  return largest;
}

}  // namespace

bool fit_steps(std::span<const ProfileSample> samples, std::size_t images,
               const std::array<double, kMostEdgeImages>& noise_sigma, double blur_px, std::span<const double> start_px,
               StepProfile& profile) {
  const std::size_t k = start_px.size();
  const double freedom = static_cast<double>(samples.size()) - static_cast<double>(k + 2);
  if (freedom < 8.0) return false;
  std::vector<double> places(start_px.begin(), start_px.end());
  std::sort(places.begin(), places.end());
  double low = 1e9, high = -1e9;
  for (const ProfileSample& sample : samples) {
    low = std::min(low, sample.across_px);
    high = std::max(high, sample.across_px);
  }
  Linear linear;
  std::array<double, kMostEdgeImages> weights = {};
  std::array<double, kMostEdgeImages> squares = {};
  Eigen::Matrix3d normal;
  Eigen::Vector3d right;
  bool converged = false;
  bool just_tied = false;
  std::vector<double> before;
  std::array<bool, kMostSteps> tied = {};  // to the one before
  const double least = kLeastDistance * blur_px;
  double likelihood = -1e300;
  for (int iteration = 0; iteration < kMaxIterations && !converged; ++iteration) {
    linear = solve(samples, images, blur_px, places);
    if (!linear.good) return false;
    for (std::size_t image = 0; image < images; ++image) {
      squares[image] = linear.squares[image] / freedom;
      weights[image] = 1.0 / std::max(squares[image], noise_sigma[image] * noise_sigma[image]);
    }
    double now = 0.0;
    for (std::size_t image = 0; image < images; ++image)
      now += 0.5 * static_cast<double>(samples.size()) * std::log(weights[image]);
    if (now < likelihood - 1e-6 && !just_tied) {
      // Too far: half way back.
      double largest = 0.0;
      for (std::size_t j = 0; j < k; ++j) {
        places[j] = 0.5 * (places[j] + before[j]);
        largest = std::max(largest, std::abs(places[j] - before[j]));
      }
      if (largest < kConverged_px) return false;
      continue;
    }
    likelihood = now;
    before = places;
    const auto tied_before = tied;
    accumulate(linear, images, weights, static_cast<Eigen::Index>(k), normal, right);
    const double largest = move_places(normal, right, least, blur_px, places, tied);
    if (largest < 0.0) return false;
    just_tied = tied != tied_before;
    if (!(places.front() > low + 0.5 && places.back() < high - 0.5)) return false;
    converged = largest < kConverged_px;
  }
  if (!converged) return false;

  profile = {};
  profile.steps = static_cast<int>(k);
  std::copy(places.begin(), places.end(), profile.at_px.begin());
  const Groups groups = groups_of(k, tied);
  profile.cov_px2 = tied_covariance(normal, groups);
  std::array<double, kMostEdgeImages> noise_weights = {};
  const auto n = static_cast<double>(samples.size());
  double spread = 0.0;
  for (std::size_t image = 0; image < images; ++image) {
    noise_weights[image] = 1.0 / (noise_sigma[image] * noise_sigma[image]);
    profile.rms[image] = std::sqrt(squares[image]);
    profile.log_likelihood += 0.5 * n * std::log(weights[image]);
    const Column& heights = linear.heights[image];
    double level = 0.0;
    double highest = 0.0;
    for (std::size_t j = 0; j <= k; ++j) {
      level += heights(static_cast<Eigen::Index>(j));
      profile.levels[image][j] = level;
      highest = std::max(highest, level);
      if (level < -kBelowBlack * highest) return false;  // steps that undo each other
    }
    // What this image alone would move the first step by, over its sigma.
    const double information = weights[image] * heights(1) * heights(1) * linear.projected(0, 0);
    const double pull = weights[image] * heights(1) * linear.pulls[image](0);
    if (information > 0.0) spread += pull * pull / information;
  }
  if (images > 1) profile.disagreement = spread / static_cast<double>(images - 1);
  Eigen::Matrix3d noise_normal;
  accumulate(linear, images, noise_weights, static_cast<Eigen::Index>(k), noise_normal, right);
  profile.noise_cov_px2 = tied_covariance(noise_normal, groups);
  if (profile.cov_px2.isZero(0.0) || profile.noise_cov_px2.isZero(0.0)) return false;
  if (k > 1 && tied[1]) {
    // The band's true extent lies between nothing and `least`, evenly, about the same middle.
    profile.at_px[0] += 0.25 * least;
    profile.band_variance_px2 = least * least / 48.0;
  }
  return true;
}

std::vector<double> step_candidates(std::span<const ProfileSample> samples, std::size_t images, double from_px, double to_px,
                                    std::size_t count, double least_sigmas) {
  constexpr double kStrip = 0.5;
  double low = 1e9, high = -1e9;
  for (const ProfileSample& sample : samples) {
    low = std::min(low, sample.across_px);
    high = std::max(high, sample.across_px);
  }
  const auto strips = static_cast<std::size_t>(std::max(0.0, (high - low) / kStrip)) + 1;
  std::vector<double> strength(strips, 0.0);
  for (std::size_t image = 0; image < images; ++image) {
    std::vector<double> sums(strips, 0.0), squares(strips, 0.0), counts(strips, 0.0);
    for (const ProfileSample& sample : samples) {
      const auto at = std::min(strips - 1, static_cast<std::size_t>((sample.across_px - low) / kStrip));
      sums[at] += sample.levels[image];
      squares[at] += sample.levels[image] * sample.levels[image];
      counts[at] += 1.0;
    }
    for (std::size_t i = 2; i + 2 < strips; ++i) {
      // Two strips to each side of a border of strips.
      const double before = counts[i - 1] + counts[i - 2];
      const double after = counts[i] + counts[i + 1];
      if (before < 3.0 || after < 3.0) continue;
      const double a = (sums[i - 1] + sums[i - 2]) / before;
      const double b = (sums[i] + sums[i + 1]) / after;
      const double scatter = squares[i - 1] + squares[i - 2] - before * a * a + squares[i] + squares[i + 1] - after * b * b;
      const double variance = std::max(1e-6, scatter / (before + after - 2.0)) * (1.0 / before + 1.0 / after);
      strength[i] += (b - a) * (b - a) / variance;
    }
  }
  std::vector<std::pair<double, double>> found;
  for (std::size_t i = 1; i + 1 < strips; ++i) {
    const double at = low + kStrip * static_cast<double>(i);
    if (at < from_px || at > to_px || strength[i] < least_sigmas * least_sigmas) continue;
    if (strength[i] < strength[i - 1] || strength[i] <= strength[i + 1]) continue;
    found.emplace_back(-strength[i], at);
  }
  std::sort(found.begin(), found.end());
  std::vector<double> places;
  for (const auto& [order, at] : found) {
    if (places.size() == count) break;
    places.push_back(at);
  }
  return places;
}

}  // namespace crosstie::scan::detail
