#include "scan/detail/gray_code.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <complex>
#include <numbers>

#include "scan/detail/phase_kernel.h"
#include "scan/detail/rows.h"

namespace crosstie::scan::detail {
namespace {

constexpr float kDoubtful = 0.3F;
constexpr double kSmooth = 0.15;  // turns between neighbouring pixels of a surface

template <typename Sample>
void read_rows(const std::vector<GrayImages>& images, const FringeSet& fringes, int first, int last, GrayWords& result) {
  const auto width = static_cast<std::size_t>(images.front().bright_where_set.width());
  std::vector<const Sample*> bright(images.size()), inverse(images.size(), nullptr);
  for (int y = first; y < last; ++y) {
    const std::size_t at = static_cast<std::size_t>(y) * width;
    for (std::size_t bit = 0; bit < images.size(); ++bit) {
      bright[bit] = images[bit].bright_where_set.view().template row<Sample>(y);
      if (images[bit].inverse) inverse[bit] = images[bit].inverse->view().template row<Sample>(y);
    }
    read_gray_row(bright.data(), inverse.data(), images.size(), kDoubtful, &fringes.mean[at], &fringes.modulation[at], width,
                  &result.words[at], &result.doubtful[at]);
  }
}

unsigned gray_of(std::uint16_t word) { return static_cast<unsigned>(word) ^ (static_cast<unsigned>(word) >> 1U); }

/// Words that differ from their neighbour's on the same surface.
struct WordChanges {
  /// At a change from word w to w + 1 the coordinate is word_periods (w + 1 + offset), of which the phase is the fraction.
  std::complex<double> sum = 0.0;
  std::int64_t count = 0;
  std::int64_t falling = 0;
  std::array<std::int64_t, 16> flips = {};  // by bit, and those of them that lead to another word than the next
  std::array<std::int64_t, 16> jumps = {};

  void add(const GrayWords& words, const FringeSet& fringes, std::size_t a, std::size_t b, double word_periods) {
    const int step = static_cast<int>(words.words[b]) - static_cast<int>(words.words[a]);
    double change = static_cast<double>(fringes.turns[b]) - static_cast<double>(fringes.turns[a]);
    change -= std::round(change);
    if (std::abs(change) > kSmooth) return;  // no neighbours on one surface
    const unsigned changed = gray_of(words.words[a]) ^ gray_of(words.words[b]);
    if (std::has_single_bit(changed)) {
      const auto bit = static_cast<std::size_t>(std::countr_zero(changed));
      ++flips[bit];
      if (step != 1 && step != -1) ++jumps[bit];
    }
    if (step != 1 && step != -1) return;
    if (change * step < 0.0) ++falling;
    const double middle = static_cast<double>(fringes.turns[a]) + 0.5 * change;
    const int upper = std::max(words.words[a], words.words[b]);
    sum += std::polar(1.0, 2.0 * std::numbers::pi * (middle - word_periods * upper));
    ++count;
  }

  void operator+=(const WordChanges& other) {
    sum += other.sum;
    count += other.count;
    falling += other.falling;
    for (std::size_t bit = 0; bit < flips.size(); ++bit) {
      flips[bit] += other.flips[bit];
      jumps[bit] += other.jumps[bit];
    }
  }
};

}  // namespace

base::Result<GrayWords> read_gray_code(const std::vector<GrayImages>& images, const FringeSet& fringes, int threads,
                                       const base::Progress& progress) {
  const int height = images.front().bright_where_set.height();
  GrayWords result;
  result.words.resize(fringes.mean.size());
  result.doubtful.resize(fringes.mean.size());
  auto done = over_rows(height, threads, "Gray code", progress, [&](int first, int last) {
    if (images.front().bright_where_set.bits() == 8) {
      read_rows<std::uint8_t>(images, fringes, first, last, result);
    } else {
      read_rows<std::uint16_t>(images, fringes, first, last, result);
    }
  });
  if (!done) return base::fail(std::move(done));
  return result;
}

WordOffset find_word_offset(const GrayWords& words, const FringeSet& fringes, const std::vector<base::PhaseStatus>& status,
                            int width, int height, double word_periods, int threads) {
  const auto w = static_cast<std::size_t>(width);
  std::vector<WordChanges> bands(band_count(height));
  over_rows(height, threads, [&](int first, int last) {
    WordChanges& changes = bands[band_of(first)];
    std::vector<std::uint32_t> places(w);
    const auto look = [&](std::size_t at, std::size_t other, std::size_t count) {
      const std::size_t found = differing(&words.words[at], &words.words[other], count, places.data());
      for (std::size_t i = 0; i < found; ++i) {
        const std::size_t a = at + places[i], b = other + places[i];
        if (status[a] == base::PhaseStatus::kValid && status[b] == base::PhaseStatus::kValid)
          changes.add(words, fringes, a, b, word_periods);
      }
    };
    for (int y = first; y < last; ++y) {
      const std::size_t at = static_cast<std::size_t>(y) * w;
      look(at, at + 1, w - 1);
      if (y + 1 < height) look(at, at + w, w);
    }
  });
  WordChanges all;
  for (const WordChanges& band : bands) all += band;
  constexpr std::int64_t kLeastFlips = 30;
  WordOffset result;
  for (std::size_t bit = 0; bit < all.flips.size(); ++bit) {
    if (all.flips[bit] >= kLeastFlips && 2 * all.jumps[bit] > all.flips[bit]) result.misplaced_bit = static_cast<int>(bit);
  }
  result.changes = all.count;
  if (result.changes == 0) return result;
  result.backwards = 2 * all.falling > result.changes;
  result.agreement = std::abs(all.sum) / static_cast<double>(result.changes);
  result.offset = std::arg(all.sum) / (2.0 * std::numbers::pi) / word_periods;
  return result;
}

}  // namespace crosstie::scan::detail
