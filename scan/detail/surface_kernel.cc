#include "scan/detail/surface_kernel.h"

#include <algorithm>
#include <bit>
#include <cstring>
#include <limits>
#include <type_traits>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "scan/detail/surface_kernel.cc"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "scan/detail/lanes-inl.h"

HWY_BEFORE_NAMESPACE();
namespace crosstie::scan::detail::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

/// Steps in the array to the neighbours that are looked at; 0: there is none, and nothing differs from itself.
struct Neighbours {
  std::ptrdiff_t before = 0, after = 0;            // of a jump
  std::ptrdiff_t near_before = 0, near_after = 0;  // of a crease, one pixel off
  std::ptrdiff_t far_before = 0, far_after = 0;    // and three
};

constexpr int kCreaseReach = 3;

Neighbours NeighboursOf(std::ptrdiff_t before, std::ptrdiff_t after, std::ptrdiff_t stride, bool creases) {
  Neighbours n;
  n.before = before > 0 ? -stride : 0;
  n.after = after > 0 ? stride : 0;
  if (!creases || before < kCreaseReach || after < kCreaseReach) return n;
  n.near_before = -stride;
  n.near_after = stride;
  n.far_before = -kCreaseReach * stride;
  n.far_after = kCreaseReach * stride;
  return n;
}

template <class D>
HWY_INLINE hn::Mask<D> Ends(D d, const SurfaceLimits& limits, const float* turns, const float* sigma, const Neighbours& n) {
  const auto t = hn::LoadU(d, turns);
  const auto s = hn::LoadU(d, sigma);
  const auto jumps = [&](std::ptrdiff_t step) HWY_ATTR {
    const auto noise = hn::Max(s, hn::LoadU(d, sigma + step));
    const auto most = hn::MulAdd(hn::Set(d, limits.jump_sigmas), noise, hn::Set(d, limits.jump));
    return hn::Gt(hn::Abs(hn::Sub(t, hn::LoadU(d, turns + step))), most);
  };
  auto ends = hn::Or(jumps(n.before), jumps(n.after));
  if (n.far_after != 0) {
    const auto far = hn::Sub(hn::LoadU(d, turns + n.far_after), hn::LoadU(d, turns + n.near_after));
    const auto near = hn::Sub(hn::LoadU(d, turns + n.far_before), hn::LoadU(d, turns + n.near_before));
    const auto change = hn::Abs(hn::Mul(hn::Set(d, 0.5F), hn::Add(far, near)));
    const auto noise = hn::Max(s, hn::Max(hn::LoadU(d, sigma + n.near_before), hn::LoadU(d, sigma + n.near_after)));
    const auto most = hn::MulAdd(hn::Set(d, limits.crease_sigmas), noise, hn::Set(d, limits.crease));
    ends = hn::Or(ends, hn::And(hn::Gt(change, most), hn::Eq(t, t)));
  }
  return ends;
}

void MarkEnds(const SurfaceLimits& limits, const float* turns, const float* sigma, std::size_t width, int above, int below,
              char* bad) {
  const auto w = static_cast<std::ptrdiff_t>(width);
  const Neighbours down = NeighboursOf(above, below, w, limits.creases);
  auto* marks = reinterpret_cast<std::uint8_t*>(bad);
  const auto mark = [&](auto d, std::size_t i, const Neighbours& along) HWY_ATTR {
    using D = decltype(d);
    const auto ends = hn::Or(Ends(d, limits, turns + i, sigma + i, along), Ends(d, limits, turns + i, sigma + i, down));
    const Whole<D> whole;
    const auto ones = hn::IfThenElseZero(hn::RebindMask(whole, ends), hn::Set(whole, 1));
    const Byte<D> byte;
    hn::StoreU(hn::Or(hn::LoadU(byte, marks + i), hn::DemoteTo(byte, ones)), byte, marks + i);
  };
  const auto inner = static_cast<std::size_t>(kCreaseReach);
  const std::size_t first = std::min(inner, width);
  const std::size_t last = width > 2 * inner ? width - inner : first;
  const auto at_the_end = [&](std::size_t i) HWY_ATTR {
    const auto x = static_cast<std::ptrdiff_t>(i);
    mark(One(), i, NeighboursOf(x, w - 1 - x, 1, limits.creases));
  };
  for (std::size_t i = 0; i < first; ++i) at_the_end(i);
  const Neighbours along = NeighboursOf(kCreaseReach, kCreaseReach, 1, limits.creases);
  ForAll(first, last, [&](auto d, std::size_t i) HWY_ATTR { mark(d, i, along); });
  for (std::size_t i = last; i < width; ++i) at_the_end(i);
}

