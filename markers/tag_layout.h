#pragma once

#include <cstdint>
#include <vector>

namespace crosstie::markers {

/// The cells of a square tag (AprilTag), total_cells x total_cells of them, seen from the front, the first one in the upper left
/// corner. Between two concentric rings of cells of constant tone, one black and one white, runs the *border square*: its four
/// edges are what is measured, its centre is the tag's.
///
///     white_inside false   white ring outside, black ring inside, the bits within     (tag16h5, tag25h9, tag36h10, tag36h11)
///     white_inside true    black ring outside, white ring inside, bits within and around     (the others)
///
/// Tones are those of the published tag; an inverted one (polarity) has them exchanged.
struct TagLayout {
  int total_cells = 0;
  int border_cells = 0;  ///< side of the border square
  bool white_inside = false;

  /// Row by row: the number of the code's bit that the cell shows (0 = the most significant), or one of those below.
  std::vector<int> cells;
  static constexpr int kBlack = -1;
  static constexpr int kWhite = -2;
  static constexpr int kFree = -3;  ///< belongs to nothing: round tags leave the corners of their square to the paper

  /// Place of the border square's upper left corner in cells: (offset, offset).
  [[nodiscard]] int offset() const { return (total_cells - border_cells) / 2; }
  [[nodiscard]] int at(int x, int y) const { return cells[static_cast<std::size_t>(y * total_cells + x)]; }
};

/// The code that a tag of `bits` bits shows when it is turned clockwise by a quarter.
[[nodiscard]] std::uint64_t quarter_turned(const TagLayout& layout, std::uint64_t code, int bits);

}  // namespace crosstie::markers
