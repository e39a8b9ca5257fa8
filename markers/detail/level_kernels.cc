#include "markers/detail/level_kernels.h"

#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <vector>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "markers/detail/level_kernels.cc"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace crosstie::markers::detail::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using D16 = hn::ScalableTag<std::uint16_t>;
using D8 = hn::Rebind<std::uint8_t, D16>;

/// sums += added - removed
void MoveSums(const std::uint8_t* added, const std::uint8_t* removed, std::size_t count, std::uint16_t* sums) {
  const D16 d16;
  const D8 d8;
  const std::size_t lanes = hn::Lanes(d16);
  std::size_t x = 0;
  for (; x + lanes <= count; x += lanes) {
    const auto plus = hn::PromoteTo(d16, hn::LoadU(d8, added + x));
    const auto minus = hn::PromoteTo(d16, hn::LoadU(d8, removed + x));
    hn::StoreU(hn::Sub(hn::Add(hn::LoadU(d16, sums + x), plus), minus), d16, sums + x);
  }
  for (; x < count; ++x) sums[x] = static_cast<std::uint16_t>(sums[x] + added[x] - removed[x]);
}

/// to[i] = from[i] + from[i + kShift] for i < count; both have room for a vector more.
template <std::size_t kShift>
void Double(const std::uint16_t* from, std::size_t count, std::uint16_t* to) {
  const D16 d16;
  for (std::size_t i = 0; i < count; i += hn::Lanes(d16)) {
    hn::StoreU(hn::Add(hn::LoadU(d16, from + i), hn::LoadU(d16, from + i + kShift)), d16, to + i);
  }
}

#if HWY_TARGET == HWY_SCALAR
/// The same, pixel by pixel, where there are no vectors.
void Compare(const std::uint8_t* row, const std::uint16_t* sums8, std::size_t count, int delta, std::uint8_t* brighter,
             std::uint8_t* darker) {
  const auto average = [](int a, int b) { return (a + b + 1) / 2; };
  for (std::size_t x = 0; x < count; ++x) {
    if (x % 8 == 0) brighter[x / 8] = darker[x / 8] = 0;
    const int mean = average(average(sums8[x], sums8[x + 8]), average(sums8[x + 16], sums8[x + 24])) >> 8;
    const auto bit = static_cast<std::uint8_t>(1U << (x % 8));
    if (row[x] > mean + delta) brighter[x / 8] |= bit;
    if (row[x] + delta < mean) darker[x / 8] |= bit;
  }
}
#else
/// Bits of the pixels over and under the mean; `sums8` are those over eight columns. `bytes` have room for a vector more.
void Compare(const std::uint8_t* row, const std::uint16_t* sums8, std::size_t count, int delta, std::uint8_t* brighter,
             std::uint8_t* darker) {
  const D16 d16;
  const D8 d8;
  const std::size_t lanes = hn::Lanes(d16);
  const auto margin = hn::Set(d16, static_cast<std::uint16_t>(delta));
  for (std::size_t x = 0; x < count; x += lanes) {
    const auto left = hn::AverageRound(hn::LoadU(d16, sums8 + x), hn::LoadU(d16, sums8 + x + 8));
    const auto right = hn::AverageRound(hn::LoadU(d16, sums8 + x + 16), hn::LoadU(d16, sums8 + x + 24));
    const auto mean = hn::ShiftRight<8>(hn::AverageRound(left, right));
    const auto grey = hn::PromoteTo(d16, hn::LoadU(d8, row + x));
    std::uint8_t bits[HWY_MAX_BYTES / 8] = {};
    hn::StoreMaskBits(d16, hn::Gt(grey, hn::Add(mean, margin)), bits);
    std::memcpy(brighter + x / 8, bits, (lanes + 7) / 8);
    hn::StoreMaskBits(d16, hn::Lt(hn::Add(grey, margin), mean), bits);
    std::memcpy(darker + x / 8, bits, (lanes + 7) / 8);
  }
}

#endif

/// `sums` are over the window's rows, from 16 columns before the first pixel on; `scratch` holds three rows of `stride`.
void CompareRow(const std::uint16_t* sums, std::size_t stride, std::uint16_t* scratch, const std::uint8_t* row,
                std::size_t width, int delta, std::uint8_t* brighter, std::uint8_t* darker) {
  const std::size_t padded = width + kMeanWindowPx;
  std::uint16_t* const sums2 = scratch;
  std::uint16_t* const sums4 = scratch + stride;
  std::uint16_t* const sums8 = scratch + 2 * stride;
  Double<1>(sums, padded - 1, sums2);
  Double<2>(sums2, padded - 3, sums4);
  Double<4>(sums4, padded - 7, sums8);
  Compare(row, sums8, width, delta, brighter, darker);
}