void AnyMarked(const char* const* rows, std::size_t count, std::size_t width, char* out) {
  const hn::ScalableTag<std::uint8_t> d;
  const auto byte = [](const char* at) { return reinterpret_cast<const std::uint8_t*>(at); };
  std::size_t i = 0;
  for (; i + hn::Lanes(d) <= width; i += hn::Lanes(d)) {
    auto any = hn::LoadU(d, byte(rows[0]) + i);
    for (std::size_t r = 1; r < count; ++r) any = hn::Or(any, hn::LoadU(d, byte(rows[r]) + i));
    hn::StoreU(any, d, reinterpret_cast<std::uint8_t*>(out) + i);
  }
  for (; i < width; ++i) {
    char any = rows[0][i];
    for (std::size_t r = 1; r < count; ++r) any = static_cast<char>(any | rows[r][i]);
    out[i] = any;
  }
}

float LargestValid(const std::uint8_t* status, const float* sigma, std::size_t count) {
  const Wide wide;
  auto largest = hn::Zero(wide);
  float rest = 0.0F;
  ForAll(0, count, [&](auto d, std::size_t i) HWY_ATTR {
    using D = decltype(d);
    const auto state = hn::PromoteTo(Whole<D>(), hn::LoadU(Byte<D>(), status + i));
    const auto valid = hn::RebindMask(d, hn::Eq(state, hn::Zero(Whole<D>())));
    const auto value = hn::IfThenElseZero(valid, hn::LoadU(d, sigma + i));
    if constexpr (std::is_same_v<D, Wide>) {
      largest = hn::Max(largest, value);
    } else {
      rest = std::max(rest, hn::GetLane(value));
    }
  });
  return std::max(rest, hn::GetLane(hn::MaxOfLanes(wide, largest)));
}

/// Difference of the values `step` after and before.
template <class D>
HWY_INLINE hn::Vec<D> Across(D d, const float* at, std::ptrdiff_t step) {
  return hn::Sub(hn::LoadU(d, at + step), hn::LoadU(d, at - step));
}

/// A derivative of band-limited samples over 7 of them (sixth order).
template <class D>
HWY_INLINE hn::Vec<D> Derivative(D d, const float* at, std::ptrdiff_t stride) {
  auto sum = hn::Mul(hn::Set(d, 0.75F), Across(d, at, stride));
  sum = hn::NegMulAdd(hn::Set(d, 0.15F), Across(d, at, 2 * stride), sum);
  return hn::MulAdd(hn::Set(d, 1.0F / 60.0F), Across(d, at, 3 * stride), sum);
}

/// Change of values per px from neighbours on both sides.
template <class D>
HWY_INLINE hn::Vec<D> Slope(D d, const float* at, std::ptrdiff_t stride) {
  auto sum = hn::MulAdd(hn::Set(d, 2.0F), Across(d, at, 2 * stride), Across(d, at, stride));
  sum = hn::MulAdd(hn::Set(d, 3.0F), Across(d, at, 3 * stride), sum);
  return hn::Mul(sum, hn::Set(d, 1.0F / 28.0F));
}

