#include "scan/detail/phase_kernel.h"

#include <bit>
#include <cstring>
#include <limits>
#include <numbers>
#include <type_traits>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "scan/detail/phase_kernel.cc"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "scan/detail/lanes-inl.h"

HWY_BEFORE_NAMESPACE();
namespace crosstie::scan::detail::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

template <class D>
HWY_INLINE hn::Vec<Whole<D>> LoadStatus(D, const std::uint8_t* status) {
  return hn::PromoteTo(Whole<D>(), hn::LoadU(Byte<D>(), status));
}

/// B^2 of pixels and their neighbours in a column.
template <class D>
HWY_INLINE hn::Vec<D> ColumnSquares(D d, const JudgedRow& row, std::size_t i) {
  const auto here = hn::LoadU(d, row.modulation + i);
  const auto above = hn::LoadU(d, row.above + i);
  const auto below = hn::LoadU(d, row.below + i);
  return hn::MulAdd(below, below, hn::MulAdd(above, above, hn::Mul(here, here)));
}

/// B^2, averaged over the eight neighbours where these agree with it.
template <class D>
HWY_INLINE hn::Vec<D> SmoothSquares(D d, const JudgedRow& row, std::size_t i, hn::Vec<D> own) {
  const auto agreement = hn::Set(d, 2.0F);  // of the mean over the neighbours
  const auto sum = hn::Add(hn::Add(ColumnSquares(d, row, i - 1), ColumnSquares(d, row, i)), ColumnSquares(d, row, i + 1));
  const auto mean = hn::Mul(sum, hn::Set(d, 1.0F / 9.0F));
  const auto agrees = hn::And(hn::Lt(mean, hn::Mul(agreement, own)), hn::Lt(own, hn::Mul(agreement, mean)));
  return hn::IfThenElse(agrees, mean, own);
}

void JudgeRow(const PhaseLimits& limits, const JudgedRow& row, std::size_t count, JudgeSums& sums) {
  constexpr float kLeastSigma = 0.3F;  // grey levels: quantisation alone
  const Wide wide;
  auto wide_sum = hn::Zero(wide);
  std::size_t tested = 0, disturbed = 0, valid = 0;
  const auto judge = [&](auto d, std::size_t i, bool smooth) HWY_ATTR {
    using D = decltype(d);
    const Whole<D> whole;
    const auto b = hn::LoadU(d, row.modulation + i);
    const auto level = hn::LoadU(d, row.mean + i);
    auto squared = hn::Mul(b, b);
    if (smooth) squared = SmoothSquares(d, row, i, squared);
    const auto variance =
        hn::Max(hn::Set(d, kLeastSigma * kLeastSigma), hn::MulAdd(hn::Set(d, limits.shot), level, hn::Set(d, limits.read)));
    const auto gain = row.gains != nullptr ? hn::LoadU(d, row.gains + i) : hn::Set(d, limits.gain);
    const auto of_amplitude = hn::Mul(gain, variance);
    // Noise makes the amplitude longer, by twice its variance on average.
    const auto free = hn::Max(hn::Set(d, 1e-12F), hn::NegMulAdd(hn::Set(d, 2.0F), of_amplitude, squared));
    const auto sigma = hn::Mul(hn::Sqrt(hn::Div(of_amplitude, free)), hn::Set(d, 0.5F * std::numbers::inv_pi_v<float>));
    const auto expected = hn::MulAdd(hn::Mul(hn::Set(d, limits.waveform), b), b, variance);
    const auto ratio = hn::Div(hn::LoadU(d, row.squares + i), expected);
    hn::StoreU(sigma, d, row.squares + i);
    const auto was = LoadStatus(d, row.status + i);
    const auto open = hn::Eq(was, hn::Zero(whole));
    const auto none = hn::Le(b, hn::Zero(d));  // cut off, at one end of the grey scale or at the other
    const auto low = hn::Lt(level, hn::Set(d, limits.middle));
    const auto weak =
        hn::Or(hn::Lt(b, hn::Set(d, limits.least_modulation)), hn::Gt(sigma, hn::Set(d, limits.most_sigma_turns)));
    const auto beyond = hn::Gt(ratio, hn::Set(d, limits.most_ratio));
    const auto is = [&](auto mask) HWY_ATTR { return hn::RebindMask(whole, mask); };
    const auto state = [&](int value) HWY_ATTR { return hn::Set(whole, value); };
    const auto lit = hn::IfThenElse(is(weak), state(1), hn::IfThenElseZero(is(beyond), state(4)));
    const auto found = hn::IfThenElse(is(none), hn::IfThenElse(is(low), state(1), state(2)), lit);
    const auto now = hn::IfThenElse(open, found, was);
    hn::StoreU(hn::DemoteTo(Byte<D>(), now), Byte<D>(), row.status + i);
    const auto seen = hn::AndNot(is(hn::Or(none, weak)), open);
    tested += hn::CountTrue(whole, seen);
    disturbed += hn::CountTrue(whole, hn::And(seen, is(beyond)));
    valid += hn::CountTrue(whole, hn::Eq(now, hn::Zero(whole)));
    const auto part = hn::IfThenElseZero(hn::RebindMask(d, seen), ratio);
    if constexpr (std::is_same_v<D, Wide>) {
      wide_sum = hn::Add(wide_sum, part);
    } else {
      sums.ratios += static_cast<double>(hn::GetLane(part));
    }
  };
  const bool inside = row.above != nullptr && row.below != nullptr && count > 2;
  const std::size_t edge = inside ? 1 : 0;
  if (inside) judge(One(), 0, false);
  ForAll(edge, count - edge, [&](auto d, std::size_t i) HWY_ATTR { judge(d, i, inside); });
  if (inside) judge(One(), count - 1, false);
  sums.ratios += static_cast<double>(hn::GetLane(hn::SumOfLanes(wide, wide_sum)));
  sums.tested += static_cast<std::int64_t>(tested);
  sums.disturbed += static_cast<std::int64_t>(disturbed);
  sums.valid += static_cast<std::int64_t>(valid);
}

