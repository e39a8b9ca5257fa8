#include "scan/detail/unwrap.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>

#include "math/distributions.h"
#include "scan/detail/phase_kernel.h"
#include "scan/detail/rows.h"

namespace crosstie::scan::detail {
namespace {

using base::PhaseStatus;
using base::Result;

constexpr double kRange = 1e-5;  // of chance
constexpr double kMargin = 9.0;  // of the second best fringe, in squared sigmas
constexpr int kReach = 8;        // pixels over which neighbours tell a fringe
constexpr float kUnknown = std::numeric_limits<float>::quiet_NaN();

/// The whole number next to a small one; std::round is a call.
float nearest(float value) {
  constexpr float kWhole = 12582912.0F;  // 1.5 * 2^23: sums with it are whole numbers
  return (value + kWhole) - kWhole;
}

/// The fringe of a pixel as its neighbours in four directions tell it: their coordinates, carried on by their own slope. Two must
/// agree, or one with the code's own nearest coordinate, where that is a number.
float told_by_neighbours(const base::Plane<float>& sure, float phase, float by_code, std::size_t pixel, int width, int height) {
  struct Direction {
    std::ptrdiff_t step;
    int room;  // pixels up to the end of the image
  };
  const int x = static_cast<int>(pixel % static_cast<std::size_t>(width));
  const int y = static_cast<int>(pixel / static_cast<std::size_t>(width));
  const float* here = &sure[pixel];
  float told = kUnknown;
  int voices = 0;
  for (const Direction& along :
       {Direction{1, width - 1 - x}, Direction{-1, x}, Direction{width, height - 1 - y}, Direction{-width, y}}) {
    for (int step = 1; step <= std::min(kReach, along.room - 1); ++step) {
      const float near = here[step * along.step];
      const float next = here[(step + 1) * along.step];
      const float slope = near - next;
      if (std::isnan(slope)) continue;
      if (std::abs(slope) > 0.25F) break;
      const float expected = near + slope * static_cast<float>(step);
      const float k = nearest(expected - phase);
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

Result<> unwrap_by_gray_code(GrayWords& words, const FringeSet& fringes, double word_periods, double word_offset, int width,
                             int height, int threads, base::PhasePlane& plane, std::vector<PhaseStatus>& status,
                             const base::Progress& progress) {
  // A phase off the middle of its word by up to half of it is as it should be, and by 0.15 more the word's blurred end.
  const WordScale scale{static_cast<float>(word_periods), static_cast<float>(word_periods * (0.5 + word_offset)),
                        static_cast<float>(std::min(0.5 * word_periods + 0.15, 0.5 - 0.1 * word_periods))};
  const auto w = static_cast<std::size_t>(width);
  plane.turns.resize(fringes.turns.size());
  auto done = over_rows(height, threads, "fringes", progress, [&](int first, int last) {
    const std::size_t at = static_cast<std::size_t>(first) * w;
    read_coordinates(scale, &words.words[at], &fringes.turns[at], reinterpret_cast<const std::uint8_t*>(&status[at]),
                     static_cast<std::size_t>(last - first) * w, &words.doubtful[at], &plane.turns[at]);
  });
  if (!done) return done;
  // One fringe off its neighbours on all sides is a misread word. Neighbours tell as their words do, so that none is changed before all
  // are judged.
  struct Repair {
    std::size_t pixel;
    float turns;
  };
  std::vector<std::vector<Repair>> repairs(band_count(height));
  done = over_rows(height, threads, "fringes", progress, [&](int first, int last) {
    std::vector<Repair>& found = repairs[band_of(first)];
    const std::uint8_t* asked = words.doubtful.data();
    const std::size_t end = static_cast<std::size_t>(last) * w;
    for (std::size_t i = static_cast<std::size_t>(first) * w; i < end; ++i) {
      if (asked[i] == 0) {
        std::uint64_t eight = 0;
        if (i + sizeof eight <= end) std::memcpy(&eight, asked + i, sizeof eight);
        if (i + sizeof eight <= end && eight == 0) i += sizeof eight - 1;
        continue;
      }
      const float phase = fringes.turns[i];
      const float middle = static_cast<float>(words.words[i]) * scale.scale + scale.shift;
      const float by_code = asked[i] > 1 ? kUnknown : nearest(middle - phase) + phase;
      const float told = told_by_neighbours(plane.turns, phase, by_code, i, width, height);
      if (std::isnan(told)) {
        if (std::isnan(plane.turns[i])) status[i] = PhaseStatus::kUndecided;
      } else if (told != plane.turns[i]) {
        found.push_back({i, told});
      }
    }
  });
  for (const std::vector<Repair>& band : repairs) {
    for (const Repair& repair : band) plane.turns[repair.pixel] = repair.turns;
    plane.repaired += static_cast<std::int64_t>(band.size());
  }
  return done;
}

Result<> unwrap_by_sets(const std::vector<const FringeSet*>& sets, const std::vector<base::Plane<float>>& sigmas_turns,
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