void HalveRow(const std::uint8_t* upper, const std::uint8_t* lower, std::size_t width, std::uint8_t* half) {
  std::size_t x = 0;
#if HWY_TARGET != HWY_SCALAR
  const hn::ScalableTag<std::uint8_t> d8;
  const hn::RepartitionToWide<decltype(d8)> d16;
  const hn::RebindToSigned<decltype(d16)> d16_signed;
  const hn::Rebind<std::uint8_t, decltype(d16)> d8_half;
  const std::size_t lanes = hn::Lanes(d16);
  const auto low_byte = hn::Set(d16, 255);
  const auto two = hn::Set(d16, 2);
  for (; x + lanes <= width; x += lanes) {
    const auto a = hn::BitCast(d16, hn::LoadU(d8, upper + 2 * x));
    const auto b = hn::BitCast(d16, hn::LoadU(d8, lower + 2 * x));
    const auto even = hn::Add(hn::And(a, low_byte), hn::And(b, low_byte));
    const auto odd = hn::Add(hn::ShiftRight<8>(a), hn::ShiftRight<8>(b));
    const auto mean = hn::ShiftRight<2>(hn::Add(hn::Add(even, odd), two));
    hn::StoreU(hn::DemoteTo(d8_half, hn::BitCast(d16_signed, mean)), d8_half, half + x);
  }
#endif
  for (; x < width; ++x) {
    half[x] = static_cast<std::uint8_t>((upper[2 * x] + upper[2 * x + 1] + lower[2 * x] + lower[2 * x + 1] + 2) / 4);
  }
}

template <typename Sample>
LevelCounts Count(const Sample* samples, int count, Sample high, Sample low) {
  const hn::ScalableTag<Sample> d;
  const auto lanes = static_cast<int>(hn::Lanes(d));
  const auto at_high = hn::Set(d, high);
  const auto at_low = hn::Set(d, low);
  LevelCounts counts;
  int x = 0;
  for (; x + lanes <= count; x += lanes) {
    const auto grey = hn::LoadU(d, samples + x);
    counts.high += static_cast<std::int64_t>(hn::CountTrue(d, hn::Eq(hn::Max(grey, at_high), grey)));
    counts.low += static_cast<std::int64_t>(hn::CountTrue(d, hn::Eq(hn::Min(grey, at_low), grey)));
  }
  for (; x < count; ++x) {
    counts.high += samples[x] >= high ? 1 : 0;
    counts.low += samples[x] <= low ? 1 : 0;
  }
  return counts;
}

LevelCounts Count8(const std::uint8_t* samples, int count, std::uint8_t high, std::uint8_t low) {
  return Count(samples, count, high, low);
}
LevelCounts Count16(const std::uint16_t* samples, int count, std::uint16_t high, std::uint16_t low) {
  return Count(samples, count, high, low);
}

/// Levels of the first `count` columns, and their differences to the right and upwards; the last vector may overlap the one before.
template <std::size_t kLanes>
HWY_INLINE LevelRange RangeOf(const std::uint8_t* first, std::ptrdiff_t stride, std::size_t count, int height) {
  const hn::CappedTag<std::uint8_t, kLanes> d;
  const std::size_t lanes = hn::Lanes(d);
  auto low = hn::Set(d, 255);
  auto high = hn::Zero(d);
  auto steps = hn::Zero(d);
  const auto step = [](auto a, auto b) { return hn::Or(hn::SaturatedSub(a, b), hn::SaturatedSub(b, a)); };
  for (int y = 0; y < height; ++y) {
    const std::uint8_t* const row = first + y * stride;
    const std::uint8_t* const above = y > 0 ? row - stride : row;
    for (std::size_t x = 0;; x += lanes) {
      if (x + lanes > count) x = count - lanes;
      const auto level = hn::LoadU(d, row + x);
      low = hn::Min(low, level);
      high = hn::Max(high, level);
      steps = hn::Max(steps, hn::Max(step(level, hn::LoadU(d, row + x + 1)), step(level, hn::LoadU(d, above + x))));
      if (x + lanes == count) break;
    }
  }
  HWY_ALIGN std::uint8_t values[3 * kLanes];
  hn::StoreU(low, d, values);
  hn::StoreU(high, d, values + lanes);
  hn::StoreU(steps, d, values + 2 * lanes);
  return {*std::min_element(values, values + lanes), *std::max_element(values + lanes, values + 2 * lanes),
          *std::max_element(values + 2 * lanes, values + 3 * lanes)};
}

