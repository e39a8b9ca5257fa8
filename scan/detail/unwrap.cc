#include "scan/detail/unwrap.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "math/distributions.h"
#include "scan/detail/rows.h"

namespace crosstie::scan::detail {
namespace {

using base::PhaseStatus;
using base::Result;

constexpr double kRange = 1e-5;  // of chance
constexpr double kMargin = 9.0;  // of the second best fringe, in squared sigmas
constexpr int kReach = 8;        // pixels over which neighbours tell a fringe
constexpr float kUnknown = std::numeric_limits<float>::quiet_NaN();

/// The fringe of a pixel as its neighbours in four directions tell it: their coordinates, carried on by their own slope. Two must
/// agree, or one with the code's own nearest coordinate, where that is a number.
float told_by_neighbours(const std::vector<float>& sure, float phase, float by_code, int x, int y, int width, int height) {
  const auto at = [&](int column, int row) {
    return column < 0 || column >= width || row < 0 || row >= height
               ? kUnknown
               : sure[static_cast<std::size_t>(row) * static_cast<std::size_t>(width) + static_cast<std::size_t>(column)];
  };
  float told = kUnknown;
  int voices = 0;
  for (const auto& [dx, dy] : {std::pair{1, 0}, std::pair{-1, 0}, std::pair{0, 1}, std::pair{0, -1}}) {
    for (int step = 1; step <= kReach; ++step) {
      const float near = at(x + step * dx, y + step * dy);
      const float next = at(x + (step + 1) * dx, y + (step + 1) * dy);
      if (std::isnan(near) || std::isnan(next)) continue;
      const float slope = near - next;
      if (std::abs(slope) > 0.25F) break;
      const float expected = near + slope * static_cast<float>(step);
      const float k = std::round(expected - phase);
      if (std::abs(expected - phase - k) > 0.25F) return kUnknown;
      if (voices > 0 && k + phase != told) return kUnknown;  // they contradict each other
      told = k + phase;
      ++voices;
      break;
    }
  }
  return voices >= 2 || (voices == 1 && told == by_code) ? told : kUnknown;
}

}  // namespace

Result<> unwrap_by_gray_code(const GrayWords& words, const FringeSet& fringes, double word_periods, double word_offset,
                             int width, int height, int threads, base::PhasePlane& plane, std::vector<PhaseStatus>& status,
                             const base::Progress& progress) {
  // A phase off the middle of its word by up to half of it is as it should be, and by 0.15 more the word's blurred end.
  const auto sure_within = static_cast<float>(std::min(0.5 * word_periods + 0.15, 0.5 - 0.1 * word_periods));
  const auto scale = static_cast<float>(word_periods);
  const auto shift = static_cast<float>(word_periods * (0.5 + word_offset));
  std::vector<float> sure(fringes.turns.size(), kUnknown);
  auto done = over_rows(height, threads, "fringes", progress, [&](int first, int last) {
    for (std::size_t i = static_cast<std::size_t>(first) * static_cast<std::size_t>(width);
         i < static_cast<std::size_t>(last) * static_cast<std::size_t>(width); ++i) {
      if (status[i] != PhaseStatus::kValid || words.doubtful[i] > 1) continue;
      const float middle = static_cast<float>(words.words[i]) * scale + shift;
      const float k = std::round(middle - fringes.turns[i]);
      if (std::abs(middle - fringes.turns[i] - k) <= sure_within) sure[i] = k + fringes.turns[i];
    }
  });
  if (!done) return done;
  // One fringe off its neighbours on all sides is a misread word.
  plane.turns = sure;
  std::vector<std::int64_t> repaired(static_cast<std::size_t>(height), 0);
  done = over_rows(height, threads, "fringes", progress, [&](int first, int last) {
    for (int y = first; y < last; ++y) {
      for (int x = 0; x < width; ++x) {
        const auto i = static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x);
        if (status[i] != PhaseStatus::kValid) continue;
        if (!std::isnan(sure[i]) && words.doubtful[i] == 0) continue;
        const float middle = static_cast<float>(words.words[i]) * scale + shift;
        const float by_code = words.doubtful[i] > 1 ? kUnknown : std::round(middle - fringes.turns[i]) + fringes.turns[i];
        const float told = told_by_neighbours(sure, fringes.turns[i], by_code, x, y, width, height);
        if (std::isnan(told)) {
          if (std::isnan(sure[i])) status[i] = PhaseStatus::kUndecided;
        } else if (told != sure[i]) {
          plane.turns[i] = told;
          ++repaired[static_cast<std::size_t>(y)];
        }
      }
    }
  });
  for (const std::int64_t count : repaired) plane.repaired += count;
  return done;
}

