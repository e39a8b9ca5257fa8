#include "scan/detail/step_profile.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "scan/detail/small_factor.h"

namespace crosstie::scan::detail {
namespace {

constexpr int kMaxIterations = 20;
constexpr double kBelowBlack = 0.2;     // how far levels may fall below zero, over the highest
constexpr double kLeastDistance = 0.8;  // of two steps, in blurs: of nearer ones only height times distance can be told

using Factor = SmallFactor<kMostSteps + 1>;
using Places = std::array<double, kMostSteps>;
using PlaceFactor = SmallFactor<kMostSteps>;

/// The model at given places, from one pass over the samples: levels solved, and what a change of the places would do.
struct Linear {
  std::array<Factor::Vector, kMostEdgeImages> heights = {};  ///< L_0, L_1 - L_0, ...
  std::array<double, kMostEdgeImages> squares = {};          ///< of the residuals
  std::array<Places, kMostEdgeImages> pulls = {};            ///< d Phi_k / d x_k times the residuals, without its sign
  PlaceFactor::Matrix projected = {};                        ///< products of d Phi_k / d x_k after the levels took their part
  bool good = false;
};

Linear solve(const ProfileSamples& samples, double blur_px, const Places& places, std::size_t k) {
  Linear linear;
  const StepSums sums = sum_steps(samples.for_sums(), blur_px, places.data(), k);
  Factor::Matrix steps = {};  // products of 1, Phi_1, ... with each other
  std::array<Factor::Vector, kMostSteps> cross = {};
  steps[0][0] = static_cast<double>(samples.size());
  for (std::size_t a = 0; a < k; ++a) {
    steps[a + 1][0] = sums.step[a];
    cross[a][0] = sums.slope[a];
    for (std::size_t b = 0; b <= a; ++b) steps[a + 1][b + 1] = sums.steps[a][b];
    for (std::size_t b = 0; b < k; ++b) cross[b][a + 1] = sums.cross[a][b];
  }
  const Factor factor(steps, k + 1);
  if (!factor.pivots_exceed(1e-6)) return linear;
  const auto product = [&](const Factor::Vector& a, const Factor::Vector& b) {
    double sum = 0.0;
    for (std::size_t i = 0; i <= k; ++i) sum += a[i] * b[i];
    return sum;
  };
  for (std::size_t a = 0; a < k; ++a) {
    const Factor::Vector taken = factor.solve(cross[a]);
    for (std::size_t b = 0; b <= a; ++b)
      linear.projected[a][b] = linear.projected[b][a] = sums.slopes[a][b] - product(taken, cross[b]);
  }
  for (std::size_t image = 0; image < samples.images(); ++image) {
    Factor::Vector by_step = {samples.sum(image)};
    for (std::size_t a = 0; a < k; ++a) by_step[a + 1] = sums.by_step[image][a];
    linear.heights[image] = factor.solve(by_step);
    linear.squares[image] = std::max(0.0, samples.squares(image) - product(linear.heights[image], by_step));
    for (std::size_t a = 0; a < k; ++a)
      linear.pulls[image][a] = sums.by_slope[image][a] - product(cross[a], linear.heights[image]);
    linear.heights[image][0] += samples.origin(image);
  }
  linear.good = true;
  return linear;
}

/// Normal equations of the places.
struct Equations {
  PlaceFactor::Matrix normal = {};
  Places right = {};
};

/// With each image's weight.
Equations equations_of(const Linear& linear, std::size_t images, const std::array<double, kMostEdgeImages>& weights,
                       std::size_t k) {
  Equations equations;
  for (std::size_t image = 0; image < images; ++image) {
    const Factor::Vector& heights = linear.heights[image];
    for (std::size_t a = 0; a < k; ++a) {
      equations.right[a] -= weights[image] * heights[a + 1] * linear.pulls[image][a];
      for (std::size_t b = 0; b < k; ++b)
        equations.normal[a][b] += weights[image] * heights[a + 1] * heights[b + 1] * linear.projected[a][b];
    }
  }
  return equations;
}

/// The equations of places of which some are tied: those that are move as one.
class TiedEquations {
 public:
  TiedEquations(const PlaceFactor::Matrix& normal, const std::array<bool, kMostSteps>& tied, std::size_t k)
      : k_(std::min(k, kMostSteps)), group_(groups(tied, k_)), factor_(reduced(normal), group_[k_ - 1] + 1) {}

