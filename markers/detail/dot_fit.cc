#include "markers/detail/dot_fit.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include <Eigen/LU>

#include "markers/detail/dot_kernel.h"
#include "markers/detail/dot_noise.h"
#include "markers/detail/dot_pixels.h"
#include "markers/detail/edge_harmonics.h"
#include "markers/detail/light_prior.h"
#include "markers/detail/small_cholesky.h"

namespace crosstie::markers::detail {
namespace {

/// The parameters, lengths in units of the start ellipse's mean radius, in the order of the kernel's columns.
enum Parameter : std::size_t { kCx, kCy, kAxx, kAxy, kAyy, kBlur, kO, kOx, kOy, kI, kIx, kIy };
using State = Eigen::Matrix<double, kDotColumns, 1>;

constexpr double kSmallestBlurPx = 0.28;  // a pixel alone integrates over a box of this standard deviation
constexpr double kRoughlyConvergedPx = 0.1;
constexpr double kConvergedPx = 1e-3;      // what remains after the last step, judged by how steps shrink,
constexpr double kConvergedSigmas = 0.05;  // and the same in standard deviations of the centre: one of both is enough
constexpr double kShrinking = 0.3;         // of the last step, at most, remains
constexpr int kRoughPixels = 112;          // that are enough for the first steps
constexpr int kMaxRoughSteps = 5;          // after the first three
constexpr int kMaxSteps = 12;
constexpr int kMaxAttempts = 4;
constexpr int kMaxRounds = 6;
constexpr int kCollectingRounds = 2;
constexpr int kMaxLooks = 3;           // for a start of about the right size,
constexpr double kGoodScale = 0.15;    // which is this
constexpr double kSmallStepPx = 0.25;  // that need not be watched
constexpr double kHopeless = 0.2;      // RMS of the residuals over the contrast: not a dot

/// What does not change during a fit.
struct Problem {
  PixelSet pixels;
  double saturated_level;
  State start;
};

DotModel model_of(const State& s, double saturated_level) {
  const auto f = [&](int k) { return static_cast<float>(s[k]); };
  return {f(kCx),
          f(kCy),
          f(kAxx),
          f(kAxy),
          f(kAyy),
          f(kBlur),
          f(kO),
          f(kOx),
          f(kOy),
          f(kI),
          f(kIx),
          f(kIy),
          static_cast<float>(saturated_level)};
}

/// What is known beforehand, weakly: undetermined levels of saturated dots, and the blur, stay near their start; light that falls
/// off by some percent per dot radius changes both levels in proportion, and anything else changes them by less.
class Prior {
 public:
  Prior(const State& start, double radius_px, double saturated_level) : start_(start) {
    const double contrast = std::max(std::abs(start[kI] - start[kO]), 1.0);
    level_ = 1.0 / (contrast * contrast);
    const double blur_px = std::max(1.0, start[kBlur] * radius_px);
    blur_ = std::pow(radius_px / blur_px, 2);
    const bool known = std::max(start[kI], start[kO]) < saturated_level;  // else the levels' proportion is not
    const double other = std::pow((known ? kOtherSlopeSigma : kUnknownSlopeSigma) * contrast, 2);
    const double light = kLightSlopeSigma * kLightSlopeSigma;
    Eigen::Matrix2d covariance;
    covariance << light * start[kO] * start[kO] + other, light * start[kO] * start[kI], light * start[kO] * start[kI],
        light * start[kI] * start[kI] + other;
    slopes_ = covariance.inverse();
  }

  /// Adds its normal equations at `state` to the lower triangle of n, stride N, and to b.
  template <std::size_t N>
  void add(const State& state, std::array<double, N * N>& n, std::array<double, N>& b) const {
    n[kI * N + kI] += level_;
    b[kI] += level_ * (start_[kI] - state[kI]);
    n[kBlur * N + kBlur] += blur_;
    b[kBlur] += blur_ * (start_[kBlur] - state[kBlur]);
    for (const std::size_t axis : {1U, 2U}) {
      const std::size_t o = kO + axis;
      const std::size_t i = kI + axis;
      const Eigen::Vector2d pull = -slopes_ * slopes_of(state, axis);
      n[o * N + o] += slopes_(0, 0);
      n[o * N + i] += slopes_(1, 0);
      n[i * N + i] += slopes_(1, 1);
      b[o] += pull[0];
      b[i] += pull[1];
    }
  }

