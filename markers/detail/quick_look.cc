#include "markers/detail/quick_look.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <numbers>

#include <Eigen/Geometry>

namespace crosstie::markers::detail {
namespace {

constexpr std::size_t kDirections = 16;
// What is asked for, in directions of kDirections and in contrasts. Of the dots that the fit accepts on photographs of panels
// and prints 99 % pass, all of the coded ones; of the others three in five fail on panels, four in five on prints.
constexpr int kBrightInside = 11;
constexpr int kDarkGap = 13;
constexpr double kMinStep = 0.15;         // mean step over the edge
constexpr double kMaxStepScatter = 0.4;   // its standard deviation round the edge
constexpr double kMaxInnerScatter = 0.3;  // of the levels inside
constexpr double kMaxRoughness = 0.22;    // of the step and of the gap together
constexpr double kBesideEdge = 1.5;       // where the step is taken [px of the level that the candidate was found in]

using Levels = std::array<double, kDirections>;

const std::array<Eigen::Vector2d, kDirections>& directions() {
  static const auto all = [] {
    std::array<Eigen::Vector2d, kDirections> unit;
    for (std::size_t k = 0; k < kDirections; ++k) {
      const double phi = 2.0 * std::numbers::pi * static_cast<double>(k) / kDirections;
      unit[k] = {std::cos(phi), std::sin(phi)};
    }
    return unit;
  }();
  return all;
}

/// Batcher's network that sorts kDirections values without a branch.
struct Comparison {
  std::uint8_t low, high;
};
constexpr auto kSorting = [] {
  constexpr std::size_t n = kDirections;
  std::array<Comparison, 63> network{};
  std::size_t count = 0;
  for (std::size_t p = 1; p < n; p *= 2) {
    for (std::size_t k = p; k >= 1; k /= 2) {
      for (std::size_t j = k % p; j + k < n; j += 2 * k) {
        for (std::size_t i = j; i < std::min(j + k, n - k); ++i) {
          if (i / (2 * p) == (i + k) / (2 * p)) {
            network.at(count++) = {static_cast<std::uint8_t>(i), static_cast<std::uint8_t>(i + k)};
          }
        }
      }
    }
  }
  return network;
}();

double median_of(Levels values) {
  for (const Comparison& pair : kSorting) {
    const double a = values[pair.low];
    const double b = values[pair.high];
    values[pair.low] = std::min(a, b);
    values[pair.high] = std::max(a, b);
  }
  return values[kDirections / 2];
}

double scatter_of(const Levels& values) {
  double sum = 0.0;
  double squares = 0.0;
  for (const double value : values) {
    sum += value;
    squares += value * value;
  }
  return std::sqrt(std::max(squares / kDirections - std::pow(sum / kDirections, 2), 0.0));
}

double median_deviation(const Levels& levels) {
  const double median = median_of(levels);
  Levels deviations;
  for (std::size_t k = 0; k < kDirections; ++k) deviations[k] = std::abs(levels[k] - median);
  return median_of(deviations);
}

/// Without what changes once or twice round the dot: light does, and a blur that counts more across an ellipse than along it.
Levels levelled(const Levels& levels) {
  Eigen::Vector2d once(0.0, 0.0), twice(0.0, 0.0);
  for (std::size_t k = 0; k < kDirections; ++k) {
    once += levels[k] * directions()[k] / (0.5 * kDirections);
    twice += levels[k] * directions()[2 * k % kDirections] / (0.5 * kDirections);
  }
  Levels flat;
  for (std::size_t k = 0; k < kDirections; ++k) {
    flat[k] = levels[k] - once.dot(directions()[k]) - twice.dot(directions()[2 * k % kDirections]);
  }
  return flat;
}

/// Whether step and gap are alike in most directions: something may lie over a part of the dot.
bool smooth(const Levels& step, const Levels& gap, double limit) {
  const double step_alone = median_deviation(step);
  const double gap_alone = median_deviation(gap);
  return step_alone + gap_alone < limit ||
         std::min(step_alone, median_deviation(levelled(step))) + std::min(gap_alone, median_deviation(levelled(gap))) < limit;
}

}  // namespace

bool looks_like_dot(const Sampler& image, const Candidate& candidate, double gap_outer, double min_contrast) {
  const Ellipse& ellipse = candidate.ellipse;
  const double beside_px = kBesideEdge * candidate.scale;
  const Eigen::Matrix2d pixel_from_unit = ellipse.pixel_from_unit();
  const double outer_rho = std::max(0.5 * (1.0 + gap_outer), 1.0 + beside_px / ellipse.semi_minor_px);
  const Eigen::Vector2d reach = outer_rho * ellipse.half_extent_px();
  if (!image.inside(ellipse.centre_px.x() - reach.x(), ellipse.centre_px.y() - reach.y()) ||
      !image.inside(ellipse.centre_px.x() + reach.x(), ellipse.centre_px.y() + reach.y())) {
    return false;
  }
  const double inner_rho = std::clamp(1.0 - beside_px / ellipse.semi_minor_px, 0.3, 0.7);
  Levels inner, gap, step;
  for (std::size_t k = 0; k < kDirections; ++k) {
    const Eigen::Vector2d edge = pixel_from_unit * directions()[k];
    const auto at = [&](double rho) {
      return image.bilinear(ellipse.centre_px.x() + rho * edge.x(), ellipse.centre_px.y() + rho * edge.y());
    };
    inner[k] = at(inner_rho);
    gap[k] = at(0.5 * (1.0 + gap_outer));
    const double beside = std::min(beside_px / edge.norm(), 0.6);
    step[k] = at(1.0 - beside) - at(1.0 + beside);
  }
  const double outside = median_of(gap);
  const double contrast = median_of(inner) - outside;
  if ((contrast > 0.0) != candidate.bright || std::abs(contrast) < 0.5 * min_contrast) return false;
  const auto bright = std::count_if(inner.begin(), inner.end(), [&](double v) { return (v - outside) / contrast > 0.5; });
  const auto dark = std::count_if(gap.begin(), gap.end(), [&](double v) { return (v - outside) / contrast < 0.5; });
  double mean_step = 0.0;
  for (const double value : step) mean_step += value / (kDirections * contrast);
  return bright >= kBrightInside && dark >= kDarkGap && mean_step > kMinStep &&
         scatter_of(step) < kMaxStepScatter * std::abs(contrast) && scatter_of(inner) < kMaxInnerScatter * std::abs(contrast) &&
         smooth(step, gap, kMaxRoughness * std::abs(contrast));
}

bool stands_alone(const Sampler& image, const Ellipse& ellipse, double inner_level, double outer_level,
                  const MarkerFamily& family) {
  constexpr double kEven = 0.2;  // of the contrast: rings are read from a range of 0.35 on
  const double ring_rho = 0.5 * (family.ring_inner + family.ring_outer);
  const Eigen::Vector2d reach = ring_rho * ellipse.half_extent_px();
  if (!image.inside(ellipse.centre_px.x() - reach.x(), ellipse.centre_px.y() - reach.y()) ||
      !image.inside(ellipse.centre_px.x() + reach.x(), ellipse.centre_px.y() + reach.y())) {
    return false;
  }
  const double gap_rho = 0.5 * (1.0 + family.ring_inner);
  const double contrast = inner_level - outer_level;
  const Eigen::Matrix2d pixel_from_unit = ellipse.pixel_from_unit();
  const double step_rad = std::numbers::pi / family.bits;
  const Eigen::Rotation2Dd turn(step_rad);
  Eigen::Vector2d unit(1.0, 0.0);
  for (int k = 0; k < 2 * family.bits; ++k, unit = turn * unit) {
    const Eigen::Vector2d edge = pixel_from_unit * unit;
    const auto at = [&](double rho) {
      return image.bilinear(ellipse.centre_px.x() + rho * edge.x(), ellipse.centre_px.y() + rho * edge.y());
    };
    if ((at(gap_rho) - outer_level) / contrast > 0.5 - kEven ||
        std::abs(at(ring_rho) - outer_level) > kEven * std::abs(contrast)) {
      return false;
    }
  }
  return true;
}

}  // namespace crosstie::markers::detail
