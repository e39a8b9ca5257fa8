#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "base/image.h"
#include "base/pattern_sequence.h"
#include "base/phase_map.h"
#include "base/progress.h"
#include "base/result.h"
#include "scan/detail/fringe_set.h"

namespace crosstie::scan::detail {

/// One bit of a Gray code in a camera's image.
struct GrayImages {
  base::Image bright_where_set;
  std::optional<base::Image> inverse;
};

/// The word that each pixel sees.
struct GrayWords {
  base::Plane<std::uint16_t> words;  ///< binary, not Gray any more
  base::Plane<std::uint8_t>
      doubtful;  ///< bits that could be either: at most one where the code changes, more where nothing is seen
};

/// Bits against the inverse image, or against the mean of the fringes where there is none. `images` by bit, most significant first.
/// A bit is doubtful where it differs from its threshold by less than 0.3 of what the fringes' modulation makes expect.
base::Result<GrayWords> read_gray_code(const std::vector<GrayImages>& images, const FringeSet& fringes, int threads,
                                       const base::Progress& progress);

/// Where the words change against the fringes.
struct WordOffset {
  double offset = 0.0;       ///< [words], of AxisCode::word_offset
  double agreement = 0.0;    ///< resultant length, 0..1
  std::int64_t changes = 0;  ///< of a word to its neighbour
  /// A bit most of whose changes lead to another word than the next although the phase goes on: it stands in another image. Counted from
  /// the least significant one, -1: there is none.
  int misplaced_bit = -1;
  bool backwards = false;  ///< words grow where phases fall
};

/// From the pixels between which the word grows or falls by one along the rows and columns of the image.
WordOffset find_word_offset(const GrayWords& words, const FringeSet& fringes, const std::vector<base::PhaseStatus>& status,
                            int width, int height, double word_periods, int threads);

}  // namespace crosstie::scan::detail
