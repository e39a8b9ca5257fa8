#include "scan/detail/ripple.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <cstddef>
#include <numbers>
#include <numeric>

#include "scan/detail/phase_kernel.h"
#include "scan/detail/rows.h"

namespace crosstie::scan::detail {
namespace {

using base::PhaseStatus;

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

/// Pixels along some lines of the image, one line after the other.
class Pixels {
 public:
  Pixels(std::size_t lines, std::size_t count)
      : count_(count), turns_(lines * count), status_(lines * count), cosine_(count), sine_(count) {}

  void set(std::size_t line, std::size_t i, float turns, PhaseStatus status) {
    turns_[line * count_ + i] = turns;
    status_[line * count_ + i] = status;
  }

  /// The whole fringes of a line.
  Line sum(std::size_t line, int steps) {
    constexpr float kAnew = 0.5F;   // a step back by more: the phase begins anew
    constexpr float kJump = 0.25F;  // a step by more: another surface
    const float* turns = &turns_[line * count_];
    const PhaseStatus* status = &status_[line * count_];
    point_on_circle(turns, count_, steps, cosine_.data(), sine_.data());
    Line result;
    bool inside = false;  // of a whole fringe, as far as is known, which began at `first`
    std::size_t first = 0;
    for (std::size_t i = 1; i < count_; ++i) {
      const bool good = status[i] == PhaseStatus::kValid && status[i - 1] == PhaseStatus::kValid;
      const float step = std::abs(turns[i] - turns[i - 1]);
      if (good && step <= kJump) continue;
      const bool anew = good && step > kAnew;
      if (anew && inside) add(first, i, result);
      inside = anew;
      first = i;
    }
    return result;
  }

 private:
  void add(std::size_t first, std::size_t last, Line& line) const {
    double c = 0.0, s = 0.0, c2 = 0.0, s2 = 0.0;
    for (std::size_t i = first; i < last; ++i) {
      const auto x = static_cast<double>(cosine_[i]);
      const auto y = static_cast<double>(sine_[i]);
      c += x;
      s += y;
      c2 += x * x - y * y;  // of the double angle
      s2 += 2.0 * x * y;
    }
    line += Line{{std::complex<double>(c, -s), std::complex<double>(c2, -s2)}, static_cast<double>(last - first)};
  }

  std::size_t count_;
  std::vector<float> turns_;
  std::vector<PhaseStatus> status_;
  std::vector<float> cosine_, sine_;  // of a line
};

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
std::array<Coefficient, 2> coefficients_of(const std::vector<PhaseStatus>& status, int width, int height, const FringeSet& set,
                                           int threads) {
  const auto w = static_cast<std::size_t>(width);
  const auto h = static_cast<std::size_t>(height);
  const std::size_t every = std::max<std::size_t>(1, std::min(w, h) / kLines);
  std::vector<Line> across((h + every - 1) / every), down((w + every - 1) / every);
  over_rows(static_cast<int>(across.size()), threads, [&](int first, int last) {
    Pixels row(1, w);
    for (auto i = static_cast<std::size_t>(first); i < static_cast<std::size_t>(last); ++i) {
      const std::size_t at = i * every * w;
      for (std::size_t x = 0; x < w; ++x) row.set(0, x, set.turns[at + x], status[at + x]);
      across[i] = row.sum(0, set.steps);
    }
  });
  over_rows(static_cast<int>(down.size()), threads, [&](int first, int last) {
    const auto lines = static_cast<std::size_t>(last - first);
    Pixels columns(lines, h);
    for (std::size_t y = 0; y < h; ++y) {  // row by row, as memory is
      const std::size_t at = y * w + static_cast<std::size_t>(first) * every;
      for (std::size_t i = 0; i < lines; ++i) columns.set(i, y, set.turns[at + i * every], status[at + i * every]);
    }
    for (std::size_t i = 0; i < lines; ++i) down[static_cast<std::size_t>(first) + i] = columns.sum(i, set.steps);
  });
  const auto pixels = [](const std::vector<Line>& lines) {
    return std::accumulate(lines.begin(), lines.end(), 0.0, [](double sum, const Line& line) { return sum + line.pixels; });
  };
  return coefficients_of(pixels(across) > pixels(down) ? across : down);
}

}  // namespace

double correct_ripple(const std::vector<PhaseStatus>& status, int width, int height, FringeSet& set, int threads) {
  std::array<double, kBins + 1> error = {};
  double amplitude2 = 0.0;
  const auto coefficients = coefficients_of(status, width, height, set, threads);
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
  std::array<float, kBins + 1> correction = {};
  std::transform(error.begin(), error.end(), correction.begin(), [](double value) { return static_cast<float>(value); });
  over_rows(height, threads, [&](int first, int last) {
    const auto w = static_cast<std::size_t>(width);
    correct_turns(correction.data(), kBins, &set.turns[static_cast<std::size_t>(first) * w],
                  static_cast<std::size_t>(last - first) * w);
  });
  return std::sqrt(amplitude2);
}

}  // namespace crosstie::scan::detail
