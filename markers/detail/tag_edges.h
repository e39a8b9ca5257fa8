#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include <Eigen/Core>

#include "markers/detail/sampler.h"
#include "markers/detail/tag_geometry.h"
#include "markers/tag_layout.h"

namespace crosstie::markers::detail {

/// The tones that a tag shows in the image.
struct TagPattern {
  const TagLayout& layout;
  std::uint64_t code = 0;
  int bits = 0;
  bool inverted = false;

  /// 1 = white, 0 = black, as seen; free cells are as white as paper.
  [[nodiscard]] double tone(int x, int y) const {
    const int cell = layout.at(x, y);
    const bool white = cell >= 0 ? ((code >> (bits - 1 - cell)) & 1U) != 0 : cell != TagLayout::kBlack;
    return white != inverted ? 1.0 : 0.0;
  }
};

/// The four edges of a border square, adjusted to the grey levels (model: detect_tags()).
struct TagEdges {
  Corners corners_px;
  Eigen::Matrix<double, 8, 8> corners_cov_px2 = Eigen::Matrix<double, 8, 8>::Zero();  ///< for the pixels' noise alone
  Eigen::Matrix2d centre_cov_px2 = Eigen::Matrix2d::Zero();  ///< of the meeting of the diagonals, likewise
  double blur_px = 0.0;                                      ///< mean of the edges
  double contrast = 0.0;                                     ///< white minus black in grey levels, mean of the edges
  double deviation_power = 0.0;  ///< of the third and fourth Legendre terms over what noise explains; 1 where it does
};

inline constexpr int kTagDeviationDof = 8;

struct TagEdgeOptions {
  double saturated_level = 253.0;  ///< [grey levels]
  double min_contrast = 3.0;       ///< [grey levels]
};

/// Nothing where an edge is not there: no contrast, blurred over more than half a cell, hidden, outside of the image.
std::optional<TagEdges> fit_tag_edges(const Sampler& image, const TagPattern& pattern, const Corners& start,
                                      const TagEdgeOptions& options);

}  // namespace crosstie::markers::detail