LevelRange Range(const std::uint8_t* first, std::ptrdiff_t stride, std::size_t count, int height) {
  return count < 16 ? RangeOf<8>(first, stride, count, height) : RangeOf<16>(first, stride, count, height);
}

}  // namespace crosstie::markers::detail::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace crosstie::markers::detail {

HWY_EXPORT(MoveSums);
HWY_EXPORT(CompareRow);
HWY_EXPORT(HalveRow);
HWY_EXPORT(Count8);
HWY_EXPORT(Count16);
HWY_EXPORT(Range);

void compare_with_local_mean(const GreyPlane& grey, int delta, std::uint64_t* brighter, std::uint64_t* darker) {
  constexpr int kHalf = kMeanWindowPx / 2;
  constexpr std::size_t kSpare = 64 + HWY_MAX_BYTES;  // samples beyond a row that vectors may touch
  const auto width = static_cast<std::size_t>(grey.width);
  const std::size_t stride = width + kMeanWindowPx + kSpare;
  std::vector<std::uint16_t> sums(stride), scratch(3 * stride);
  std::vector<std::uint8_t> copy(width + kSpare);
  std::vector<std::uint8_t> bits1((width + kSpare) / 8 + HWY_MAX_BYTES), bits2(bits1.size());
  std::uint16_t* const columns = sums.data() + kHalf;
  const auto clamped = [&](int y) { return grey.row(std::clamp(y, 0, grey.height - 1)); };
  for (int y = -kHalf - 1; y < kHalf - 1; ++y) {
    const std::uint8_t* samples = clamped(y);
    for (std::size_t x = 0; x < width; ++x) columns[x] = static_cast<std::uint16_t>(columns[x] + samples[x]);
  }
  const std::uint8_t* const end = grey.row(grey.height - 1) + width;
  const std::size_t words = words_per_row(grey.width);
  const std::uint64_t tail = width % 64 == 0 ? ~std::uint64_t{0} : (std::uint64_t{1} << width % 64) - 1;
  for (int y = 0; y < grey.height; ++y, brighter += words, darker += words) {
    HWY_DYNAMIC_DISPATCH(MoveSums)(clamped(y + kHalf - 1), clamped(y - kHalf - 1), width, columns);
    std::fill(sums.data(), columns, columns[0]);
    std::fill(columns + width, columns + width + kHalf, columns[width - 1]);
    const std::uint8_t* samples = grey.row(y);
    if (static_cast<std::size_t>(end - samples) < width + kSpare) {
      std::memcpy(copy.data(), samples, width);
      samples = copy.data();
    }
    HWY_DYNAMIC_DISPATCH(CompareRow)
    (sums.data(), stride, scratch.data(), samples, width, delta, bits1.data(), bits2.data());
    std::memcpy(brighter, bits1.data(), words * 8);
    std::memcpy(darker, bits2.data(), words * 8);
    brighter[words - 1] &= tail;
    darker[words - 1] &= tail;
  }
}

void halve(const GreyPlane& grey, std::uint8_t* half) {
  const auto width = static_cast<std::size_t>(grey.width / 2);
  for (int y = 0; y < grey.height / 2; ++y, half += width) {
    HWY_DYNAMIC_DISPATCH(HalveRow)(grey.row(2 * y), grey.row(2 * y + 1), width, half);
  }
}

LevelCounts count_levels(const std::uint8_t* samples, int count, std::uint8_t high, std::uint8_t low) {
  return HWY_DYNAMIC_DISPATCH(Count8)(samples, count, high, low);
}
LevelCounts count_levels(const std::uint16_t* samples, int count, std::uint16_t high, std::uint16_t low) {
  return HWY_DYNAMIC_DISPATCH(Count16)(samples, count, high, low);
}

LevelRange level_range(const std::uint8_t* first, std::ptrdiff_t stride, int width, int height) {
  // The last column is its neighbour's.
  LevelRange range = HWY_DYNAMIC_DISPATCH(Range)(first, stride, static_cast<std::size_t>(width) - 1, height);
  for (int y = 0; y < height; ++y) {
    const std::uint8_t* const last = first + y * stride + width - 1;
    range.darkest = std::min<int>(range.darkest, *last);
    range.brightest = std::max<int>(range.brightest, *last);
    if (y > 0) range.steepest = std::max(range.steepest, std::abs(*last - *(last - stride)));
  }
  return range;
}

}  // namespace crosstie::markers::detail
#endif