bool LeanRow(const float* turns, const float* modulation, std::size_t width, float least, float* lean) {
  const auto down = static_cast<std::ptrdiff_t>(width);
  const auto reach = static_cast<std::size_t>(kLeaningReach);
  bool missing = false;
  if (width <= 2 * reach) return false;
  ForAll(reach, width - reach, [&](auto d, std::size_t i) HWY_ATTR {
    const float* t = turns + i;
    const float* b = modulation + i;
    const auto along = hn::Mul(Slope(d, t, 1), Derivative(d, b, 1));
    const auto own = hn::LoadU(d, b);
    const auto value = hn::Div(hn::MulAdd(Slope(d, t, down), Derivative(d, b, down), along), own);
    const auto place = hn::LoadU(d, t);
    const auto there = hn::And(hn::Eq(place, place), hn::Ge(own, hn::Set(d, least)));
    const auto known = hn::Eq(value, value);
    missing = missing || !hn::AllTrue(d, hn::Or(known, hn::Not(there)));
    const auto nowhere = hn::Set(d, std::numeric_limits<float>::quiet_NaN());
    hn::StoreU(hn::IfThenElse(there, value, nowhere), d, lean + i);
  });
  return missing;
}

std::size_t LeaningPlaces(const float* lean, const float* sigma, const char* surface, float sigmas, std::size_t count,
                          std::uint32_t* places) {
  const auto* marks = reinterpret_cast<const std::uint8_t*>(surface);
  std::size_t found = 0;
  ForAll(0, count, [&](auto d, std::size_t i) HWY_ATTR {
    using D = decltype(d);
    const auto least = hn::Mul(hn::Set(d, sigmas), hn::LoadU(d, sigma + i));
    const auto mark = hn::PromoteTo(Whole<D>(), hn::LoadU(Byte<D>(), marks + i));
    const auto on = hn::RebindMask(d, hn::Ne(mark, hn::Zero(Whole<D>())));
    const auto leans = hn::And(on, hn::Ge(hn::Abs(hn::LoadU(d, lean + i)), least));  // not where lean is not a number
    if (hn::AllFalse(d, leans)) return;
    std::uint8_t bytes[8] = {};
    hn::StoreMaskBits(d, leans, bytes);
    std::uint64_t bits = 0;
    std::memcpy(&bits, bytes, sizeof bits);
    for (; bits != 0; bits &= bits - 1) {
      places[found++] = static_cast<std::uint32_t>(i) + static_cast<std::uint32_t>(std::countr_zero(bits));
    }
  });
  return found;
}

using WideDouble = hn::ScalableTag<double>;
using OneDouble = hn::CappedTag<double, 1>;

/// Sums of vectors of one kind.
template <class D>
class ShiftLanes {
 public:
  HWY_INLINE ShiftLanes() {
    for (auto& sum : sums_) sum = hn::Zero(D());
  }

  template <typename Sample>
  HWY_INLINE void Add(const ThreeRows<Sample>& earlier, const ThreeRows<Sample>& later, std::size_t i, double limit) {
    const D d;
    const auto level = [&](const Sample* at) HWY_ATTR {
      const hn::Rebind<Sample, D> samples;
      const hn::Rebind<std::int32_t, D> whole;
      return hn::PromoteTo(d, hn::PromoteTo(whole, hn::LoadU(samples, at)));
    };
    const auto h = level(earlier.here + i);
    const auto h2 = level(later.here + i);
    const auto counts = hn::And(hn::Lt(h, hn::Set(d, limit)), hn::Lt(h2, hn::Set(d, limit)));
    const auto of = [&](auto value) HWY_ATTR { return hn::IfThenElseZero(counts, value); };
    const auto x = of(hn::Add(hn::Sub(level(earlier.here + i + 1), level(earlier.here + i - 1)),
                              hn::Sub(level(later.here + i + 1), level(later.here + i - 1))));
    const auto y = of(hn::Add(hn::Sub(level(earlier.below + i), level(earlier.above + i)),
                              hn::Sub(level(later.below + i), level(later.above + i))));
    const auto difference = of(hn::Sub(h2, h));
    const auto here = of(h);
    const auto add = [&](int k, auto a, auto b) HWY_ATTR { sums_[k] = hn::MulAdd(a, b, sums_[k]); };
    add(0, x, x);
    add(1, x, y);
    add(2, y, y);
    add(3, x, here);
    add(4, y, here);
    add(5, here, here);
    sums_[6] = hn::Add(sums_[6], x);
    sums_[7] = hn::Add(sums_[7], y);
    sums_[8] = hn::Add(sums_[8], here);
    add(9, difference, x);
    add(10, difference, y);
    add(11, difference, here);
    sums_[12] = hn::Add(sums_[12], difference);
    add(13, difference, difference);
    sums_[14] = hn::Add(sums_[14], of(hn::Set(d, 1.0)));
  }