Result<> unwrap_by_sets(const std::vector<const FringeSet*>& sets, const std::vector<std::vector<float>>& sigmas_turns,
                        const base::AxisCode& code, int width, int height, int threads, base::PhasePlane& plane,
                        std::vector<PhaseStatus>& status, const base::Progress& progress) {
  const auto finest = static_cast<std::size_t>(code.finest());
  const double count = code.fringes[finest];
  const int candidates = static_cast<int>(std::ceil(count)) + 1;
  const double limit = math::chi_square_quantile(1.0 - kRange, std::max(1.0, static_cast<double>(sets.size()) - 1.0));
  plane.turns.assign(sets[finest]->turns.size(), kUnknown);
  return over_rows(height, threads, "fringes", progress, [&](int first, int last) {
    std::vector<float> costs(static_cast<std::size_t>(candidates));
    for (std::size_t i = static_cast<std::size_t>(first) * static_cast<std::size_t>(width);
         i < static_cast<std::size_t>(last) * static_cast<std::size_t>(width); ++i) {
      if (status[i] != PhaseStatus::kValid) continue;
      const float phase = sets[finest]->turns[i];
      std::fill(costs.begin(), costs.end(), 0.0F);
      for (std::size_t s = 0; s < sets.size(); ++s) {
        if (s == finest) continue;
        const auto ratio = static_cast<float>(code.fringes[s] / count);
        const float other = sets[s]->turns[i];
        const float sigma2 =
            sigmas_turns[s][i] * sigmas_turns[s][i] + ratio * ratio * sigmas_turns[finest][i] * sigmas_turns[finest][i];
        const float weight = 1.0F / std::max(sigma2, 1e-12F);
        for (std::size_t k = 0; k < costs.size(); ++k) {
          float difference = (static_cast<float>(k) + phase) * ratio - other;
          difference -= std::nearbyint(difference);
          costs[k] += difference * difference * weight;
        }
      }
      std::size_t best = 0;
      float second = std::numeric_limits<float>::infinity();
      for (std::size_t k = 1; k < costs.size(); ++k) {
        if (static_cast<double>(k) + phase > count + 0.25) break;
        if (costs[k] < costs[best]) {
          second = costs[best];
          best = k;
        } else {
          second = std::min(second, costs[k]);
        }
      }
      if (costs[best] > limit || second - costs[best] < kMargin) {
        status[i] = PhaseStatus::kUndecided;
        continue;
      }
      // All sets tell the same coordinate, each in its own periods.
      const double t = static_cast<double>(best) + phase;
      double weights = 0.0;
      double sum = 0.0;
      for (std::size_t s = 0; s < sets.size(); ++s) {
        const double ratio = code.fringes[s] / count;
        const double off = sets[s]->turns[i] - ratio * t;
        const double sigma = sigmas_turns[s][i] / ratio;
        const double weight = 1.0 / std::max(1e-12, sigma * sigma);
        weights += weight;
        sum += weight * (off - std::round(off)) / ratio;
      }
      plane.turns[i] = static_cast<float>(t + sum / weights);
      plane.sigma_turns[i] = static_cast<float>(1.0 / std::sqrt(weights));
    }
  });
}

}  // namespace crosstie::scan::detail
