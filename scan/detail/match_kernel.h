#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace crosstie::scan::detail {

/// The right image, by which left pixels find their places: two coordinates a, b of each pixel, and where it lies in the rectified frame.
/// b is the other phase, or the epipolar curve where there is none (b_raw and b_sigma null, b_smooth = y_px). All planes are
/// width x height; the smooth ones are not a number where no place may be.
struct MatchPlanes {
  const float* a_smooth = nullptr;  ///< with less noise: they tell where to look, and the slopes there
  const float* b_smooth = nullptr;
  const float* a_raw = nullptr;  ///< tell where the place is
  const float* b_raw = nullptr;
  const float* a_sigma = nullptr;
  const float* b_sigma = nullptr;
  const float* x_px = nullptr;  ///< rectified, times the focal length
  const float* y_px = nullptr;
  std::int32_t width = 0;
  std::int32_t height = 0;
  float slope = 0.0F;      ///< median change of a over a pixel along the curves, with its sign
  float min_slope = 0.0F;  ///< of that, which a place must have
};

/// Left pixels, what is known of them, and their places.
struct MatchBatch {
  static constexpr std::size_t kSize = 16;
  template <typename Value>
  using Each = std::array<Value, kSize>;

  Each<float> a = {}, a_sigma = {}, b = {}, b_sigma = {};
  Each<float> curve_px = {};      ///< y of the left pixel in the rectified frame
  Each<float> column = {};        ///< of the place: first where it may be, negative: nowhere; then where it is
  Each<float> row = {};           ///< the same
  Each<std::int32_t> cell = {};   ///< index of the place's upper left pixel
  Each<float> beside_px = {};     ///< x of the match less x_px of the cell's pixel
  Each<float> sigma_px = {};      ///< of x
  Each<float> off_px = {};        ///< y of the match less the curve's; with two phases
  Each<float> off_sigma_px = {};  ///< of it
  Each<std::uint8_t> found =
      {};  ///< 0: there is no place, or it was sought too far off; nothing else of the pixel is told then
};

/// Finds the places of a batch by Newton's method within the bilinear cells of the smooth planes, from cell to cell; then corrects them by
/// the raw planes (which between pixels bend as the smooth ones do) to the likeliest place on the epipolar curve.
void match_batch(const MatchPlanes& planes, MatchBatch& batch);

}  // namespace crosstie::scan::detail
