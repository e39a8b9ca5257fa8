#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "base/image.h"

namespace crosstie::live::detail {

/// How often each grey level occurs in an image.
class LevelCounts {
 public:
  explicit LevelCounts(const base::ImageView& image);

  /// Shares of the pixels in 64 equal bins from 0 to the white level; what lies above it counts to the last one.
  [[nodiscard]] std::array<float, 64> histogram() const;
  /// Share of the pixels at or above, at or below a level.
  [[nodiscard]] double share_from(double level) const;
  [[nodiscard]] double share_to(double level) const;
  /// The lowest level that at least this share of the pixels does not exceed.
  [[nodiscard]] double quantile(double share) const;

 private:
  std::vector<std::uint32_t> counts_;
  double white_level_ = 255.0;
  double all_ = 0.0;
};

}  // namespace crosstie::live::detail