  [[nodiscard]] double cost(const State& state) const {
    double sum = level_ * std::pow(state[kI] - start_[kI], 2) + blur_ * std::pow(state[kBlur] - start_[kBlur], 2);
    for (const std::size_t axis : {1U, 2U}) {
      const Eigen::Vector2d slopes = slopes_of(state, axis);
      sum += slopes.dot(slopes_ * slopes);
    }
    return sum;
  }

 private:
  static Eigen::Vector2d slopes_of(const State& s, std::size_t axis) {
    return {s[static_cast<int>(kO + axis)], s[static_cast<int>(kI + axis)]};
  }

  const State& start_;
  double level_, blur_;
  Eigen::Matrix2d slopes_;  ///< inverse covariance of the outer and the inner level's slope
};

/// Whether this is still the candidate: blur below its radius, area within a factor of two, centre within half a radius.
bool plausible(const State& s, const State& start, double radius_px) {
  const double determinant = s[kAxx] * s[kAyy] - s[kAxy] * s[kAxy];  // 1 / relative area^2
  const double before = start[kAxx] * start[kAyy] - start[kAxy] * start[kAxy];
  return s.allFinite() && s[kBlur] >= 0.999 * kSmallestBlurPx / radius_px && s[kBlur] < 1.0 && s[kAxx] > 0.0 &&
         determinant > 0.25 * before && determinant < 4.0 * before &&
         std::hypot(s[kCx] - start[kCx], s[kCy] - start[kCy]) < 0.5;
}

double step_px(const State& step, double radius_px) {
  return radius_px *
         (std::hypot(step[kCx], step[kCy]) + std::abs(step[kBlur]) + 0.5 * (std::abs(step[kAxx]) + std::abs(step[kAyy])));
}

/// The columns' sums with the prior's: lower triangle and right side.
template <std::size_t N>
void normal_equations(const DotSums& sums, const Prior& prior, const State& state, std::array<double, N * N>& n,
                      std::array<double, N>& b) {
  for (std::size_t column = 0; column < N; ++column) {
    for (std::size_t row = column; row < N; ++row) n[column * N + row] = sums.normal[row * kAllColumns + column];
    b[column] = sums.right[column];
  }
  prior.add<N>(state, n, b);
}

/// How an adjustment ended; the sums belong to the last state whose cost was looked at.
struct Outcome {
  DotSums sums;
  bool converged;
};

/// Levenberg-Marquardt on fixed pixels and fixed weights, until a step moves the edge by less than `converged_px`: that one is
/// taken without a look at its cost.
Outcome adjust(const Problem& problem, double converged_px, int max_steps, State& state) {
  const double radius_px = problem.pixels.radius_px;
  const DotPixels pixels = problem.pixels.view();
  const Prior prior(problem.start, radius_px, problem.saturated_level);
  const auto sums_at = [&](const State& at, DotSums& sums) {
    sum_dot(model_of(at, problem.saturated_level), pixels, nullptr, sums);
    sums.cost += prior.cost(at);
  };
  Outcome outcome{{}, false};
  DotSums tried;
  sums_at(state, outcome.sums);
  double damping = 1e-4;
  for (int step_count = 0; step_count < max_steps; ++step_count) {
    std::array<double, kDotColumns * kDotColumns> n;
    std::array<double, kDotColumns> b;
    normal_equations<kDotColumns>(outcome.sums, prior, state, n, b);
    bool lowered = false;
    for (int attempt = 0; attempt < kMaxAttempts && !lowered; ++attempt) {
      auto damped = n;
      for (std::size_t k = 0; k < kDotColumns; ++k) damped[k * kDotColumns + k] *= 1.0 + damping;
      const SmallCholesky<kDotColumns> root(damped);
      if (root.definite()) {
        const auto step = root.solve(b);
        State next = state + Eigen::Map<const State>(step.data());
        next[kBlur] = std::max(next[kBlur], kSmallestBlurPx / radius_px);
        if (plausible(next, problem.start, radius_px)) {
          if (step_px(next - state, radius_px) < converged_px) {
            state = next;
            outcome.converged = true;
            return outcome;
          }
          sums_at(next, tried);
          if (tried.cost <= outcome.sums.cost) {
            state = next;
            std::swap(outcome.sums, tried);
            lowered = true;
            damping = std::max(damping * 0.1, 1e-9);
          }
        }
      }
      if (!lowered) damping = std::max(damping * 10.0, 1e-4);
    }
    if (!lowered) {  // no step lowers the cost: as good as it gets
      outcome.converged = true;
      return outcome;
    }
  }
  return outcome;
}

/// Whether what is left of the residuals, or the size or blur so far, leave no hope that this is a dot.
bool hopeless(const Outcome& outcome, const Problem& problem, const State& state, const DotFitOptions& options) {
  const double contrast = std::abs(state[kI] - state[kO]);
  const double rms = std::sqrt(outcome.sums.squares / static_cast<double>(problem.pixels.used));
  const double determinant = state[kAxx] * state[kAyy] - state[kAxy] * state[kAxy];
  const double trace = state[kAxx] + state[kAyy];
  const double largest = 0.5 * trace + std::sqrt(std::max(0.25 * trace * trace - determinant, 0.0));
  const double semi_minor_px = problem.pixels.radius_px / std::sqrt(largest);
  return contrast < options.min_contrast || rms > kHopeless * contrast || semi_minor_px < 0.9 * options.min_radius_px ||
         state[kBlur] * problem.pixels.radius_px > 0.8 * semi_minor_px;
}

/// A problem without pixels, in units of the ellipse's mean radius from a whole pixel near its centre on.
Problem problem_of(const Ellipse& ellipse, const DotFitOptions& options) {
  Problem problem{{}, options.saturated_level, State::Zero()};
  problem.pixels.origin_px = ellipse.centre_px.array().round().matrix();
  problem.pixels.radius_px = std::sqrt(ellipse.semi_major_px * ellipse.semi_minor_px);
  return problem;
}

/// Ellipse and blur in those units; levels are left at zero.
State start_state(const Ellipse& ellipse, double blur_px, const PixelSet& pixels) {
  const Eigen::Matrix2d shape = ellipse.shape() * pixels.radius_px * pixels.radius_px;
  State start = State::Zero();
  start.head<2>() = (ellipse.centre_px - pixels.origin_px) / pixels.radius_px;
  start[kAxx] = shape(0, 0);
  start[kAxy] = shape(0, 1);
  start[kAyy] = shape(1, 1);
  start[kBlur] = blur_px / pixels.radius_px;
  return start;
}

/// Median grey level between two rho, of a sample of the pixels.
double median_between(const PixelSet& pixels, const State& s, double from_rho, double to_rho) {
  constexpr std::size_t kSample = 64;
  std::array<float, 2 * kSample> greys;
  std::size_t n = 0;
  for (std::size_t i = 0; i < pixels.used; i += 1 + pixels.used / kSample) {
    const double x = static_cast<double>(pixels.x[i]) - s[kCx];
    const double y = static_cast<double>(pixels.y[i]) - s[kCy];
    const double rho2 = s[kAxx] * x * x + 2.0 * s[kAxy] * x * y + s[kAyy] * y * y;
    if (rho2 >= from_rho * from_rho && rho2 <= to_rho * to_rho) greys[n++] = pixels.grey[i];
  }
  if (n == 0) return 0.0;
  std::nth_element(greys.begin(), greys.begin() + n / 2, greys.begin() + n);
  return static_cast<double>(greys[n / 2]);
}

/// The size, over the start's, at which the pixels pass the middle between both levels. Regions of small blurred dots are larger:
/// they end where the dot stands out of its neighbourhood.
double half_level_scale(const PixelSet& pixels, const State& s) {
  constexpr double kOuter = 1.2;  // what lies beyond may be something else
  const double middle = 0.5 * (s[kI] + s[kO]);
  const bool bright = s[kI] > s[kO];
  double least = kOuter * kOuter;
  int all = 0;
  int inside = 0;
  for (std::size_t i = 0; i < pixels.used; ++i) {
    const double x = static_cast<double>(pixels.x[i]) - s[kCx];
    const double y = static_cast<double>(pixels.y[i]) - s[kCy];
    const double rho2 = s[kAxx] * x * x + 2.0 * s[kAxy] * x * y + s[kAyy] * y * y;
    if (rho2 > kOuter * kOuter) continue;
    least = std::min(least, rho2);
    ++all;
    if ((static_cast<double>(pixels.grey[i]) > middle) == bright) ++inside;
  }
  if (all == 0) return 1.0;
  return std::sqrt(std::max(least + (kOuter * kOuter - least) * inside / all, 0.2));
}

std::optional<Ellipse> ellipse_of(const State& s, const PixelSet& pixels) {
  Eigen::Matrix2d shape;
  shape << s[kAxx], s[kAxy], s[kAxy], s[kAyy];
  return Ellipse::from_shape(pixels.origin_px + pixels.radius_px * s.head<2>(), shape / std::pow(pixels.radius_px, 2));
}

/// Power and amplitude from the normal equations extended by the harmonics; false where they are singular.
bool judge_edge(const DotSums& sums, const Prior& prior, const State& state, double radius_px, DotFit& fit) {
  std::array<double, kAllColumns * kAllColumns> n;
  std::array<double, kAllColumns> b;
  normal_equations<kAllColumns>(sums, prior, state, n, b);
  const SmallCholesky<kAllColumns> root(n);
  if (!root.definite()) return false;
  const EdgeHarmonics harmonics = edge_harmonics(root, b);
  fit.harmonic_power = harmonics.power;
  fit.deviation_px = radius_px * harmonics.amplitude;
  fit.outlier_fraction = sums.edge > 0.0 ? sums.edge_lost / sums.edge : 1.0;
  return true;
}

/// How far out the pixels belong to the gap although the ring shines into it through the blur.
double outer_rho(const DotFitOptions& options, double blur_px, double semi_minor_px) {
  if (options.alone) return options.gap_outer;
  const double gap = options.gap_outer - 1.0;
  if (options.ring != nullptr)
    return options.gap_outer - std::max(0.25 * gap, std::min(0.5 * gap, 0.8 * blur_px / semi_minor_px));
  const double kept_off = std::max(0.3 * gap, 1.8 * blur_px / semi_minor_px);
  return std::max(options.gap_outer - kept_off, 1.0 + std::min(0.6 * gap, blur_px / semi_minor_px));
}

/// Farther from the edge than this, inside or outside, the pixels of large dots say nothing of it.
double depth_px(double blur_px) { return std::max(6.0, 5.0 * blur_px); }

void collect(const base::ImageView& image, const Ellipse& ellipse, const DotFitOptions& options, double blur_px,
             PixelSet& pixels) {
  const double depth = depth_px(blur_px) / ellipse.semi_minor_px;
  pixels.collect(image, ellipse, 1.0 - depth, std::min(outer_rho(options, blur_px, ellipse.semi_minor_px), 1.0 + 2.0 * depth));
  if (options.ring != nullptr) options.ring->take_off(pixels);
}

/// Some pixels of a band around the edge that holds where the start is off by a quarter of the semi-minor axis.
void collect_roughly(const base::ImageView& image, const Ellipse& ellipse, double outer, PixelSet& pixels) {
  const double band = std::max(4.0 / ellipse.semi_minor_px, 0.4);
  const double inner = std::max(1.0 - band, 0.0);
  outer = std::min(outer, 1.0 + band);
  const double count =
      std::numbers::pi * (outer * outer - inner * inner) * ellipse.semi_major_px * ellipse.semi_minor_px / kRoughPixels;
  const int x_step = std::max(1, static_cast<int>(std::lround(std::sqrt(count))));
  const int y_step = std::max(1, static_cast<int>(std::lround(count / x_step)));
  pixels.collect(image, ellipse, inner, outer, x_step, y_step);
}

bool inside_of(const base::ImageView& image, const Ellipse& ellipse) {
  const Eigen::Vector2d half = ellipse.half_extent_px();
  return ellipse.centre_px.x() - half.x() >= 0.5 && ellipse.centre_px.y() - half.y() >= 0.5 &&
         ellipse.centre_px.x() + half.x() <= image.width - 1.5 && ellipse.centre_px.y() + half.y() <= image.height - 1.5;
}

/// The numbers that take an offset from the centre, in the fit's units, to the unit circle.
std::array<float, 4> unit_from_offset(const Ellipse& ellipse, double radius_px) {
  const Eigen::Matrix2d m = radius_px * ellipse.pixel_from_unit().inverse();
  return {static_cast<float>(m(0, 0)), static_cast<float>(m(0, 1)), static_cast<float>(m(1, 0)), static_cast<float>(m(1, 1))};
}

/// Grey levels that residuals may have before the noise is known.
double rough_noise(const State& s) { return std::max(0.03 * std::abs(s[kI] - s[kO]), 1.0); }

/// The undamped step from the state that the sums were taken at.
struct Step {
  SmallCholesky<kDotColumns> root;
  State next;
  double px;  ///< by which it moves the edge
};

std::optional<Step> step_from(const State& state, const DotSums& sums, const Prior& prior, double radius_px) {
  std::array<double, kDotColumns * kDotColumns> n;
  std::array<double, kDotColumns> b;
  normal_equations<kDotColumns>(sums, prior, state, n, b);
  Step step{SmallCholesky<kDotColumns>(n), state, 0.0};
  if (!step.root.definite()) return std::nullopt;
  step.next += Eigen::Map<const State>(step.root.solve(b).data());
  step.next[kBlur] = std::max(step.next[kBlur], kSmallestBlurPx / radius_px);
  step.px = step_px(step.next - state, radius_px);
  return step;
}

DotFit fit_of(const State& s, const Ellipse& ellipse, double radius_px) {
  DotFit fit;
  fit.ellipse = ellipse;
  fit.blur_px = s[kBlur] * radius_px;
  fit.inner_slope = s.segment<2>(kIx) / radius_px;
  fit.outer_slope = s.segment<2>(kOx) / radius_px;
  fit.inner_level = s[kI] + s.segment<2>(kIx).dot(s.head<2>());
  fit.outer_level = s[kO] + s.segment<2>(kOx).dot(s.head<2>());
  return fit;
}

/// Takes the pixels and weights that the state tells, and adjusts until these give no other state. The last step comes with the
/// covariance and the harmonics of the edge from the same sums.
/// From a rough state, the first step has equal weights, since its residuals are not noise yet.
std::optional<DotFit> finish(const base::ImageView& image, const DotFitOptions& options, bool rough, State state,
                             Problem& problem) {
  PixelSet& pixels = problem.pixels;
  const double radius_px = pixels.radius_px;
  const Prior prior(problem.start, radius_px, problem.saturated_level);
  DotSums sums;
  double previous_px = kRoughlyConvergedPx;
  for (int round = 1; round <= kMaxRounds; ++round) {
    const auto ellipse = ellipse_of(state, pixels);
    if (!ellipse || ellipse->semi_minor_px < options.min_radius_px || !inside_of(image, *ellipse)) return std::nullopt;
    // Later rounds keep the pixels, since ever new ones might never give the same state twice.
    if (round <= kCollectingRounds) collect(image, *ellipse, options, state[kBlur] * radius_px, pixels);
    if (pixels.used < 2 * kDotColumns) return std::nullopt;
    for (bool last = round > 1 || !rough;; last = true) {
      const DotModel model = model_of(state, options.saturated_level);
      if (last) {
        pixels.evaluate(model);
        weigh(noise_of(pixels, options.saturated_level), pixels);
      } else {
        weigh_equally(rough_noise(state), pixels);
      }
      sum_dot(model, pixels.view(), last ? unit_from_offset(*ellipse, radius_px).data() : nullptr, sums);
      const auto step = step_from(state, sums, prior, radius_px);
      if (!step) return std::nullopt;
      if (step->px > kSmallStepPx && round < kMaxRounds) {
        adjust(problem, kRoughlyConvergedPx, kMaxSteps, state);
        break;
      }
      if (!plausible(step->next, problem.start, radius_px)) return std::nullopt;
      if (last) {
        const auto cx = step->root.solve({1.0});
        const auto cy = step->root.solve({0.0, 1.0});
        const double remaining_px = step->px * std::min(step->px / std::max(previous_px, 1e-12), kShrinking);
        const double sigma_px = radius_px * std::sqrt(0.5 * (cx[0] + cy[1]));
        if (remaining_px > std::max(kConvergedPx, kConvergedSigmas * sigma_px) && round < kMaxRounds) {
          previous_px = step->px;
          state = step->next;
          break;
        }
        const auto found = ellipse_of(step->next, pixels);
        if (!found) return std::nullopt;
        DotFit fit = fit_of(step->next, *found, radius_px);
        fit.cov_px2 << cx[0], cx[1], cx[1], cy[1];
        fit.cov_px2 *= radius_px * radius_px;
        fit.residual = std::sqrt(sums.squares / static_cast<double>(pixels.used));
        if (!judge_edge(sums, prior, state, radius_px, fit)) return std::nullopt;
        return fit;
      }
      previous_px = step->px;
      state = step->next;
    }
  }
  return std::nullopt;
}

}  // namespace

std::optional<DotFit> fit_dot(const Sampler& sampler, const Ellipse& candidate, const DotFitOptions& options) {
  const base::ImageView& image = sampler.image();
  Problem problem = problem_of(candidate, options);
  PixelSet& pixels = problem.pixels;
  Ellipse ellipse = candidate;
  for (int look = 1;; ++look) {
    const double blur_px = std::min(options.start_error_px, 0.3 * ellipse.semi_minor_px);
    const double reach = outer_rho(options, blur_px, ellipse.semi_minor_px);
    collect_roughly(image, ellipse, reach, pixels);
    if (pixels.used < 2 * kDotColumns) return std::nullopt;
    problem.start = start_state(ellipse, blur_px, pixels);
    problem.start[kO] = median_between(pixels, problem.start, std::min(1.0 + 1.5 / ellipse.semi_minor_px, reach - 0.15), 9.0);
    problem.start[kI] = median_between(pixels, problem.start, 0.0, 0.8);
    if (std::abs(problem.start[kI] - problem.start[kO]) < 0.5 * options.min_contrast) return std::nullopt;
    const double scale = half_level_scale(pixels, problem.start);
    if (look == kMaxLooks || std::abs(scale - 1.0) < kGoodScale) break;
    ellipse.semi_major_px *= scale;
    ellipse.semi_minor_px *= scale;
  }
  State state = problem.start;
  weigh_equally(rough_noise(state), pixels);
  // Few steps tell what cannot be a dot.
  const int patience = options.start_error_px > 1.0 ? 3 * kMaxRoughSteps : kMaxRoughSteps;
  for (const int steps : {3, patience}) {
    const Outcome outcome = adjust(problem, kRoughlyConvergedPx, steps, state);
    if (hopeless(outcome, problem, state, options)) return std::nullopt;
    if (outcome.converged) break;
    if (steps == patience) return std::nullopt;
  }
  return finish(image, options, true, state, problem);
}

std::optional<DotFit> refine_dot(const Sampler& sampler, const DotFit& earlier, const DotFitOptions& options) {
  Problem problem = problem_of(earlier.ellipse, options);
  problem.start = start_state(earlier.ellipse, earlier.blur_px, problem.pixels);
  const auto centre = problem.start.head<2>();
  problem.start.segment<2>(kOx) = problem.pixels.radius_px * earlier.outer_slope;
  problem.start.segment<2>(kIx) = problem.pixels.radius_px * earlier.inner_slope;
  problem.start[kO] = earlier.outer_level - problem.start.segment<2>(kOx).dot(centre);
  problem.start[kI] = earlier.inner_level - problem.start.segment<2>(kIx).dot(centre);
  return finish(sampler.image(), options, false, problem.start, problem);
}

}  // namespace crosstie::markers::detail
