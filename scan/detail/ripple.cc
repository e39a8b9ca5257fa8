#include "scan/detail/ripple.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <cstddef>
#include <numbers>
#include <numeric>

#include "scan/detail/rows.h"

namespace crosstie::scan::detail {
namespace {

constexpr std::size_t kBins = 4096;   // of a period, in which the error is tabulated
constexpr std::size_t kLines = 200;   // of the image in either direction, at least, that are looked at
constexpr double kLeastSigmas = 5.0;  // of a coefficient of the density
/// Coefficient of the density below which uneven surfaces could be it: an error of 1e-4 turns for six steps.
constexpr double kLeastCoefficient = 2e-3;
constexpr double kMostCoefficient = 0.3;  // beyond, phases do not grow with light any more

/// A Fourier coefficient of the density of the phases, from lines of pixels that are independent of each other.
struct Coefficient {
  std::complex<double> value = 0.0;
  double sigma = 0.0;
};

/// Whole fringes of a line of pixels: exp(-2 pi i k phase) summed over them, k the number of steps and its double.
struct Line {
  std::array<std::complex<double>, 2> sums = {};
  double pixels = 0.0;

  void operator+=(const Line& other) {
    for (std::size_t k = 0; k < sums.size(); ++k) sums[k] += other.sums[k];
    pixels += other.pixels;
  }
};

Line line_of(const FringeSet& set, const std::vector<char>& good, std::size_t first, std::size_t stride, std::size_t count) {
  constexpr float kAnew = 0.5F;   // a step back by more: the phase begins anew
  constexpr float kJump = 0.25F;  // a step by more: another surface
  Line line, pending;
  bool inside = false;  // of a whole fringe, as far as is known
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t at = first + i * stride;
    const bool continued = good[at] && i > 0 && good[at - stride];
    const float step = continued ? std::abs(set.turns[at] - set.turns[at - stride]) : 0.0F;
    if (!continued || (step > kJump && step <= kAnew)) {
      inside = false;
    } else if (step > kAnew) {
      if (inside) line += pending;
      inside = true;
      pending = {};
    }
    if (!inside) continue;
    const auto once = std::polar(1.0, -2.0 * std::numbers::pi * set.steps * static_cast<double>(set.turns[at]));
    pending += Line{{once, once * once}, 1.0};
  }
  return line;
}

/// Coefficients of the density at both harmonics.
std::array<Coefficient, 2> coefficients_of(const std::vector<Line>& lines) {
  Line all;
  for (const Line& line : lines) all += line;
  std::array<Coefficient, 2> result;
  if (all.pixels == 0.0) return result;
  for (std::size_t k = 0; k < result.size(); ++k) {
    result[k].value = all.sums[k] / all.pixels;
    for (const Line& line : lines) result[k].sigma += std::norm(line.sums[k] - line.pixels * result[k].value);
    result[k].sigma = std::sqrt(result[k].sigma) / all.pixels;
  }
  return result;
}

/// Of the direction in which more whole fringes are seen.
std::array<Coefficient, 2> coefficients_of(const std::vector<char>& good, int width, int height, const FringeSet& set,
                                           int threads) {
  const auto w = static_cast<std::size_t>(width);
  const auto h = static_cast<std::size_t>(height);
  const std::size_t every = std::max<std::size_t>(1, std::min(w, h) / kLines);
  std::vector<Line> across((h + every - 1) / every), down((w + every - 1) / every);
  over_rows(static_cast<int>(across.size()), threads, [&](int first, int last) {
    for (auto i = static_cast<std::size_t>(first); i < static_cast<std::size_t>(last); ++i)
      across[i] = line_of(set, good, i * every * w, 1, w);
  });
  over_rows(static_cast<int>(down.size()), threads, [&](int first, int last) {
    for (auto i = static_cast<std::size_t>(first); i < static_cast<std::size_t>(last); ++i)
      down[i] = line_of(set, good, i * every, w, h);
  });
  const auto pixels = [](const std::vector<Line>& lines) {
    return std::accumulate(lines.begin(), lines.end(), 0.0, [](double sum, const Line& line) { return sum + line.pixels; });
  };
  return coefficients_of(pixels(across) > pixels(down) ? across : down);
}

}  // namespace

double correct_ripple(const std::vector<char>& good, int width, int height, FringeSet& set, int threads) {
  std::array<double, kBins + 1> error = {};
  double amplitude2 = 0.0;
  const auto coefficients = coefficients_of(good, width, height, set, threads);
  for (std::size_t k = 0; k < coefficients.size(); ++k) {
    const auto& [coefficient, sigma] = coefficients[k];
    const int harmonic = (static_cast<int>(k) + 1) * set.steps;
    if (!(std::abs(coefficient) > std::max(kLeastCoefficient, kLeastSigmas * sigma))) continue;
    if (std::abs(coefficient) > kMostCoefficient) continue;
    const double scale = 1.0 / (std::numbers::pi * harmonic);
    amplitude2 += std::pow(scale * std::abs(coefficient), 2);
    for (std::size_t b = 0; b <= kBins; ++b) {
      const double x = static_cast<double>(b) / kBins;
      error[b] += scale * std::imag(coefficient * std::polar(1.0, 2.0 * std::numbers::pi * harmonic * x));
    }
  }
  if (amplitude2 == 0.0) return 0.0;
  const auto correct = [&](float& turns) {
    const double at = static_cast<double>(turns) * kBins;
    const auto b = std::min(static_cast<std::size_t>(at), kBins - 1);
    const double rest = at - static_cast<double>(b);
    double corrected = static_cast<double>(turns) + (1.0 - rest) * error[b] + rest * error[b + 1];
    corrected -= std::floor(corrected);
    turns = std::min(static_cast<float>(corrected), 0.99999994F);
  };
  over_rows(height, threads, [&](int first, int last) {
    const auto row = [&](int y) { return set.turns.begin() + static_cast<std::ptrdiff_t>(y) * width; };
    std::for_each(row(first), row(last), correct);
  });
  return std::sqrt(amplitude2);
}

}  // namespace crosstie::scan::detail
