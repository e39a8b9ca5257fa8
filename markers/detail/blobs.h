#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace crosstie::markers::detail {

/// A connected set of pixels: their number, sums of their coordinates and products, and bounds (inclusive).
struct Blob {
  std::int64_t count = 0;
  std::int64_t x = 0, y = 0;
  std::int64_t xx = 0, xy = 0, yy = 0;
  int left = 0, right = 0, top = 0, bottom = 0;
};

/// The sets of pixels, connected by their sides, whose bits are set in `words` (rows of words_per_row(width), see
/// level_kernels.h), of at least `min_count` pixels, in the order of their first pixels. Runs of pixels are joined row by row.
[[nodiscard]] std::vector<Blob> find_blobs(const std::uint64_t* words, int width, int height, std::int64_t min_count);

}  // namespace crosstie::markers::detail
