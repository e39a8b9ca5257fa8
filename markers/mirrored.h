#pragma once

#include <optional>
#include <span>
#include <string>

#include "base/observation.h"
#include "markers/family.h"

namespace crosstie::markers {

/// Which way round the markers of an image make sense.
struct Handedness {
  int read = 0;           ///< markers with an id, in use or not
  int only_direct = 0;    ///< in use as they were read, and not when read the other way round
  int only_mirrored = 0;  ///< in use only when read the other way round
};

/// Counts over the observations of one image (kCoded and kRefused).
///
/// A ring that is seen in a mirror, or on an image that was flipped, shows its segments in the opposite order; in all ring
/// families that is another code, so a single ring cannot tell. The list of ids in use can: where it holds the one code and not
/// the other. Without a list (`ids` empty) rings tell nothing. Tags tell by themselves: detect() gives a mirrored one as
/// kRefused with the id that is in use.
[[nodiscard]] Handedness handedness(const base::ImageObservations& image, const MarkerFamily& family, std::span<const int> ids);

/// "image seems mirrored: 12 of 14 markers are ids of the list only when read the other way round; ...", where three at least
/// are and more than the other way; else nothing.
[[nodiscard]] std::optional<std::string> mirror_warning(const base::ImageObservations& image, const MarkerFamily& family,
                                                        std::span<const int> ids);

}  // namespace crosstie::markers
