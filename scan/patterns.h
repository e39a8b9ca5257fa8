#pragma once

#include <string>
#include <vector>

#include "base/image.h"
#include "base/pattern_sequence.h"
#include "base/result.h"

namespace crosstie::scan {

/// What a projector is to show.
struct PatternOptions {
  int width_px = 0;  ///< of the projector
  int height_px = 0;
  /// Extent of a fringe of each set [projector px], the finest first. One: a Gray code tells the fringes apart; several: they do so
  /// together, and their fringes' numbers over the projector must not repeat each other's pattern within it.
  std::vector<double> periods_px = {32.0};
  int steps = 8;        ///< images of each set, 3..64; from 4 on the camera's noise can be told from them
  bool x = true;        ///< upright stripes
  bool y = true;        ///< lying stripes; with both directions every scan tests the head's calibration
  bool inverse = true;  ///< each Gray code image also with bright and dark exchanged: thresholds that no surface upsets
  bool complementary =
      true;            ///< Gray code words of half a fringe, so that a blurred edge cannot tell a wrong fringe; costs one image
  double gamma = 1.0;  ///< of the projector: what it shows is level^gamma; levels are chosen so that light is a cosine
  double contrast = 0.9;  ///< of the fringes, 0..1: at 1 their crests and troughs reach the ends of the grey scale
  /// The first fringes of each direction, white and black once more at the end: whether anything moved, and the light with it.
  bool repeat = true;
  /// Relative exposure times of a series for shiny and dark surfaces; every set of fringes is shown once for each.
  std::vector<double> exposures = {1.0};

  /// Error kUsage that names what is out of its domain; also where nothing tells the fringes apart.
  [[nodiscard]] base::Result<> validate() const;
};

/// The sequence: white and black (in which markers are found), the Gray codes and fringes of each direction, and then the repeats.
/// Files are named in their order, "00.png" on.
base::Result<base::PatternSequence> make_patterns(const PatternOptions& options);

/// The image that the projector shows for a pattern of make_patterns(options), 8 bits.
base::Image render_pattern(const PatternOptions& options, const base::PatternSequence& sequence, const base::Pattern& pattern);

}  // namespace crosstie::scan
