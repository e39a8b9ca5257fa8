#include "scan/detail/phase_quality.h"

#include <cstddef>
#include <limits>
#include <numbers>
#include <utility>

#include "math/distributions.h"
#include "scan/detail/phase_kernel.h"
#include "scan/detail/rows.h"

namespace crosstie::scan::detail {
namespace {

constexpr double kDisturbedSignificance = 1e-5;

}  // namespace

PhaseQuality judge_phases(FringeSet& set, const base::GreyNoise& noise, double waveform, const DecodeOptions& options,
                          int width, int height, std::vector<base::PhaseStatus>& status) {
  const auto w = static_cast<std::size_t>(width);
  const int dof = set.steps - 3;
  PhaseLimits limits;
  limits.gain = static_cast<float>(set.gain);
  limits.read = static_cast<float>(noise.read);
  limits.shot = static_cast<float>(noise.shot);
  limits.waveform = dof > 0 ? static_cast<float>(waveform * (dof + 3) / dof) : 0.0F;
  limits.middle = static_cast<float>(0.5 * set.white_level);
  limits.least_modulation = static_cast<float>(options.min_modulation);
  limits.most_sigma_turns = static_cast<float>(options.max_phase_sigma_rad / (2.0 * std::numbers::pi));
  limits.most_ratio = std::numeric_limits<float>::infinity();
  if (dof > 0 && options.max_residual_ratio > 0.0) {
    limits.most_ratio = static_cast<float>(options.max_residual_ratio * options.max_residual_ratio *
                                           math::chi_square_quantile(1.0 - kDisturbedSignificance, dof) / dof);
  }
  std::vector<JudgeSums> bands(band_count(height));
  over_rows(height, options.threads, [&](int first, int last) {
    JudgeSums& sums = bands[band_of(first)];
    for (int y = first; y < last; ++y) {
      const std::size_t at = static_cast<std::size_t>(y) * w;
      const float* modulation = &set.modulation[at];
      judge_row(limits,
                {y > 0 ? modulation - w : nullptr, modulation, y + 1 < height ? modulation + w : nullptr, &set.mean[at],
                 set.gains.empty() ? nullptr : &set.gains[at], &set.squares[at], reinterpret_cast<std::uint8_t*>(&status[at])},
                w, sums);
    }
  });
  PhaseQuality result;
  result.sigma_turns = std::move(set.squares);
  for (const JudgeSums& sums : bands) {
    result.valid += sums.valid;
    if (dof <= 0) continue;
    result.squares += sums.ratios;
    result.tested += sums.tested;
    result.disturbed += sums.disturbed;
  }
  return result;
}

}  // namespace crosstie::scan::detail