  [[nodiscard]] bool determined() const { return factor_.pivots_exceed(0.0); }
  [[nodiscard]] Places solve(const Places& right) const {
    Places sums = {};
    for (std::size_t j = 0; j < k_; ++j) sums[group_[j]] += right[j];
    const Places groups = factor_.solve(sums);
    Places result = {};
    for (std::size_t j = 0; j < k_; ++j) result[j] = groups[group_[j]];
    return result;
  }
  [[nodiscard]] Eigen::Matrix3d covariance() const {
    Eigen::Matrix3d cov = Eigen::Matrix3d::Zero();
    for (std::size_t j = 0; j < k_; ++j) {
      Places unit = {};
      unit[j] = 1.0;
      const Places column = solve(unit);
      for (std::size_t i = 0; i < k_; ++i) cov(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j)) = column[i];
    }
    return cov;
  }

 private:
  using Groups = std::array<std::size_t, kMostSteps>;
  static Groups groups(const std::array<bool, kMostSteps>& tied, std::size_t k) {
    Groups groups = {};
    for (std::size_t j = 1; j < k; ++j) groups[j] = groups[j - 1] + (tied[j] ? 0 : 1);
    return groups;
  }
  [[nodiscard]] PlaceFactor::Matrix reduced(const PlaceFactor::Matrix& normal) const {
    PlaceFactor::Matrix matrix = {};
    for (std::size_t a = 0; a < k_; ++a) {
      for (std::size_t b = 0; b < k_; ++b) matrix[group_[a]][group_[b]] += normal[a][b];
    }
    return matrix;
  }

  std::size_t k_;
  Groups group_ = {};
  PlaceFactor factor_;
};

/// One step of Gauss and Newton. Steps that would come nearer to each other than `least` are tied at that distance. Returns the largest
/// move, -1 where the equations have no solution.
double move_places(const Equations& equations, double least, double blur_px, std::size_t k, Places& places,
                   std::array<bool, kMostSteps>& tied) {
  const TiedEquations solved(equations.normal, tied, k);
  if (!solved.determined()) return -1.0;
  Places change = solved.solve(equations.right);
  for (double& one : change) one = std::clamp(one, -0.7 * blur_px, 0.7 * blur_px);
  bool collided = false;
  for (std::size_t j = 1; j < k; ++j) {
    const double distance = places[j] + change[j] - places[j - 1] - change[j - 1];
    if (tied[j] || distance >= least) continue;
    tied[j] = true;
    collided = true;
    const double middle = 0.5 * (places[j] + places[j - 1]);
    places[j - 1] = middle - 0.5 * least;
    places[j] = middle + 0.5 * least;
  }
  if (collided) return 1.0;  // the equations belong to other places now
  double largest = 0.0;
  for (std::size_t j = 0; j < k; ++j) {
    places[j] += change[j];
    largest = std::max(largest, std::abs(change[j]));
  }
  return largest;
}

/// Where the iteration ended.
struct Solution {
  Linear linear;
  Places places = {};
  std::array<bool, kMostSteps> tied = {};            ///< to the one before
  std::array<double, kMostEdgeImages> squares = {};  ///< mean squared residual of each image
  std::array<double, kMostEdgeImages> weights = {};  ///< its inverse, not above the noise's
};

/// Nothing where it does not converge.
std::optional<Solution> iterate(const ProfileSamples& samples, const std::array<double, kMostEdgeImages>& noise_sigma,
                                double blur_px, std::span<const double> start_px, double converged_px) {
  const std::size_t k = start_px.size();
  const auto n = static_cast<double>(samples.size());
  const double freedom = n - static_cast<double>(k + 2);
  if (freedom < 8.0) return std::nullopt;
  const double least = kLeastDistance * blur_px;
  Solution solution;
  Places& places = solution.places;
  std::copy(start_px.begin(), start_px.end(), places.begin());
  std::sort(places.begin(), places.begin() + static_cast<std::ptrdiff_t>(k));
  Places before = {};
  bool just_tied = false;
  double likelihood = -1e300;
  for (int iteration = 0; iteration < kMaxIterations; ++iteration) {
    solution.linear = solve(samples, blur_px, places, k);
    if (!solution.linear.good) return std::nullopt;
    double now = 0.0;
    for (std::size_t image = 0; image < samples.images(); ++image) {
      solution.squares[image] = solution.linear.squares[image] / freedom;
      solution.weights[image] = 1.0 / std::max(solution.squares[image], noise_sigma[image] * noise_sigma[image]);
      now += 0.5 * n * std::log(solution.weights[image]);
    }
    if (now < likelihood - 1e-6 && !just_tied) {
      // Too far: half way back.
      double largest = 0.0;
      for (std::size_t j = 0; j < k; ++j) {
        places[j] = 0.5 * (places[j] + before[j]);
        largest = std::max(largest, std::abs(places[j] - before[j]));
      }
      if (largest < converged_px) return std::nullopt;
      continue;
    }
    likelihood = now;
    before = places;
    const auto tied_before = solution.tied;
    const Equations equations = equations_of(solution.linear, samples.images(), solution.weights, k);
    const double largest = move_places(equations, least, blur_px, k, places, solution.tied);
    if (largest < 0.0) return std::nullopt;
    just_tied = solution.tied != tied_before;
    if (!(places[0] > samples.low_px() + 0.5 && places[k - 1] < samples.high_px() - 0.5)) return std::nullopt;
    if (largest < converged_px) return solution;
  }
  return std::nullopt;
}

}  // namespace

