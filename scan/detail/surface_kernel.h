#pragma once

#include <cstddef>
#include <cstdint>

namespace crosstie::scan::detail {

/// The loops over the pixels of phase maps and of images that look at neighbours, compiled for several instruction sets and chosen at run
/// time. Raw pointers, no Eigen.

/// What ends a surface in a plane's coordinates (guard.h): jumps beyond `jump` and `sigmas` of the larger sigma, and with `creases` changes
/// of the slope.
struct SurfaceLimits {
  float jump = 0.0F;
  float jump_sigmas = 0.0F;
  float crease = 0.0F;
  float crease_sigmas = 0.0F;
  bool creases = false;
};

/// Marks the ends of a surface in one row. `turns` and `sigma` point to it, in planes of this width; `above` and `below` say how many rows
/// there are beside it.
void mark_ends(const SurfaceLimits& limits, const float* turns, const float* sigma, std::size_t width, int above, int below,
               char* bad);

/// out[i]: whether any of the `count` rows has a mark there. The rows must hold as many bytes as `width`.
void any_marked(const char* const* rows, std::size_t count, std::size_t width, char* out);

/// The largest sigma of valid pixels (`status` 0), 0 without any.
float largest_valid(const std::uint8_t* status, const float* sigma, std::size_t count);

/// grad(turns) . grad(ln b) of a row's pixels at [reach, width - reach), over `kLeaningReach` pixels on each side. Not a number where some
/// neighbour has no coordinate, the pixel has none, or b < least; returns whether pixels of the first kind are among them.
inline constexpr int kLeaningReach = 3;
bool lean_row(const float* turns, const float* modulation, std::size_t width, float least, float* lean);

/// Places at which |lean| >= `sigmas` * sigma on a surface, into `places` (as long as the row); returns how many.
std::size_t leaning_places(const float* lean, const float* sigma, const char* surface, float sigmas, std::size_t count,
                           std::uint32_t* places);

/// Sums over the pixels of part of a row, by which two images of one pattern are compared (image_shift.h): their four times gradients x and
/// y, level h of the earlier one, difference d. Exact.
struct ShiftSums {
  double xx = 0.0, xy = 0.0, yy = 0.0;
  double xh = 0.0, yh = 0.0, hh = 0.0;
  double x = 0.0, y = 0.0, h = 0.0;
  double dx = 0.0, dy = 0.0, dh = 0.0, d = 0.0, dd = 0.0;
  double count = 0.0;
};

/// Three rows of an image, from one pixel before the first that counts to one after the last.
template <typename Sample>
struct ThreeRows {
  const Sample* above;
  const Sample* here;
  const Sample* below;
};

/// Pixels [first, last) that lie below `limit` in both images.
void add_shift_sums(const ThreeRows<std::uint8_t>& earlier, const ThreeRows<std::uint8_t>& later, std::size_t first,
                    std::size_t last, double limit, ShiftSums& sums);
void add_shift_sums(const ThreeRows<std::uint16_t>& earlier, const ThreeRows<std::uint16_t>& later, std::size_t first,
                    std::size_t last, double limit, ShiftSums& sums);

}  // namespace crosstie::scan::detail
