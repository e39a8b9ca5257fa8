#pragma once

#include <array>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/result.h"

namespace crosstie::base {

/// What the projector shows in one image.
enum class PatternKind {
  kWhite,        ///< all of it bright
  kBlack,        ///< all of it dark
  kGray,         ///< one bit of a Gray code
  kGrayInverse,  ///< the same with bright and dark exchanged
  kFringe,       ///< a shifted cosine
};

/// The coordinate of the projector that a pattern tells: x grows along its rows (upright stripes), y along its columns.
enum class ProjectorAxis { kX, kY };

/// "white", "black", "gray", "gray_inverse", "fringe".
[[nodiscard]] std::string_view pattern_kind_name(PatternKind kind);
[[nodiscard]] std::optional<PatternKind> pattern_kind_from_name(std::string_view name);
/// "x", "y".
[[nodiscard]] std::string_view axis_name(ProjectorAxis axis);

/// One image of a sequence.
struct Pattern {
  PatternKind kind = PatternKind::kWhite;
  ProjectorAxis axis = ProjectorAxis::kX;  ///< of Gray code and fringes
  int bit = 0;                             ///< of a Gray code: 0 is the most significant
  int frequency = 0;                       ///< of fringes: index into AxisCode::fringes
  double shift = 0.0;                      ///< of fringes, in periods: light = A + B cos(2 pi (fringes u - shift))
  double exposure = 1.0;                   ///< relative to the shortest of an exposure series
  std::array<std::string, 2> files = {};   ///< name of the image that the left, the right camera took of it
  /// Shown once more, to be compared with the first time: whether all stood still. It takes no part in the coordinate.
  bool repeat = false;
};

/// How a coordinate is coded. u is the coordinate over the projector's extent, 0..1; t = fringes[finest] * u is the coordinate in
/// periods of the finest fringes, the unit in which phases are unwrapped.
struct AxisCode {
  /// Periods over the extent of the projector, of each set of fringes; > 0, not necessarily whole.
  std::vector<double> fringes;
  /// Gray code words count along the axis: word = floor(t / word_periods - word_offset); 0 bits: there is no Gray code.
  int gray_bits = 0;
  double word_periods = 0.5;          ///< extent of a word in periods of the finest fringes
  std::optional<double> word_offset;  ///< in words; nothing: to be found from the images, as for captures by other programs

  [[nodiscard]] int finest() const;
  [[nodiscard]] bool used() const { return !fringes.empty(); }
};

/// What a projector shows one after the other, and by which names the images of it are found: the manifest of a capture.
struct PatternSequence {
  int width_px = 0;  ///< of the projector; 0: unknown, as for captures by other programs
  int height_px = 0;
  AxisCode x;
  AxisCode y;
  std::vector<Pattern> patterns;  ///< in the order in which they are shown

  [[nodiscard]] const AxisCode& code(ProjectorAxis axis) const { return axis == ProjectorAxis::kX ? x : y; }
  /// Indices of the fringe images of one set without repeats, in the order of `patterns`.
  [[nodiscard]] std::vector<int> fringe_images(ProjectorAxis axis, int frequency) const;
  /// The first image of the same pattern before `index`, where that is a repeat, or white or black; nothing where it is none.
  [[nodiscard]] std::optional<int> first_of(int index) const;
  /// Error kBadInput that names what contradicts itself: no fringes, fewer than three different shifts of a set, bits missing or
  /// given twice, more than 15 bits, sets that nothing unwraps, sizes or exposures out of their domain.
  [[nodiscard]] Result<> validate() const;
};

/// Reads a manifest, format "crosstie-patterns/1" (docs/formats.md); errors name the file and the image. The result is valid.
Result<PatternSequence> read_pattern_manifest(const std::filesystem::path& path);
Result<> write_pattern_manifest(const std::filesystem::path& path, const PatternSequence& sequence);

}  // namespace crosstie::base