void ProfileSamples::clear() { size_ = images_ = 0; }

void ProfileSamples::grow() {
  const std::size_t room = std::max<std::size_t>(256, 2 * size_);
  across_px_.resize(room);
  for (auto& levels : levels_) levels.resize(room);
}

void ProfileSamples::even_out(double slope_per_px) {
  for (std::size_t i = 0; i < size_; ++i) {
    const double even = 1.0 / (1.0 + slope_per_px * std::min(0.0, across_px_[i]));
    for (std::size_t image = 0; image < kMostEdgeImages; ++image)
      levels_[image][i] = (levels_[image][i] + origins_[image]) * even - origins_[image];
  }
}

void ProfileSamples::finish(std::size_t images) {
  images_ = images;
  low_px_ = 1e9;
  high_px_ = -1e9;
  for (std::size_t i = 0; i < size_; ++i) {
    low_px_ = std::min(low_px_, across_px_[i]);
    high_px_ = std::max(high_px_, across_px_[i]);
  }
  for (std::size_t image = 0; image < images; ++image) {
    sums_[image] = squares_[image] = 0.0;
    for (std::size_t i = 0; i < size_; ++i) {
      sums_[image] += levels_[image][i];
      squares_[image] += levels_[image][i] * levels_[image][i];
    }
  }
  // Room is a multiple of the lanes.
  for (std::size_t i = size_; i % kStepLanes != 0; ++i) {
    across_px_[i] = kBeforeAll_px;
    for (auto& levels : levels_) levels[i] = 0.0;
  }
}

StepSamples ProfileSamples::for_sums() const {
  const std::size_t padded = (size_ + kStepLanes - 1) / kStepLanes * kStepLanes;
  return {across_px_.data(), {levels_[0].data(), levels_[1].data(), levels_[2].data()}, padded, images_};
}

