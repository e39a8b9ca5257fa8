#pragma once

#include <array>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "base/image.h"
#include "markers/family.h"

namespace crosstie::markers::detail {

/// The families of the AprilTag library, by its names.
[[nodiscard]] std::vector<std::string> apriltag_names();

/// Codes, layout and number of bits of a family; the name is left to the caller. Nothing for unknown names.
[[nodiscard]] std::optional<MarkerFamily> apriltag_family(std::string_view name);

/// A tag as the library finds it: which one, and its border square good to about a pixel.
struct TagCandidate {
  int id = 0;
  std::array<Eigen::Vector2d, 4> corners_px;  ///< upper left, upper right, lower right, lower left of the upright tag
  bool inverted = false;                      ///< black and white exchanged
  bool mirrored = false;                      ///< as seen in a mirror; the corners are those of the mirrored layout
};

/// Which variants are looked for.
struct TagSearch {
  bool published = true;  ///< in the tones that the family has
  bool inverted = true;   ///< with black and white exchanged
};

/// All tags of the family `name`, upright variants and mirrored ones. One family costs one search for squares and a decoding
/// for each variant. The detector of the last family is kept for each thread: filling its table of codes takes longer than
/// many a photograph.
///
/// Up to two misread bits are mended where the codes' distance allows (one for tag16h5, none for families of tens of thousands
/// of codes, whose tables would not fit): that is for finding only, what is read is decided on the refined square.
[[nodiscard]] std::vector<TagCandidate> find_tags(const base::ImageView& image, std::string_view name, const TagSearch& search);

}  // namespace crosstie::markers::detail