/// Bytes in lanes of 16 bits, others in lanes of 32.
template <typename Sample>
using LevelLane = std::conditional_t<sizeof(Sample) == 1, std::int16_t, std::int32_t>;

template <typename Sample, class D>
HWY_INLINE hn::Vec<hn::Rebind<LevelLane<Sample>, D>> ToLevels(D, hn::Vec<D> values) {
  const auto whole = hn::ConvertTo(Whole<D>(), values);
  if constexpr (sizeof(Sample) == 1) {
    return hn::DemoteTo(hn::Rebind<std::int16_t, D>(), whole);
  } else {
    return whole;
  }
}

template <typename Sample>
HWY_INLINE void ReadGrayRow(const Sample* const* bright, const Sample* const* inverse, std::size_t bits, float doubt,
                            const float* mean, const float* modulation, std::size_t count, std::uint16_t* words,
                            std::uint8_t* doubtful) {
  using Lane = LevelLane<Sample>;
  ForAll(0, count, [&](auto d, std::size_t i) HWY_ATTR {
    using D = decltype(d);
    const hn::Rebind<Lane, D> lane;
    const hn::RebindToUnsigned<decltype(lane)> bare;
    const hn::Rebind<Sample, D> samples;
    // All levels are whole numbers, so that limits may be, too.
    const auto reach = hn::Mul(hn::Set(d, doubt), hn::LoadU(d, modulation + i));
    const auto middle = hn::LoadU(d, mean + i);
    const auto threshold = ToLevels<Sample>(d, hn::Floor(middle));
    const auto below = ToLevels<Sample>(d, hn::Floor(hn::Sub(middle, reach)));
    const auto above = ToLevels<Sample>(d, hn::Ceil(hn::Add(middle, reach)));
    const auto apart = ToLevels<Sample>(d, hn::Ceil(hn::Add(reach, reach)));
    auto word = hn::Zero(lane);
    auto doubts = hn::Zero(lane);
    if (i % kLine == 0) {
      for (std::size_t bit = 0; bit < bits; ++bit) {
        hwy::Prefetch(bright[bit] + i + kAhead);
        if (inverse[bit] != nullptr) hwy::Prefetch(inverse[bit] + i + kAhead);
      }
    }
    for (std::size_t bit = 0; bit < bits; ++bit) {
      const auto level = hn::PromoteTo(lane, hn::LoadU(samples, bright[bit] + i));
      if (inverse[bit] != nullptr) {
        const auto difference = hn::Sub(level, hn::PromoteTo(lane, hn::LoadU(samples, inverse[bit] + i)));
        word = hn::Sub(hn::Add(word, word), hn::VecFromMask(lane, hn::Gt(difference, hn::Zero(lane))));
        doubts = hn::Sub(doubts, hn::VecFromMask(lane, hn::Lt(hn::Abs(difference), apart)));
      } else {
        word = hn::Sub(hn::Add(word, word), hn::VecFromMask(lane, hn::Gt(level, threshold)));
        doubts = hn::Sub(doubts, hn::VecFromMask(lane, hn::And(hn::Gt(level, below), hn::Lt(level, above))));
      }
    }
    // Gray to binary: each bit is the parity of those from it upwards.
    auto binary = hn::BitCast(bare, word);
    binary = hn::Xor(binary, hn::ShiftRight<8>(binary));
    binary = hn::Xor(binary, hn::ShiftRight<4>(binary));
    binary = hn::Xor(binary, hn::ShiftRight<2>(binary));
    binary = hn::Xor(binary, hn::ShiftRight<1>(binary));
    const hn::Rebind<std::uint16_t, D> word_tag;
    if constexpr (sizeof(Sample) == 1) {
      hn::StoreU(binary, word_tag, words + i);
    } else {
      hn::StoreU(hn::DemoteTo(word_tag, hn::BitCast(lane, binary)), word_tag, words + i);
    }
    hn::StoreU(hn::DemoteTo(Byte<D>(), doubts), Byte<D>(), doubtful + i);
  });
}

