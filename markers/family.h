#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/result.h"
#include "markers/tag_layout.h"

namespace crosstie::markers {

using base::Result;

/// One id of a family.
/// Rings: `code` holds the segments in clockwise order as seen from the front, the first one in the most significant bit;
/// 1 = the segment has the tone of the dot. It stands in the family's canonical rotation: from the start sequence on where the
/// family has one, else the rotation with the smallest value.
/// Tags: the bits in the order of TagLayout::cells, 1 = white, for the upright tag.
struct MarkerCode {
  int id = 0;
  std::uint64_t code = 0;
};

/// A family of coded markers: square tags where `tag` is set (the radii are then 0), else circular ones: a dot, a gap, a ring of
/// equal segments and a quiet zone, concentric.
///
///     0 .. 1            dot                         (tone 1)
///     1 .. ring_inner   gap                         (tone 0)
///     .. ring_outer     ring of `bits` segments     (tone 1 where the code's bit is set)
///     .. disc_outer     quiet zone                  (tone 0)
///     .. border_outer   border                      (tone 1; none where border_outer == disc_outer)
///
/// All radii are in radii of the dot. The tone is relative: white on black and black on white carry the same ids.
struct MarkerFamily {
  std::string name;
  int bits = 0;  ///< number of segments (8 to 24), or of a tag's bits (16 to 52)
  double ring_inner = 0.0;
  double ring_outer = 0.0;
  double disc_outer = 0.0;
  double border_outer = 0.0;
  std::uint32_t start_sequence = 0;  ///< the first start_bits segments of every code
  int start_bits = 0;                ///< 0 where the family has no start sequence
  std::vector<MarkerCode> codes;     ///< sorted by id
  std::optional<TagLayout> tag;      ///< the cells of a family of square tags

  /// The id of a ring that was read clockwise from any segment on; nothing where it is no code of this family.
  [[nodiscard]] std::optional<int> id_of_ring(std::uint64_t ring) const;

  /// The code of an id; nothing where the family does not have it.
  [[nodiscard]] std::optional<std::uint64_t> code_of(int id) const;

  /// (smallest rotation of the code, id), sorted: what id_of_ring searches. Filled by marker_family(); empty for tags.
  std::vector<MarkerCode> by_rotation;
};

/// The smallest value among the cyclic rotations of a ring of `bits` segments.
[[nodiscard]] std::uint64_t smallest_rotation(std::uint64_t ring, int bits);

/// The ring seen in a mirror: its segments in the opposite order.
[[nodiscard]] std::uint64_t mirrored_ring(std::uint64_t ring, int bits);

/// The families that marker_family() knows: "ring10", "aicon12", ..., "agisoft12", ..., "apriltag:tag36h11", ...
[[nodiscard]] std::vector<std::string> marker_family_names();

/// A family by its name.
///
/// ring10: start sequence 110, then 7 bits, most significant first; the id is the n of 0..127 whose reflected Gray code
///   n ^ (n >> 1) those bits are. The 54 of the 128 whose start sequence occurs only once round the ring are codes.
/// aicon12/14/20 (the rings of Schneider, 1991): an even number of segments set, at least one diametrically opposite pair set,
///   not all set; ids count the codes in ascending order of their smallest rotation from 1: 147, 516, 24793.
/// agisoft12/14/16/20: an even number of at least 4 segments set, not all set, and a smallest rotation over 2^(bits/2); ids as
///   above: 161, 561, 2001, 26013.
/// apriltag:NAME: the families of the AprilTag library by its own names, with its ids from 0 on: tag16h5, tag25h9, tag36h10,
///   tag36h11 (Olson 2011, Wang and Olson 2016), tagCircle21h7, tagCircle49h12, tagCustom48h12, tagStandard41h12,
///   tagStandard52h13 (Krogius, Haggenmiller and Olson 2019). Any two codes in any rotation differ in as many bits as the number
///   behind the h says.
///
/// Error: kUsage for any other name, with the nearest name and the list.
[[nodiscard]] Result<MarkerFamily> marker_family(std::string_view name);

}  // namespace crosstie::markers
