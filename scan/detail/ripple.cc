#include "scan/detail/ripple.h"

#include <array>
#include <cmath>
#include <complex>
#include <numbers>

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

/// How often each phase occurs in whole fringes of lines of pixels.
class Density {
 public:
  explicit Density(int harmonic) : harmonic_(harmonic) {}

  void add_line(const FringeSet& set, const std::vector<char>& good, std::size_t first, std::size_t stride, std::size_t count) {
    constexpr float kAnew = 0.5F;   // a step back by more: the phase begins anew
    constexpr float kJump = 0.25F;  // a step by more: another surface
    std::complex<double> sum = 0.0, pending = 0.0;
    double pixels = 0.0, waiting = 0.0;
    bool inside = false;  // of a whole fringe, as far as is known
    for (std::size_t i = 0; i < count; ++i) {
      const std::size_t at = first + i * stride;
      const bool continued = good[at] && i > 0 && good[at - stride];
      const float step = continued ? std::abs(set.turns[at] - set.turns[at - stride]) : 0.0F;
      if (!continued || (step > kJump && step <= kAnew)) {
        inside = false;
      } else if (step > kAnew) {
        if (inside) {
          sum += pending;
          pixels += waiting;
        }
        inside = true;
        pending = 0.0;
        waiting = 0.0;
      }
      if (!inside) continue;
      pending += std::polar(1.0, -2.0 * std::numbers::pi * harmonic_ * static_cast<double>(set.turns[at]));
      waiting += 1.0;
    }
    if (pixels == 0.0) return;
    sum_ += sum;
    pixels_ += pixels;
    lines_.emplace_back(sum, pixels);
  }

  [[nodiscard]] double pixels() const { return pixels_; }
  [[nodiscard]] Coefficient coefficient() const {
    if (pixels_ == 0.0) return {};
    Coefficient result{sum_ / pixels_, 0.0};
    for (const auto& [sum, pixels] : lines_) result.sigma += std::norm(sum - pixels * result.value);
    result.sigma = std::sqrt(result.sigma) / pixels_;
    return result;
  }

 private:
  int harmonic_;
  std::complex<double> sum_ = 0.0;
  double pixels_ = 0.0;
  std::vector<std::pair<std::complex<double>, double>> lines_;
};

/// Of the direction in which more whole fringes are seen.
Coefficient coefficient_of(int harmonic, const std::vector<char>& good, int width, int height, const FringeSet& set) {
  const auto w = static_cast<std::size_t>(width);
  const auto h = static_cast<std::size_t>(height);
  Density across(harmonic), down(harmonic);
  const std::size_t every = std::max<std::size_t>(1, std::min(w, h) / kLines);
  for (std::size_t y = 0; y < h; y += every) across.add_line(set, good, y * w, 1, w);
  for (std::size_t x = 0; x < w; x += every) down.add_line(set, good, x, w, h);
  return across.pixels() > down.pixels() ? across.coefficient() : down.coefficient();
}

}  // namespace

double correct_ripple(const std::vector<char>& good, int width, int height, FringeSet& set) {
  std::array<double, kBins + 1> error = {};
  double amplitude2 = 0.0;
  for (const int harmonic : {set.steps, 2 * set.steps}) {
    const auto [coefficient, sigma] = coefficient_of(harmonic, good, width, height, set);
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
  for (float& turns : set.turns) {
    const double at = static_cast<double>(turns) * kBins;
    const auto b = std::min(static_cast<std::size_t>(at), kBins - 1);
    const double rest = at - static_cast<double>(b);
    double corrected = static_cast<double>(turns) + (1.0 - rest) * error[b] + rest * error[b + 1];
    corrected -= std::floor(corrected);
    turns = std::min(static_cast<float>(corrected), 0.99999994F);
  }
  return std::sqrt(amplitude2);
}

}  // namespace crosstie::scan::detail