bool fit_steps(const ProfileSamples& samples, const std::array<double, kMostEdgeImages>& noise_sigma, double blur_px,
               std::span<const double> start_px, double converged_px, StepProfile& profile) {
  const auto solution = iterate(samples, noise_sigma, blur_px, start_px, converged_px);
  if (!solution) return false;
  const std::size_t k = start_px.size();
  const std::size_t images = samples.images();
  const Linear& linear = solution->linear;
  const auto& weights = solution->weights;
  profile = {};
  profile.steps = static_cast<int>(k);
  profile.at_px = solution->places;
  std::array<double, kMostEdgeImages> noise_weights = {};
  const auto n = static_cast<double>(samples.size());
  double spread = 0.0, informations = 0.0;
  for (std::size_t image = 0; image < images; ++image) {
    noise_weights[image] = 1.0 / (noise_sigma[image] * noise_sigma[image]);
    profile.rms[image] = std::sqrt(solution->squares[image]);
    profile.log_likelihood += 0.5 * n * std::log(weights[image]);
    const Factor::Vector& heights = linear.heights[image];
    double level = 0.0;
    double highest = 0.0;
    for (std::size_t j = 0; j <= k; ++j) {
      level += heights[j];
      profile.levels[image][j] = level;
      highest = std::max(highest, level);
      if (level < -kBelowBlack * highest) return false;  // steps that undo each other
    }
    // What this image alone would move the first step by, over its sigma.
    const double information = weights[image] * heights[1] * heights[1] * linear.projected[0][0];
    const double pull = weights[image] * heights[1] * linear.pulls[image][0];
    if (information > 0.0) spread += pull * pull / information;
    profile.share[image] = information;
    informations += information;
  }
  for (double& one : profile.share) one = informations > 0.0 ? one / informations : 0.0;
  if (images > 1) profile.disagreement = spread / static_cast<double>(images - 1);
  const TiedEquations by_scatter(equations_of(linear, images, weights, k).normal, solution->tied, k);
  const TiedEquations by_noise(equations_of(linear, images, noise_weights, k).normal, solution->tied, k);
  if (!by_scatter.determined() || !by_noise.determined()) return false;
  profile.cov_px2 = by_scatter.covariance();
  profile.noise_cov_px2 = by_noise.covariance();
  if (k > 1 && solution->tied[1]) {
    // The band's true extent lies between nothing and the least distance, evenly, about the same middle.
    const double least = kLeastDistance * blur_px;
    profile.at_px[0] += 0.25 * least;
    profile.band_variance_px2 = least * least / 48.0;
  }
  return true;
}

StepCandidates step_candidates(const ProfileSamples& samples, double from_px, double to_px, std::size_t count,
                               double least_sigmas) {
  constexpr double kStrip = 0.5;
  constexpr std::size_t kMostStrips = 128;
  const double low = samples.low_px();
  const std::size_t strips =
      std::min(kMostStrips, static_cast<std::size_t>(std::max(0.0, (samples.high_px() - low) / kStrip)) + 1);
  using Strips = std::array<double, kMostStrips>;
  Strips strength = {}, counts = {};
  std::array<Strips, kMostEdgeImages> sums = {}, squares = {};
  for (std::size_t k = 0; k < samples.size(); ++k) {
    const auto at = std::min(strips - 1, static_cast<std::size_t>((samples.across_px(k) - low) / kStrip));
    counts[at] += 1.0;
    for (std::size_t image = 0; image < samples.images(); ++image) {
      const double level = samples.level(image, k);
      sums[image][at] += level;
      squares[image][at] += level * level;
    }
  }
  for (std::size_t i = 2; i + 2 < strips; ++i) {
    // Two strips to each side of a border of strips.
    const double before = counts[i - 1] + counts[i - 2];
    const double after = counts[i] + counts[i + 1];
    if (before < 3.0 || after < 3.0) continue;
    for (std::size_t image = 0; image < samples.images(); ++image) {
      const auto& sum = sums[image];
      const auto& square = squares[image];
      const double a = (sum[i - 1] + sum[i - 2]) / before;
      const double b = (sum[i] + sum[i + 1]) / after;
      const double scatter = square[i - 1] + square[i - 2] - before * a * a + square[i] + square[i + 1] - after * b * b;
      const double variance = std::max(1e-6, scatter / (before + after - 2.0)) * (1.0 / before + 1.0 / after);
      strength[i] += (b - a) * (b - a) / variance;
    }
  }
  // The strongest, in their order; of equal ones the first.
  StepCandidates found;
  Places strengths = {};
  for (std::size_t i = 1; i + 1 < strips; ++i) {
    const double at = low + kStrip * static_cast<double>(i);
    if (at < from_px || at > to_px || strength[i] < least_sigmas * least_sigmas) continue;
    if (strength[i] < strength[i - 1] || strength[i] <= strength[i + 1]) continue;
    std::size_t rank = found.count;
    while (rank > 0 && strengths[rank - 1] < strength[i]) --rank;
    if (rank >= count) continue;
    found.count = std::min(count, found.count + 1);
    for (std::size_t j = found.count - 1; j > rank; --j) {
      strengths[j] = strengths[j - 1];
      found.at_px[j] = found.at_px[j - 1];
    }
    strengths[rank] = strength[i];
    found.at_px[rank] = at;
  }
  if (found.count > 0) found.strongest = std::sqrt(strengths[0]);
  return found;
}

}  // namespace crosstie::scan::detail
