// What the loops over rows of pixels share. Compiled once for each instruction set, hence the guard that toggles.
#if defined(CROSSTIE_SCAN_DETAIL_LANES_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef CROSSTIE_SCAN_DETAIL_LANES_INL_H
#undef CROSSTIE_SCAN_DETAIL_LANES_INL_H
#else
#define CROSSTIE_SCAN_DETAIL_LANES_INL_H
#endif

#include <cstddef>
#include <cstdint>

#include <hwy/cache_control.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace crosstie::scan::detail::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

/// Samples that are asked for in time: that many images are read at once that the processor does not see what comes next.
constexpr std::size_t kAhead = 1024;
constexpr std::size_t kLine = 64;

using Wide = hn::ScalableTag<float>;
using One = hn::CappedTag<float, 1>;  // of what is left at a row's end
template <class D>
using Whole = hn::Rebind<std::int32_t, D>;
template <class D>
using Byte = hn::Rebind<std::uint8_t, D>;

/// `block(tag, i)` for all of [first, last).
template <class Block>
HWY_INLINE void ForAll(std::size_t first, std::size_t last, const Block& block) {
  const Wide wide;
  const One one;
  std::size_t i = first;
  for (; i + hn::Lanes(wide) <= last; i += hn::Lanes(wide)) block(wide, i);
  for (; i < last; ++i) block(one, i);
}

}  // namespace crosstie::scan::detail::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif  // toggled