void ReadGrayRow8(const std::uint8_t* const* bright, const std::uint8_t* const* inverse, std::size_t bits, float doubt,
                  const float* mean, const float* modulation, std::size_t count, std::uint16_t* words, std::uint8_t* doubtful) {
  ReadGrayRow(bright, inverse, bits, doubt, mean, modulation, count, words, doubtful);
}

void ReadGrayRow16(const std::uint16_t* const* bright, const std::uint16_t* const* inverse, std::size_t bits, float doubt,
                   const float* mean, const float* modulation, std::size_t count, std::uint16_t* words,
                   std::uint8_t* doubtful) {
  ReadGrayRow(bright, inverse, bits, doubt, mean, modulation, count, words, doubtful);
}

std::size_t Differing(const std::uint16_t* a, const std::uint16_t* b, std::size_t count, std::uint32_t* places) {
  const hn::CappedTag<std::uint16_t, 64> d;
  const std::size_t lanes = hn::Lanes(d);
  std::size_t found = 0;
  std::size_t i = 0;
  for (; i + lanes <= count; i += lanes) {
    const auto same = hn::Eq(hn::LoadU(d, a + i), hn::LoadU(d, b + i));
    if (hn::AllTrue(d, same)) continue;
    std::uint8_t bytes[8] = {};  // as many as lanes, at most 64 bits
    hn::StoreMaskBits(d, hn::Not(same), bytes);
    std::uint64_t bits = 0;
    std::memcpy(&bits, bytes, sizeof bits);
    for (; bits != 0; bits &= bits - 1)
      places[found++] = static_cast<std::uint32_t>(i) + static_cast<std::uint32_t>(std::countr_zero(bits));
  }
  for (; i < count; ++i) {
    if (a[i] != b[i]) places[found++] = static_cast<std::uint32_t>(i);
  }
  return found;
}

/// sin(2 pi x), |x| <= 1/4 (Taylor, error below 6e-8 and rounding).
template <class D>
HWY_INLINE hn::Vec<D> SineOfQuarter(D d, hn::Vec<D> x) {
  const auto a = hn::Mul(x, hn::Set(d, 2.0F * std::numbers::pi_v<float>));
  const auto a2 = hn::Mul(a, a);
  auto p = hn::Set(d, -1.0F / 39916800.0F);
  p = hn::MulAdd(p, a2, hn::Set(d, 1.0F / 362880.0F));
  p = hn::MulAdd(p, a2, hn::Set(d, -1.0F / 5040.0F));
  p = hn::MulAdd(p, a2, hn::Set(d, 1.0F / 120.0F));
  p = hn::MulAdd(p, a2, hn::Set(d, -1.0F / 6.0F));
  return hn::MulAdd(hn::Mul(p, a2), a, a);
}

void PointOnCircle(const float* turns, std::size_t count, int times, float* cosine, float* sine) {
  ForAll(0, count, [&](auto d, std::size_t i) HWY_ATTR {
    const auto t = hn::Mul(hn::LoadU(d, turns + i), hn::Set(d, static_cast<float>(times)));
    const auto r = hn::Sub(t, hn::Round(t));
    const auto size = hn::Abs(r);
    const auto quarter = hn::Set(d, 0.25F);
    // Beyond a quarter back again: 1/2 - |r|.
    const auto folded = hn::CopySignToAbs(hn::Min(size, hn::Sub(hn::Set(d, 0.5F), size)), r);
    hn::StoreU(SineOfQuarter(d, hn::Sub(quarter, size)), d, cosine + i);
    hn::StoreU(SineOfQuarter(d, folded), d, sine + i);
  });
}

