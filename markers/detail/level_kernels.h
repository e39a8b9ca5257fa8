#pragma once

#include <cstddef>
#include <cstdint>

namespace crosstie::markers::detail {

/// Loops over all pixels of an image, compiled for several instruction sets and chosen at run time. Raw pointers, and no Eigen
/// in this file's source: objects built for AVX may not exchange its types with the rest. All results are integers and the same
/// on every instruction set.

/// An image of 8 bits: rows of `width` samples, `stride` apart.
struct GreyPlane {
  const std::uint8_t* data = nullptr;
  int width = 0;
  int height = 0;
  std::ptrdiff_t stride = 0;

  [[nodiscard]] const std::uint8_t* row(int y) const { return data + y * stride; }
};

/// Side of the window of the local mean; sums over it fit into 16 bits after three of its five doublings.
inline constexpr int kMeanWindowPx = 32;

/// 64-bit words that hold one bit for each pixel of a row.
[[nodiscard]] inline std::size_t words_per_row(int width) { return (static_cast<std::size_t>(width) + 63) / 64; }

/// Sets the bits (pixel x of row y is bit x % 64 of word y words_per_row + x / 64) of the pixels that exceed, and of those that
/// undercut, the mean over the window [x - 16, x + 16) x [y - 16, y + 16) by more than `delta`. The image goes on beyond its
/// border with the border's pixels. The mean is rounded: up to 0.75/256 up for averaging, then down to a whole grey level.
void compare_with_local_mean(const GreyPlane& grey, int delta, std::uint64_t* brighter, std::uint64_t* darker);

/// Half the width and height, rounded down; a pixel is the mean of four.
void halve(const GreyPlane& grey, std::uint8_t* half);

/// How many of `count` samples are >= high, and how many are <= low.
struct LevelCounts {
  std::int64_t high = 0;
  std::int64_t low = 0;
};
[[nodiscard]] LevelCounts count_levels(const std::uint8_t* samples, int count, std::uint8_t high, std::uint8_t low);
[[nodiscard]] LevelCounts count_levels(const std::uint16_t* samples, int count, std::uint16_t high, std::uint16_t low);

/// The levels of a box of pixels.
struct LevelRange {
  int darkest = 255;
  int brightest = 0;
  int steepest = 0;  ///< largest difference between neighbours in a row or a column
};

/// Of the `width` x `height` samples from `first` on, rows `stride` apart; at least 9 columns.
[[nodiscard]] LevelRange level_range(const std::uint8_t* first, std::ptrdiff_t stride, int width, int height);

}  // namespace crosstie::markers::detail
