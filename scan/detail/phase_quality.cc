#include "scan/detail/phase_quality.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <numbers>

#include "math/distributions.h"
#include "scan/detail/rows.h"

namespace crosstie::scan::detail {
namespace {

using base::PhaseStatus;

constexpr float kLeastSigma = 0.3F;  // grey levels: quantisation alone
constexpr double kDisturbedSignificance = 1e-5;

/// B^2 of a row of pixels, averaged over the eight neighbours of each where these agree with it.
void squared_modulation(const FringeSet& set, int width, int height, int y, std::vector<float>& columns, float* squared) {
  constexpr float kAgreement = 2.0F;  // of the mean over the neighbours
  const auto w = static_cast<std::size_t>(width);
  const float* b = &set.modulation[static_cast<std::size_t>(y) * w];
  for (std::size_t x = 0; x < w; ++x) squared[x] = b[x] * b[x];
  if (y == 0 || y + 1 == height) return;
  const float* above = b - w;
  const float* below = b + w;
  for (std::size_t x = 0; x < w; ++x) columns[x] = squared[x] + above[x] * above[x] + below[x] * below[x];
  for (std::size_t x = 1; x + 1 < w; ++x) {
    const float mean = (columns[x - 1] + columns[x] + columns[x + 1]) / 9.0F;
    const bool agrees = mean < kAgreement * squared[x] && squared[x] < kAgreement * mean;
    squared[x] = agrees ? mean : squared[x];
  }
}

}  // namespace

PhaseQuality judge_phases(const FringeSet& set, const base::GreyNoise& noise, double waveform, const DecodeOptions& options,
                          int width, int height, std::vector<PhaseStatus>& status) {
  constexpr float kTwoPi = 2.0F * std::numbers::pi_v<float>;
  const auto w = static_cast<std::size_t>(width);
  const int dof = set.steps - 3;
  float limit = std::numeric_limits<float>::infinity();
  if (dof > 0 && options.max_residual_ratio > 0.0) {
    limit = static_cast<float>(options.max_residual_ratio * options.max_residual_ratio *
                               math::chi_square_quantile(1.0 - kDisturbedSignificance, dof) / dof);
  }
  const auto middle = static_cast<float>(0.5 * set.white_level);
  const auto read = static_cast<float>(noise.read);
  const auto shot = static_cast<float>(noise.shot);
  const auto most_sigma = static_cast<float>(options.max_phase_sigma_rad) / kTwoPi;
  const auto least_modulation = static_cast<float>(options.min_modulation);
  const auto waveform_part = dof > 0 ? static_cast<float>(waveform * (dof + 3) / dof) : 0.0F;
  PhaseQuality result;
  result.sigma_turns.resize(set.turns.size());
  std::vector<PhaseQuality> bands(band_count(height));
  over_rows(height, options.threads, [&](int first, int last) {
    PhaseQuality& sums = bands[band_of(first)];
    std::vector<float> columns(w), squared(w), ratio(w), gain(w, static_cast<float>(set.gain));
    for (int y = first; y < last; ++y) {
      const std::size_t at = static_cast<std::size_t>(y) * w;
      squared_modulation(set, width, height, y, columns, squared.data());
      if (!set.gains.empty()) std::copy_n(&set.gains[at], w, gain.data());
      const float* mean = &set.mean[at];
      const float* modulation = &set.modulation[at];
      const float* squares = &set.squares[at];
      float* sigma = &result.sigma_turns[at];
      for (std::size_t x = 0; x < w; ++x) {
        const float variance = std::max(kLeastSigma * kLeastSigma, read + shot * mean[x]);
        const float of_amplitude = gain[x] * variance;
        // Noise makes the amplitude longer, by twice its variance on average.
        sigma[x] = std::sqrt(of_amplitude / std::max(1e-12F, squared[x] - 2.0F * of_amplitude)) / kTwoPi;
        ratio[x] = squares[x] / (variance + waveform_part * modulation[x] * modulation[x]);
      }
      for (std::size_t x = 0; x < w; ++x) {
        PhaseStatus& pixel = status[at + x];
        if (pixel != PhaseStatus::kValid) continue;
        if (modulation[x] <= 0.0F) {  // cut off, at one end of the grey scale or at the other
          pixel = mean[x] < middle ? PhaseStatus::kDark : PhaseStatus::kSaturated;
        } else if (modulation[x] < least_modulation || sigma[x] > most_sigma) {
          pixel = PhaseStatus::kDark;
        } else if (dof > 0) {
          sums.squares += static_cast<double>(ratio[x]);
          ++sums.tested;
          if (ratio[x] > limit) {
            pixel = PhaseStatus::kDisturbed;
            ++sums.disturbed;
          }
        }
      }
    }
  });
  for (const PhaseQuality& sums : bands) {
    result.squares += sums.squares;
    result.tested += sums.tested;
    result.disturbed += sums.disturbed;
  }
  return result;
}

}  // namespace crosstie::scan::detail