void CorrectTurns(const float* correction, std::size_t bins, float* turns, std::size_t count) {
  ForAll(0, count, [&](auto d, std::size_t i) HWY_ATTR {
    using D = decltype(d);
    const Whole<D> whole;
    const auto t = hn::LoadU(d, turns + i);
    const auto at = hn::Mul(t, hn::Set(d, static_cast<float>(bins)));
    const auto bin = hn::Min(hn::ConvertTo(whole, at), hn::Set(whole, static_cast<std::int32_t>(bins) - 1));
    const auto rest = hn::Sub(at, hn::ConvertTo(d, bin));
    const auto left = hn::GatherIndex(d, correction, bin);
    const auto right = hn::GatherIndex(d, correction + 1, bin);
    auto corrected = hn::Add(t, hn::MulAdd(rest, hn::Sub(right, left), left));
    corrected = hn::Sub(corrected, hn::Floor(corrected));
    hn::StoreU(hn::Min(corrected, hn::Set(d, 0.99999994F)), d, turns + i);
  });
}

void ReadCoordinates(const WordScale& scale, const std::uint16_t* words, const float* turns, const std::uint8_t* status,
                     std::size_t count, std::uint8_t* doubtful, float* coordinates) {
  ForAll(0, count, [&](auto d, std::size_t i) HWY_ATTR {
    using D = decltype(d);
    const Whole<D> whole;
    const auto word = hn::ConvertTo(d, hn::PromoteTo(whole, hn::LoadU(hn::Rebind<std::uint16_t, D>(), words + i)));
    const auto t = hn::LoadU(d, turns + i);
    const auto off = hn::Sub(hn::MulAdd(word, hn::Set(d, scale.scale), hn::Set(d, scale.shift)), t);
    const auto k = hn::Round(off);
    const auto open = hn::Eq(LoadStatus(d, status + i), hn::Zero(whole));
    const auto doubts = LoadStatus(d, doubtful + i);
    const auto near = hn::RebindMask(whole, hn::Le(hn::Abs(hn::Sub(off, k)), hn::Set(d, scale.within)));
    const auto one = hn::Set(whole, 1);
    const auto many = hn::Gt(doubts, one);
    const auto told = hn::And(open, hn::AndNot(many, near));
    const auto nowhere = hn::Set(d, std::numeric_limits<float>::quiet_NaN());
    hn::StoreU(hn::IfThenElse(hn::RebindMask(d, told), hn::Add(k, t), nowhere), d, coordinates + i);
    const auto asked = hn::IfThenElse(many, hn::Set(whole, 2), hn::IfThenElse(near, doubts, one));
    hn::StoreU(hn::DemoteTo(Byte<D>(), hn::IfThenElseZero(open, asked)), Byte<D>(), doubtful + i);
  });
}

}  // namespace crosstie::scan::detail::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace crosstie::scan::detail {

HWY_EXPORT(JudgeRow);
HWY_EXPORT(ReadGrayRow8);
HWY_EXPORT(ReadGrayRow16);
HWY_EXPORT(Differing);
HWY_EXPORT(PointOnCircle);
HWY_EXPORT(CorrectTurns);
HWY_EXPORT(ReadCoordinates);

void judge_row(const PhaseLimits& limits, const JudgedRow& row, std::size_t count, JudgeSums& sums) {
  HWY_DYNAMIC_DISPATCH(JudgeRow)(limits, row, count, sums);
}

void read_gray_row(const std::uint8_t* const* bright, const std::uint8_t* const* inverse, std::size_t bits, float doubt,
                   const float* mean, const float* modulation, std::size_t count, std::uint16_t* words,
                   std::uint8_t* doubtful) {
  HWY_DYNAMIC_DISPATCH(ReadGrayRow8)(bright, inverse, bits, doubt, mean, modulation, count, words, doubtful);
}

void read_gray_row(const std::uint16_t* const* bright, const std::uint16_t* const* inverse, std::size_t bits, float doubt,
                   const float* mean, const float* modulation, std::size_t count, std::uint16_t* words,
                   std::uint8_t* doubtful) {
  HWY_DYNAMIC_DISPATCH(ReadGrayRow16)(bright, inverse, bits, doubt, mean, modulation, count, words, doubtful);
}

std::size_t differing(const std::uint16_t* a, const std::uint16_t* b, std::size_t count, std::uint32_t* places) {
  return HWY_DYNAMIC_DISPATCH(Differing)(a, b, count, places);
}

void point_on_circle(const float* turns, std::size_t count, int times, float* cosine, float* sine) {
  HWY_DYNAMIC_DISPATCH(PointOnCircle)(turns, count, times, cosine, sine);
}

void correct_turns(const float* correction, std::size_t bins, float* turns, std::size_t count) {
  HWY_DYNAMIC_DISPATCH(CorrectTurns)(correction, bins, turns, count);
}

void read_coordinates(const WordScale& scale, const std::uint16_t* words, const float* turns, const std::uint8_t* status,
                      std::size_t count, std::uint8_t* doubtful, float* coordinates) {
  HWY_DYNAMIC_DISPATCH(ReadCoordinates)(scale, words, turns, status, count, doubtful, coordinates);
}

}  // namespace crosstie::scan::detail
#endif
