#include "markers/detail/dot_fit.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <vector>

#include <Eigen/Cholesky>
#include <Eigen/LU>

#include "markers/detail/dot_model.h"

namespace crosstie::markers::detail {
namespace {

using State = DotState;
using Model = DotModel;
constexpr int kParameters = kDotParameters;
constexpr int kExtended = kParameters + kHarmonicDof;

using Normal = Eigen::Matrix<double, kParameters, kParameters>;
using ExtendedNormal = Eigen::Matrix<double, kExtended, kExtended>;
using ExtendedVector = Eigen::Matrix<double, kExtended, 1>;

constexpr double kSmallestBlurPx = 0.28;  // a pixel alone integrates over a box of this standard deviation
constexpr double kSlopeSigma = 0.02;      // a priori: change of a level per dot radius, of the contrast
constexpr double kOutlier = 4.0;          // standard deviations from which on a pixel loses weight
constexpr double kQuantisation = 0.3;     // grey levels: no pixel is better than the rounding of its level
constexpr double kRoughlyConvergedPx = 1e-2;
constexpr double kConvergedPx = 1e-4;
constexpr int kMaxIterations = 20;
constexpr double kHopeless = 0.3;  // RMS of the residuals over the contrast: not a dot

/// Standard deviations in grey levels at the dark and the bright end of the edge, and how far pixels on the edge may be off
/// before they count as outliers: a lens does not blur exactly like a Gaussian, which shows where the slope is steep.
struct NoiseModel {
  double outer = 1.0;
  double inner = 1.0;
  double edge = 0.0;
  double steepest = 1.0;