  HWY_INLINE void Total(ShiftSums& sums) const {
    double* const places[] = {&sums.xx, &sums.xy, &sums.yy, &sums.xh, &sums.yh, &sums.hh, &sums.x,    &sums.y,
                              &sums.h,  &sums.dx, &sums.dy, &sums.dh, &sums.d,  &sums.dd, &sums.count};
    for (int k = 0; k < 15; ++k) *places[k] += hn::GetLane(hn::SumOfLanes(D(), sums_[k]));
  }

 private:
  hn::Vec<D> sums_[15];
};

template <typename Sample>
HWY_INLINE void AddShiftSums(const ThreeRows<Sample>& earlier, const ThreeRows<Sample>& later, std::size_t first,
                             std::size_t last, double limit, ShiftSums& sums) {
  ShiftLanes<WideDouble> wide;
  ShiftLanes<OneDouble> one;
  std::size_t i = first;
  for (; i + hn::Lanes(WideDouble()) <= last; i += hn::Lanes(WideDouble())) wide.Add(earlier, later, i, limit);
  for (; i < last; ++i) one.Add(earlier, later, i, limit);
  wide.Total(sums);
  one.Total(sums);
}

void AddShiftSums8(const ThreeRows<std::uint8_t>& earlier, const ThreeRows<std::uint8_t>& later, std::size_t first,
                   std::size_t last, double limit, ShiftSums& sums) {
  AddShiftSums(earlier, later, first, last, limit, sums);
}

void AddShiftSums16(const ThreeRows<std::uint16_t>& earlier, const ThreeRows<std::uint16_t>& later, std::size_t first,
                    std::size_t last, double limit, ShiftSums& sums) {
  AddShiftSums(earlier, later, first, last, limit, sums);
}

}  // namespace crosstie::scan::detail::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace crosstie::scan::detail {

HWY_EXPORT(MarkEnds);
HWY_EXPORT(AnyMarked);
HWY_EXPORT(LargestValid);
HWY_EXPORT(LeanRow);
HWY_EXPORT(LeaningPlaces);
HWY_EXPORT(AddShiftSums8);
HWY_EXPORT(AddShiftSums16);

void mark_ends(const SurfaceLimits& limits, const float* turns, const float* sigma, std::size_t width, int above, int below,
               char* bad) {
  HWY_DYNAMIC_DISPATCH(MarkEnds)(limits, turns, sigma, width, above, below, bad);
}

void any_marked(const char* const* rows, std::size_t count, std::size_t width, char* out) {
  HWY_DYNAMIC_DISPATCH(AnyMarked)(rows, count, width, out);
}

float largest_valid(const std::uint8_t* status, const float* sigma, std::size_t count) {
  return HWY_DYNAMIC_DISPATCH(LargestValid)(status, sigma, count);
}

bool lean_row(const float* turns, const float* modulation, std::size_t width, float least, float* lean) {
  return HWY_DYNAMIC_DISPATCH(LeanRow)(turns, modulation, width, least, lean);
}

std::size_t leaning_places(const float* lean, const float* sigma, const char* surface, float sigmas, std::size_t count,
                           std::uint32_t* places) {
  return HWY_DYNAMIC_DISPATCH(LeaningPlaces)(lean, sigma, surface, sigmas, count, places);
}

void add_shift_sums(const ThreeRows<std::uint8_t>& earlier, const ThreeRows<std::uint8_t>& later, std::size_t first,
                    std::size_t last, double limit, ShiftSums& sums) {
  HWY_DYNAMIC_DISPATCH(AddShiftSums8)(earlier, later, first, last, limit, sums);
}

void add_shift_sums(const ThreeRows<std::uint16_t>& earlier, const ThreeRows<std::uint16_t>& later, std::size_t first,
                    std::size_t last, double limit, ShiftSums& sums) {
  HWY_DYNAMIC_DISPATCH(AddShiftSums16)(earlier, later, first, last, limit, sums);
}

}  // namespace crosstie::scan::detail
#endif
