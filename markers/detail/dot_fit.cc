#include "markers/detail/dot_fit.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include <Eigen/Cholesky>
#include <Eigen/LU>

#include "markers/detail/dot_kernel.h"
#include "markers/detail/dot_noise.h"
#include "markers/detail/dot_pixels.h"
#include "markers/detail/edge_profile.h"

namespace crosstie::markers::detail {
namespace {

/// The parameters, lengths in units of the start ellipse's mean radius, in the order of the kernel's columns.
enum Parameter { kCx, kCy, kAxx, kAxy, kAyy, kBlur, kO, kOx, kOy, kI, kIx, kIy };
using State = Eigen::Matrix<double, kDotColumns, 1>;
using Normal = Eigen::Matrix<double, kDotColumns, kDotColumns>;
using AllNormal = Eigen::Matrix<double, kAllColumns, kAllColumns>;
using AllRight = Eigen::Matrix<double, kAllColumns, 1>;

constexpr double kSmallestBlurPx = 0.28;  // a pixel alone integrates over a box of this standard deviation
constexpr double kSlopeSigma = 0.02;      // a priori: change of a level per dot radius, of the contrast
constexpr double kRoughlyConvergedPx = 0.05;
constexpr double kConvergedPx = 2e-3;  // of the last step; what remains after it is a small part of that
constexpr int kMaxIterations = 20;
constexpr double kHopeless = 0.3;  // RMS of the residuals over the contrast: not a dot

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

/// Weights of what is known beforehand: the levels' slopes are near zero; undetermined levels of saturated dots, and the blur,
/// stay near their start, weakly.
State prior_weights(const State& start, double radius_px) {
  State weights = State::Zero();
  const double contrast = std::max(std::abs(start[kI] - start[kO]), 1.0);
  for (const int k : {kOx, kOy, kIx, kIy}) weights[k] = 1.0 / std::pow(kSlopeSigma * contrast, 2);
  weights[kI] = 1.0 / (contrast * contrast);
  weights[kBlur] = radius_px * radius_px;
  return weights;
}

/// Where the prior pulls to: slopes of zero, the start's values.
State prior_residual(const State& state, const State& start) {
  State r = start - state;
  for (const int k : {kOx, kOy, kIx, kIy}) r[k] = -state[k];
  return r;
}

/// Whether this is still the candidate: blur below its radius, area within a factor of two, centre within half a radius.
bool plausible(const State& s, const State& start, double radius_px) {
  const double determinant = s[kAxx] * s[kAyy] - s[kAxy] * s[kAxy];  // 1 / relative area^2
  return s.allFinite() && s[kBlur] >= 0.999 * kSmallestBlurPx / radius_px && s[kBlur] < 1.0 && s[kAxx] > 0.0 &&
         determinant > 0.25 && determinant < 4.0 && std::hypot(s[kCx] - start[kCx], s[kCy] - start[kCy]) < 0.5;
}

double step_px(const State& step, double radius_px) {
  return radius_px *
         (std::hypot(step[kCx], step[kCy]) + std::abs(step[kBlur]) + 0.5 * (std::abs(step[kAxx]) + std::abs(step[kAyy])));
}

/// Levenberg-Marquardt on fixed pixels and fixed weights, until a step moves the edge by less than `converged_px`; that one is
/// taken without a look at its cost. Returns the sums at the last state that was looked at.
DotSums adjust(const Problem& problem, double converged_px, int max_iterations, State& state) {
  const double radius_px = problem.pixels.radius_px;
  const DotPixels pixels = problem.pixels.view();
  const State weights = prior_weights(problem.start, radius_px);
  const auto sums_at = [&](const State& at, DotSums& sums) {
    sum_dot(model_of(at, problem.saturated_level), pixels, nullptr, sums);
    const State r = prior_residual(at, problem.start);
    sums.cost += r.cwiseAbs2().dot(weights);
  };
  DotSums sums, tried;
  sums_at(state, sums);
  double damping = 1e-4;
  for (int iteration = 0; iteration < max_iterations; ++iteration) {
    Normal n = Eigen::Map<const AllNormal>(sums.normal).topLeftCorner<kDotColumns, kDotColumns>();
    n.diagonal() += weights;
    const State b = Eigen::Map<const State>(sums.right) + weights.cwiseProduct(prior_residual(state, problem.start));
    bool lowered = false;
    for (int attempt = 0; attempt < 8 && !lowered; ++attempt) {
      Normal damped = n;
      damped.diagonal() *= 1.0 + damping;
      const State step = damped.selfadjointView<Eigen::Upper>().llt().solve(b);
      State next = state + step;
      next[kBlur] = std::max(next[kBlur], kSmallestBlurPx / radius_px);
      if (plausible(next, problem.start, radius_px)) {
        if (step_px(next - state, radius_px) < converged_px) {
          state = next;
          return sums;
        }
        sums_at(next, tried);
        if (tried.cost <= sums.cost) {
          state = next;
          std::swap(sums, tried);
          lowered = true;
          damping = std::max(damping * 0.1, 1e-9);
        }
      }
      if (!lowered) damping = std::max(damping * 10.0, 1e-4);
    }
    if (!lowered) return sums;  // no step lowers the cost: as good as it gets
  }
  return sums;
}

double median_between(const PixelSet& pixels, const Eigen::Matrix2d& shape, double from_rho, double to_rho) {
  std::vector<float> greys;
  greys.reserve(pixels.used);
  for (std::size_t i = 0; i < pixels.used; ++i) {
    const double x = static_cast<double>(pixels.x[i]);
    const double y = static_cast<double>(pixels.y[i]);
    const double rho2 = shape(0, 0) * x * x + 2.0 * shape(0, 1) * x * y + shape(1, 1) * y * y;
    if (rho2 >= from_rho * from_rho && rho2 <= to_rho * to_rho) greys.push_back(pixels.grey[i]);
  }
  if (greys.empty()) return 0.0;
  const auto middle = greys.begin() + static_cast<std::ptrdiff_t>(greys.size() / 2);
  std::nth_element(greys.begin(), middle, greys.end());
  return static_cast<double>(*middle);
}

std::optional<Ellipse> ellipse_of(const State& s, const PixelSet& pixels) {
  Eigen::Matrix2d shape;
  shape << s[kAxx], s[kAxy], s[kAxy], s[kAyy];
  return Ellipse::from_shape(pixels.origin_px + pixels.radius_px * s.head<2>(), shape / std::pow(pixels.radius_px, 2));
}

/// Covariance of the centre and the power of the harmonics 3..5, from the normal equations extended by them.
void judge_edge(const Problem& problem, const State& state, DotFit& fit) {
  const double radius_px = problem.pixels.radius_px;
  const Eigen::Matrix2d to_unit = radius_px * fit.ellipse.pixel_from_unit().inverse();
  const float unit[4] = {static_cast<float>(to_unit(0, 0)), static_cast<float>(to_unit(0, 1)),
                         static_cast<float>(to_unit(1, 0)), static_cast<float>(to_unit(1, 1))};
  DotSums sums;
  sum_dot(model_of(state, problem.saturated_level), problem.pixels.view(), unit, sums);
  AllNormal n = Eigen::Map<const AllNormal>(sums.normal);
  AllRight b = Eigen::Map<const AllRight>(sums.right);
  const State weights = prior_weights(problem.start, radius_px);
  n.diagonal().head<kDotColumns>() += weights;
  b.head<kDotColumns>() += weights.cwiseProduct(prior_residual(state, problem.start));
  const Normal inner = n.topLeftCorner<kDotColumns, kDotColumns>();
  const Eigen::LLT<Normal, Eigen::Upper> inner_root(inner);
  const Eigen::Matrix<double, kDotColumns, 2> first_two = Eigen::Matrix<double, kDotColumns, 2>::Identity();
  fit.cov_px2 = radius_px * radius_px * inner_root.solve(first_two).topRows<2>();
  // With N = L L' and y = L^-1 b, the amplitudes are the solution of L_hh' a = y_h, and a' Q_aa^-1 a = y_h' y_h.
  const Eigen::LLT<AllNormal, Eigen::Upper> root(n);
  const AllRight y = root.matrixL().solve(b);
  const Eigen::Matrix<double, kEdgeHarmonics, 1> y_h = y.tail<kEdgeHarmonics>();
  fit.harmonic_power = y_h.squaredNorm() / kEdgeHarmonics;
  const Eigen::Matrix<double, kEdgeHarmonics, kEdgeHarmonics> upper =
      Eigen::Matrix<double, kAllColumns, kAllColumns>(root.matrixU()).bottomRightCorner<kEdgeHarmonics, kEdgeHarmonics>();
  const Eigen::Matrix<double, kEdgeHarmonics, 1> amplitudes = radius_px * upper.triangularView<Eigen::Upper>().solve(y_h);
  for (int h = 0; h < kEdgeHarmonics / 2; ++h) {
    fit.deviation_px = std::max(fit.deviation_px, std::hypot(amplitudes[2 * h], amplitudes[2 * h + 1]));
  }
  fit.residual = std::sqrt(sums.squares / static_cast<double>(problem.pixels.used));
  fit.outlier_fraction = sums.edge > 0.0 ? sums.edge_lost / sums.edge : 1.0;
}

/// How far out the pixels belong to the gap although the ring shines into it through the blur.
double outer_rho(const DotFitOptions& options, double blur_px, double semi_minor_px) {
  const double gap = options.gap_outer - 1.0;
  if (options.ring != nullptr)
    return options.gap_outer - std::max(0.25 * gap, std::min(0.5 * gap, 0.8 * blur_px / semi_minor_px));
  const double kept_off = std::max(0.3 * gap, 1.8 * blur_px / semi_minor_px);
  return std::max(options.gap_outer - kept_off, 1.0 + std::min(0.6 * gap, blur_px / semi_minor_px));
}

/// Farther from the edge than this, inside or outside, the pixels of large dots say nothing of it.
double depth_px(double blur_px) { return std::max(6.0, 5.0 * blur_px); }

void collect(const base::ImageView& image, const Ellipse& ellipse, const DotFitOptions& options, double blur_px,
             double at_least_px, PixelSet& pixels) {
  const double depth = std::max(depth_px(blur_px), at_least_px) / ellipse.semi_minor_px;
  pixels.collect(image, ellipse, 1.0 - depth, std::min(outer_rho(options, blur_px, ellipse.semi_minor_px), 1.0 + 2.0 * depth));
  if (options.ring == nullptr) return;
  for (std::size_t i = 0; i < pixels.used; ++i) {
    const Eigen::Vector2d offset(static_cast<double>(pixels.x[i]), static_cast<double>(pixels.y[i]));
    pixels.grey[i] -= static_cast<float>(options.ring->at(pixels.origin_px + pixels.radius_px * offset));
  }
}

bool inside_of(const base::ImageView& image, const Ellipse& ellipse) {
  const Eigen::Vector2d half = ellipse.half_extent_px();
  return ellipse.centre_px.x() - half.x() >= 0.5 && ellipse.centre_px.y() - half.y() >= 0.5 &&
         ellipse.centre_px.x() + half.x() <= image.width - 1.5 && ellipse.centre_px.y() + half.y() <= image.height - 1.5;
}

}  // namespace

double RingLight::at(const Eigen::Vector2d& pixel) const {
  const Eigen::Vector2d e = pixel - ellipse.centre_px;
  const double c = std::cos(ellipse.angle_rad);
  const double s = std::sin(ellipse.angle_rad);
  const Eigen::Vector2d u((c * e.x() + s * e.y()) / ellipse.semi_major_px, (c * e.y() - s * e.x()) / ellipse.semi_minor_px);
  const double rho = u.norm();
  if (rho < 0.5) return 0.0;
  const double gradient = std::hypot(u.x() / ellipse.semi_major_px, u.y() / ellipse.semi_minor_px) / rho;
  const double spread = edge_profile((rho - inner_rho) / (gradient * blur_px)).distribution;
  if (spread <= 0.0) return 0.0;
  const auto n = static_cast<double>(profile.size());
  double position = std::atan2(u.y(), u.x()) / (2.0 * std::numbers::pi) * n;
  if (position < 0.0) position += n;
  const auto k = static_cast<std::size_t>(position);
  const double fraction = position - static_cast<double>(k);
  const double f = (1.0 - fraction) * profile[k % profile.size()] + fraction * profile[(k + 1) % profile.size()];
  return contrast * f * spread;
}

std::optional<DotFit> fit_dot(const Sampler& sampler, const Ellipse& start_ellipse, const DotFitOptions& options) {
  const base::ImageView& image = sampler.image();
  Problem problem{{}, options.saturated_level, State::Zero()};
  PixelSet& pixels = problem.pixels;
  pixels.origin_px = start_ellipse.centre_px.array().round().matrix();
  pixels.radius_px = std::sqrt(start_ellipse.semi_major_px * start_ellipse.semi_minor_px);
  const double radius_px = pixels.radius_px;
  double blur_px = std::min(1.0, 0.3 * start_ellipse.semi_minor_px);
  Ellipse ellipse = start_ellipse;
  collect(image, ellipse, options, blur_px, 0.4 * ellipse.semi_minor_px, pixels);
  if (pixels.used < 2 * kDotColumns) return std::nullopt;
  const Eigen::Matrix2d shape = ellipse.shape() * radius_px * radius_px;
  const double reach = outer_rho(options, blur_px, ellipse.semi_minor_px);
  const Eigen::Vector2d centre = (ellipse.centre_px - pixels.origin_px) / radius_px;
  problem.start << centre, shape(0, 0), shape(0, 1), shape(1, 1), blur_px / radius_px,
      median_between(pixels, shape, std::min(1.0 + 1.5 / ellipse.semi_minor_px, reach - 0.15), 9.0), 0.0, 0.0,
      median_between(pixels, shape, 0.0, 0.8), 0.0, 0.0;
  const double contrast = std::abs(problem.start[kI] - problem.start[kO]);
  if (contrast < 0.5 * options.min_contrast) return std::nullopt;
  const double rough = std::max(0.03 * contrast, 1.0);
  State state = problem.start;
  pixels.evaluate(model_of(state, options.saturated_level));
  weigh({.outer = rough, .inner = rough}, pixels);
  const DotSums sums = adjust(problem, kRoughlyConvergedPx, kMaxIterations, state);
  const double rough_contrast = std::abs(state[kI] - state[kO]);
  if (rough_contrast < options.min_contrast ||
      std::sqrt(sums.squares / static_cast<double>(pixels.used)) > kHopeless * rough_contrast) {
    return std::nullopt;
  }

  for (int pass = 0; pass < 2; ++pass) {
    const auto found = ellipse_of(state, pixels);
    if (!found || found->semi_minor_px < options.min_radius_px || !inside_of(image, *found)) return std::nullopt;
    ellipse = *found;
    blur_px = state[kBlur] * radius_px;
    collect(image, ellipse, options, blur_px, 0.0, pixels);
    if (pixels.used < 2 * kDotColumns) return std::nullopt;
    pixels.evaluate(model_of(state, options.saturated_level));
    weigh(noise_of(pixels, options.saturated_level), pixels);
    adjust(problem, pass == 0 ? kRoughlyConvergedPx : kConvergedPx, kMaxIterations, state);
  }

  const auto found = ellipse_of(state, pixels);
  if (!found) return std::nullopt;
  DotFit fit;
  fit.ellipse = *found;
  fit.blur_px = state[kBlur] * radius_px;
  fit.inner_level = state[kI] + state[kIx] * state[kCx] + state[kIy] * state[kCy];
  fit.outer_level = state[kO] + state[kOx] * state[kCx] + state[kOy] * state[kCy];
  judge_edge(problem, state, fit);
  return fit;
}

}  // namespace crosstie::markers::detail