  [[nodiscard]] double variance(double inside) const { return outer * outer + (inner * inner - outer * outer) * inside; }
  [[nodiscard]] double tolerated(double inside, double slope) const {
    return variance(inside) + std::pow(edge * slope / steepest, 2);
  }
};

double residual_of(const DotPixel& pixel, const Prediction& p, double saturated_level) {
  return std::min(pixel.grey, saturated_level) - p.grey;
}

double robust_weight(double residual, double tolerated) {
  const double t2 = residual * residual / (kOutlier * kOutlier * tolerated);
  return t2 <= 1.0 ? 1.0 : 1.0 / t2;
}

/// Cost of a residual whose weight is robust_weight / variance.
double robust_cost(double residual, double variance, double tolerated) {
  const double limit2 = kOutlier * kOutlier * tolerated;
  const double r2 = residual * residual;
  return r2 <= limit2 ? r2 / variance : limit2 / variance * (1.0 + std::log(r2 / limit2));
}

double median_of(std::vector<double>& values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

/// n += w j j^T, upper triangle.
template <int N>
void add_outer_product(const Eigen::Matrix<double, N, 1>& j, double w, Eigen::Matrix<double, N, N>& n) {
  double* column = n.data();
  for (int b = 0; b < N; ++b, column += N) {
    const double wj = w * j[b];
    for (int a = 0; a <= b; ++a) column[a] += wj * j[a];
  }
}

/// Median of |residual| as a standard deviation, inside and outside of the edge apart: brighter pixels are noisier.
NoiseModel noise_of(const std::vector<DotPixel>& pixels, const Model& model, double saturated_level) {
  std::vector<double> outer, inner, edge;
  NoiseModel noise;
  for (const DotPixel& pixel : pixels) noise.steepest = std::max(noise.steepest, std::abs(model.at(pixel).slope));
  for (const DotPixel& pixel : pixels) {
    const Prediction p = model.at(pixel);
    if (p.cut_off) continue;
    const double residual = std::abs(residual_of(pixel, p, saturated_level));
    (p.inside < 0.5 ? outer : inner).push_back(residual);
    if (std::abs(p.slope) > 0.4 * noise.steepest) edge.push_back(residual);
  }
  constexpr double kMadToSigma = 1.4826;
  constexpr std::size_t kEnough = 8;
  if (outer.size() >= kEnough) noise.outer = std::max(kQuantisation, kMadToSigma * median_of(outer));
  noise.inner = inner.size() >= kEnough ? std::max(kQuantisation, kMadToSigma * median_of(inner)) : noise.outer;
  if (edge.size() >= kEnough) noise.edge = kMadToSigma * median_of(edge);
  return noise;
}

/// The levels of the slopes stay near zero and undetermined levels of saturated dots near their start, weakly.
void add_priors(const State& state, const State& start, Normal& n, State& b) {
  const double contrast = std::max(std::abs(start[kI] - start[kO]), 1.0);
  const double slope = 1.0 / std::pow(kSlopeSigma * contrast, 2);
  for (const int k : {kOx, kOy, kIx, kIy}) {
    n(k, k) += slope;
    b[k] -= slope * state[k];
  }
  const double level = 1.0 / (contrast * contrast);
  n(kI, kI) += level;
  b[kI] += level * (start[kI] - state[kI]);
  n(kBlur, kBlur) += 1.0;
  b[kBlur] += start[kBlur] - state[kBlur];
}

double prior_cost(const State& state, const State& start) {
  const double contrast = std::max(std::abs(start[kI] - start[kO]), 1.0);
  double cost = std::pow(state[kBlur] - start[kBlur], 2) + std::pow((state[kI] - start[kI]) / contrast, 2);
  for (const int k : {kOx, kOy, kIx, kIy}) cost += std::pow(state[k] / (kSlopeSigma * contrast), 2);
  return cost;
}

/// Evaluates the model at all pixels and returns the cost.
double evaluate(const std::vector<DotPixel>& pixels, const Model& model, double saturated_level,
                const std::vector<double>& variances, const std::vector<double>& tolerated,
                std::vector<Prediction>& predictions) {
  double cost = 0.0;
  for (std::size_t i = 0; i < pixels.size(); ++i) {
    predictions[i] = model.at(pixels[i]);
    cost += robust_cost(residual_of(pixels[i], predictions[i], saturated_level), variances[i], tolerated[i]);
  }
  return cost;
}

/// Whether this is still the candidate: blur below its radius, area within a factor of two, centre within half a radius.
bool plausible(const State& s, double radius_px) {
  const double determinant = (s[kAxx] * s[kAyy] - s[kAxy] * s[kAxy]) * std::pow(radius_px, 4);  // 1 / relative area^2
  return s.allFinite() && s[kBlur] >= kSmallestBlurPx && s[kBlur] < radius_px && s[kAxx] > 0.0 && determinant > 0.25 &&
         determinant < 4.0 && std::hypot(s[kCx], s[kCy]) < 0.5 * radius_px;
}

/// What one adjustment works on.
struct Problem {
  const std::vector<DotPixel>& pixels;
  NoiseModel noise;
  double radius_px;
  double saturated_level;
  const State& start;
};

/// Levenberg-Marquardt on fixed pixels and fixed variances, until a step moves the edge by less than `converged_px`.
void adjust(const Problem& problem, double converged_px, int max_iterations, State& state) {
  const std::vector<DotPixel>& pixels = problem.pixels;
  std::vector<double> variances(pixels.size());
  std::vector<double> tolerated(pixels.size());
  std::vector<Prediction> predictions(pixels.size());
  std::vector<Prediction> tried(pixels.size());
  {
    const Model model(state, problem.radius_px, problem.saturated_level);
    for (std::size_t i = 0; i < pixels.size(); ++i) {
      const Prediction p = model.at(pixels[i]);
      variances[i] = problem.noise.variance(p.inside);
      tolerated[i] = problem.noise.tolerated(p.inside, p.slope);
    }
  }
  const auto cost_of = [&](const State& at, std::vector<Prediction>& out) {
    const Model model(at, problem.radius_px, problem.saturated_level);
    return prior_cost(at, problem.start) + evaluate(pixels, model, problem.saturated_level, variances, tolerated, out);
  };
  const double radius3 = std::pow(problem.radius_px, 3);
  double cost = cost_of(state, predictions);
  double damping = 1e-4;
  for (int iteration = 0; iteration < max_iterations; ++iteration) {
    const Model model(state, problem.radius_px, problem.saturated_level);
    Normal n = Normal::Zero();
    State b = State::Zero();
    State j;
    for (std::size_t i = 0; i < pixels.size(); ++i) {
      const Prediction& p = predictions[i];
      if (p.cut_off) continue;
      const double r = residual_of(pixels[i], p, problem.saturated_level);
      const double w = robust_weight(r, tolerated[i]) / variances[i];
      model.derivatives(p, j);
      add_outer_product(j, w, n);
      b += (w * r) * j;
    }
    n.triangularView<Eigen::StrictlyLower>() = n.transpose();
    add_priors(state, problem.start, n, b);
    bool lowered = false;
    double step_px = 0.0;
    for (int attempt = 0; attempt < 8 && !lowered; ++attempt) {
      Normal damped = n;
      damped.diagonal() *= 1.0 + damping;
      const State step = damped.ldlt().solve(b);
      State next = state + step;
      next[kBlur] = std::max(next[kBlur], kSmallestBlurPx);
      if (plausible(next, problem.radius_px)) {
        const double next_cost = cost_of(next, tried);
        if (next_cost <= cost) {
          step_px = std::hypot(step[kCx], step[kCy]) + std::abs(next[kBlur] - state[kBlur]) +
                    0.5 * radius3 * (std::abs(step[kAxx]) + std::abs(step[kAyy]));
          state = next;
          cost = next_cost;
          predictions.swap(tried);
          lowered = true;
          damping = std::max(damping * 0.1, 1e-9);
        }
      }
      if (!lowered) damping = std::max(damping * 10.0, 1e-4);
    }
    if (!lowered || step_px < converged_px) return;  // no step lowers the cost: as good as it gets
  }
}

double rms_residual(const std::vector<DotPixel>& pixels, const Model& model, double saturated_level) {
  double squares = 0.0;
  for (const DotPixel& pixel : pixels) squares += std::pow(residual_of(pixel, model.at(pixel), saturated_level), 2);
  return std::sqrt(squares / static_cast<double>(pixels.size()));
}

double level_of(const std::vector<DotPixel>& pixels, const Eigen::Matrix2d& shape, double from_rho, double to_rho) {
  std::vector<double> greys;
  for (const DotPixel& pixel : pixels) {
    const Eigen::Vector2d e(pixel.x, pixel.y);
    const double rho2 = e.dot(shape * e);
    if (rho2 >= from_rho * from_rho && rho2 <= to_rho * to_rho) greys.push_back(pixel.grey);
  }
  return greys.empty() ? 0.0 : median_of(greys);
}

Eigen::Matrix2d shape_of(const State& s) {
  Eigen::Matrix2d shape;
  shape << s[kAxx], s[kAxy], s[kAxy], s[kAyy];
  return shape;
}

/// Covariance of the centre and the power of the harmonics 3..5, from the normal equations extended by them.
void judge_edge(const Problem& problem, const State& state, DotFit& fit) {
  const Model model(state, problem.radius_px, problem.saturated_level);
  const Eigen::Matrix2d unit_from_pixel = fit.ellipse.pixel_from_unit().inverse();
  ExtendedNormal n = ExtendedNormal::Zero();
  ExtendedVector b = ExtendedVector::Zero();
  ExtendedVector j;
  double squares = 0.0;
  double edge_weight = 0.0;
  double edge_lost = 0.0;
  for (const DotPixel& pixel : problem.pixels) {
    const Prediction p = model.at(pixel);
    const double r = residual_of(pixel, p, problem.saturated_level);
    squares += r * r;
    if (p.cut_off) continue;
    const double variance = problem.noise.variance(p.inside);
    const double w = robust_weight(r, problem.noise.tolerated(p.inside, p.slope));
    edge_weight += p.slope * p.slope;
    edge_lost += p.slope * p.slope * (1.0 - w);
    model.derivatives(p, j);
    const Eigen::Vector2d u = unit_from_pixel * Eigen::Vector2d(p.ex, p.ey);
    const double phi = std::atan2(u.y(), u.x());
    for (int h = 0; h < kHarmonicDof / 2; ++h) {
      j[kParameters + 2 * h] = -p.slope * std::cos((h + 3) * phi);
      j[kParameters + 2 * h + 1] = -p.slope * std::sin((h + 3) * phi);
    }
    add_outer_product(j, w / variance, n);
    b += (w / variance * r) * j;
  }
  n.triangularView<Eigen::StrictlyLower>() = n.transpose();
  Normal inner = n.topLeftCorner<kParameters, kParameters>();
  State inner_b = b.head<kParameters>();
  add_priors(state, problem.start, inner, inner_b);
  n.topLeftCorner<kParameters, kParameters>() = inner;
  b.head<kParameters>() = inner_b;
  fit.cov_px2 = inner.ldlt().solve(Normal::Identity()).topLeftCorner<2, 2>();
  const ExtendedNormal q = n.ldlt().solve(ExtendedNormal::Identity());
  const Eigen::Matrix<double, kHarmonicDof, 1> amplitudes = (q * b).tail<kHarmonicDof>();
  const Eigen::Matrix<double, kHarmonicDof, kHarmonicDof> q_harmonics = q.bottomRightCorner<kHarmonicDof, kHarmonicDof>();
  fit.harmonic_power = amplitudes.dot(q_harmonics.ldlt().solve(amplitudes)) / kHarmonicDof;
  for (int h = 0; h < kHarmonicDof / 2; ++h) {
    fit.deviation_px = std::max(fit.deviation_px, std::hypot(amplitudes[2 * h], amplitudes[2 * h + 1]));
  }
  fit.residual = std::sqrt(squares / static_cast<double>(problem.pixels.size()));
  fit.outlier_fraction = edge_weight > 0.0 ? edge_lost / edge_weight : 1.0;
}

/// How far out the pixels belong to the gap although the ring shines into it through the blur.
double outer_rho(const DotFitOptions& options, double blur_px, double semi_minor_px) {
  const double gap = options.gap_outer - 1.0;
  if (options.ring != nullptr)
    return options.gap_outer - std::max(0.25 * gap, std::min(0.5 * gap, 0.8 * blur_px / semi_minor_px));
  const double kept_off = std::max(0.3 * gap, 1.8 * blur_px / semi_minor_px);
  return std::max(options.gap_outer - kept_off, 1.0 + std::min(0.6 * gap, blur_px / semi_minor_px));
}

/// Deeper inside than this, the pixels of large dots say nothing of the edge.
double depth_px(double blur_px) { return std::max(6.0, 5.0 * blur_px); }

void take_off_ring_light(const RingLight* ring, const Eigen::Vector2d& origin_px, std::vector<DotPixel>& pixels) {
  if (ring == nullptr) return;
  for (DotPixel& pixel : pixels) pixel.grey -= ring->at(origin_px + Eigen::Vector2d(pixel.x, pixel.y));
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

std::optional<DotFit> fit_dot(const Sampler& image, const Ellipse& start_ellipse, const DotFitOptions& options) {
  const Eigen::Vector2d origin_px = start_ellipse.centre_px;
  const double radius_px = std::sqrt(start_ellipse.semi_major_px * start_ellipse.semi_minor_px);
  double blur_px = std::min(1.0, 0.3 * start_ellipse.semi_minor_px);
  Ellipse ellipse = start_ellipse;
  const double reach = outer_rho(options, blur_px, ellipse.semi_minor_px);
  std::vector<DotPixel> pixels =
      collect_pixels(image, ellipse, reach, std::max(depth_px(blur_px), 0.4 * ellipse.semi_minor_px), origin_px);
  take_off_ring_light(options.ring, origin_px, pixels);
  const Eigen::Matrix2d shape = ellipse.shape();
  State start = State::Zero();
  start << 0.0, 0.0, shape(0, 0), shape(0, 1), shape(1, 1), blur_px,
      level_of(pixels, shape, std::min(1.0 + 1.5 / ellipse.semi_minor_px, reach - 0.15), 9.0), 0.0, 0.0,
      level_of(pixels, shape, 0.0, 0.8), 0.0, 0.0;
  const double contrast = std::abs(start[kI] - start[kO]);
  if (contrast < 0.5 * options.min_contrast) return std::nullopt;
  const double saturated = options.saturated_level;
  const double rough = std::max(0.03 * contrast, 1.0);
  State state = start;
  adjust({pixels, {.outer = rough, .inner = rough}, radius_px, saturated, start}, kRoughlyConvergedPx, kMaxIterations, state);
  const double rough_contrast = std::abs(state[kI] - state[kO]);
  if (rough_contrast < options.min_contrast ||
      rms_residual(pixels, Model(state, radius_px, saturated), saturated) > kHopeless * rough_contrast) {
    return std::nullopt;
  }

  NoiseModel noise;
  for (int pass = 0; pass < 2; ++pass) {
    const auto found = Ellipse::from_shape(origin_px + state.head<2>(), shape_of(state));
    if (!found) return std::nullopt;
    ellipse = *found;
    if (ellipse.semi_minor_px < options.min_radius_px) return std::nullopt;
    const Eigen::Vector2d half = ellipse.half_extent_px();
    if (ellipse.centre_px.x() - half.x() < 0.5 || ellipse.centre_px.y() - half.y() < 0.5 ||
        ellipse.centre_px.x() + half.x() > image.image().width - 1.5 ||
        ellipse.centre_px.y() + half.y() > image.image().height - 1.5) {
      return std::nullopt;
    }
    blur_px = state[kBlur];
    pixels = collect_pixels(image, ellipse, outer_rho(options, blur_px, ellipse.semi_minor_px), depth_px(blur_px), origin_px);
    take_off_ring_light(options.ring, origin_px, pixels);
    if (pixels.size() < 2 * kParameters) return std::nullopt;
    noise = noise_of(pixels, Model(state, radius_px, saturated), saturated);
    adjust({pixels, noise, radius_px, saturated, start}, pass == 0 ? kRoughlyConvergedPx : kConvergedPx, kMaxIterations, state);
  }

  const auto found = Ellipse::from_shape(origin_px + state.head<2>(), shape_of(state));
  if (!found) return std::nullopt;
  DotFit fit;
  fit.ellipse = *found;
  fit.blur_px = state[kBlur];
  fit.inner_level = state[kI];
  fit.outer_level = state[kO];
  judge_edge({pixels, noise, radius_px, saturated, start}, state, fit);
  return fit;
}

}  // namespace crosstie::markers::detail
