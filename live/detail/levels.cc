#include "live/detail/levels.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace crosstie::live::detail {
namespace {

/// Four counts of each level, in turn: neighbours are mostly alike, and one count would wait for itself.
template <typename Sample>
std::vector<std::uint32_t> count(const base::ImageView& image) {
  constexpr std::size_t kLevels = std::size_t{1} << (8 * sizeof(Sample));
  constexpr std::size_t kTurns = sizeof(Sample) == 1 ? 4 : 1;
  std::vector<std::uint32_t> counts(kTurns * kLevels, 0);
  for (int y = 0; y < image.height; ++y) {
    const Sample* row = image.row<Sample>(y);
    for (int x = 0; x < image.width; ++x) ++counts[(static_cast<std::size_t>(x) % kTurns) * kLevels + row[x]];
  }
  for (std::size_t turn = 1; turn < kTurns; ++turn) {
    for (std::size_t level = 0; level < kLevels; ++level) counts[level] += counts[turn * kLevels + level];
  }
  counts.resize(kLevels);
  return counts;
}

}  // namespace

LevelCounts::LevelCounts(const base::ImageView& image)
    : counts_(image.bits == 8 ? count<std::uint8_t>(image) : count<std::uint16_t>(image)),
      white_level_(image.white_level),
      all_(static_cast<double>(image.width) * image.height) {}

std::array<float, 64> LevelCounts::histogram() const {
  std::array<std::uint64_t, 64> bins{};
  for (std::size_t level = 0; level < counts_.size(); ++level) {
    const auto bin = static_cast<std::size_t>(64.0 * static_cast<double>(level) / (white_level_ + 1.0));
    bins[std::min<std::size_t>(bin, 63)] += counts_[level];
  }
  std::array<float, 64> shares{};
  std::transform(bins.begin(), bins.end(), shares.begin(),
                 [&](std::uint64_t pixels) { return static_cast<float>(static_cast<double>(pixels) / all_); });
  return shares;
}

double LevelCounts::share_from(double level) const {
  double pixels = 0.0;
  for (auto i = static_cast<std::size_t>(std::max(0.0, std::ceil(level))); i < counts_.size(); ++i) pixels += counts_[i];
  return pixels / all_;
}

double LevelCounts::share_to(double level) const {
  double pixels = 0.0;
  for (std::size_t i = 0; i < counts_.size() && static_cast<double>(i) <= level; ++i) pixels += counts_[i];
  return pixels / all_;
}

double LevelCounts::quantile(double share) const {
  double pixels = 0.0;
  for (std::size_t i = 0; i < counts_.size(); ++i) {
    pixels += counts_[i];
    if (pixels >= share * all_) return static_cast<double>(i);
  }
  return static_cast<double>(counts_.size() - 1);
}

}  // namespace crosstie::live::detail
