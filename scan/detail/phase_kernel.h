#pragma once

#include <cstddef>
#include <cstdint>

namespace crosstie::scan::detail {

/// The loops over the pixels of solved fringe images and of the Gray code, compiled for several instruction sets and chosen at run time. Raw
/// pointers, no Eigen. A status is a base::PhaseStatus.

/// By what the phases of a set are judged (phase_quality.h).
struct PhaseLimits {
  float gain = 0.0F;  ///< var(phase [rad]) = gain var(level) / B^2
  float read = 0.0F;  ///< noise
  float shot = 0.0F;
  float waveform = 0.0F;  ///< what the waveform adds to the squares, of B^2
  float middle = 0.0F;    ///< of the grey scale
  float least_modulation = 0.0F;
  float most_sigma_turns = 0.0F;
  float most_ratio = 0.0F;  ///< of the squares to what is expected of them
};

/// A row of pixels. `above` and `below` are the modulations of the rows beside it, null at the image's ends.
struct JudgedRow {
  const float* above;
  const float* modulation;
  const float* below;
  const float* mean;
  const float* gains;  ///< instead of the limits' one, or null
  float* squares;      ///< becomes the phases' sigmas [turns]
  std::uint8_t* status;
};

struct JudgeSums {
  double ratios = 0.0;  ///< of the pixels that were tested
  std::int64_t tested = 0;
  std::int64_t disturbed = 0;
  std::int64_t valid = 0;  ///< still
};

void judge_row(const PhaseLimits& limits, const JudgedRow& row, std::size_t count, JudgeSums& sums);

/// Bits of a Gray code, most significant first, as binary words, and how many of them are doubtful: nearer to their threshold than `doubt` of
/// the modulation. The threshold is the inverse image, where the difference has twice the size, or the mean where there is none (null).
void read_gray_row(const std::uint8_t* const* bright, const std::uint8_t* const* inverse, std::size_t bits, float doubt,
                   const float* mean, const float* modulation, std::size_t count, std::uint16_t* words, std::uint8_t* doubtful);
void read_gray_row(const std::uint16_t* const* bright, const std::uint16_t* const* inverse, std::size_t bits, float doubt,
                   const float* mean, const float* modulation, std::size_t count, std::uint16_t* words, std::uint8_t* doubtful);

/// Places at which two rows differ, into `places` (as long as the rows); returns how many.
std::size_t differing(const std::uint16_t* a, const std::uint16_t* b, std::size_t count, std::uint32_t* places);

/// Cosine and sine of 2 pi `times` turns.
void point_on_circle(const float* turns, std::size_t count, int times, float* cosine, float* sine);

/// Adds a correction to phases in [0, 1), linear between `bins` + 1 values over a period; they stay in [0, 1).
void correct_turns(const float* correction, std::size_t bins, float* turns, std::size_t count);

/// Coordinates by words: k + phase, nearest to scale * word + shift.
struct WordScale {
  float scale = 0.0F;
  float shift = 0.0F;
  float within = 0.0F;  ///< farther off, the word does not tell
};

/// `coordinates` become not a number where no word tells, or `status` is not valid. `doubtful`, bits that could be either, becomes what is left
/// to ask the neighbours for: 0 nothing, 1 whether they agree with the word, 2 all.
void read_coordinates(const WordScale& scale, const std::uint16_t* words, const float* turns, const std::uint8_t* status,
                      std::size_t count, std::uint8_t* doubtful, float* coordinates);

}  // namespace crosstie::scan::detail
