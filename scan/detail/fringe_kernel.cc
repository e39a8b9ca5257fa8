#include "scan/detail/fringe_kernel.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "scan/detail/fringe_kernel.cc"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "scan/detail/lanes-inl.h"

HWY_BEFORE_NAMESPACE();
namespace crosstie::scan::detail::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

template <class D, typename Sample>
HWY_INLINE hn::Vec<D> Load(D d, const Sample* from) {
  const hn::Rebind<Sample, D> samples;
  const hn::Rebind<std::int32_t, D> whole;
  return hn::ConvertTo(d, hn::PromoteTo(whole, hn::LoadU(samples, from)));
}

/// atan2(y, x) / (2 pi) in [0, 1); the arc tangent by Abramowitz and Stegun 4.4.49 (error below 2e-8 rad and rounding).
template <class D>
HWY_INLINE hn::Vec<D> Turns(D d, hn::Vec<D> y, hn::Vec<D> x) {
  const auto ax = hn::Abs(x);
  const auto ay = hn::Abs(y);
  const auto larger = hn::Max(hn::Max(ax, ay), hn::Set(d, 1e-30F));
  const auto t = hn::Div(hn::Min(ax, ay), larger);
  const auto t2 = hn::Mul(t, t);
  auto p = hn::Set(d, -0.0040540580F);
  p = hn::MulAdd(p, t2, hn::Set(d, 0.0218612288F));
  p = hn::MulAdd(p, t2, hn::Set(d, -0.0559098861F));
  p = hn::MulAdd(p, t2, hn::Set(d, 0.0964200441F));
  p = hn::MulAdd(p, t2, hn::Set(d, -0.1390853351F));
  p = hn::MulAdd(p, t2, hn::Set(d, 0.1994653599F));
  p = hn::MulAdd(p, t2, hn::Set(d, -0.3332985605F));
  p = hn::MulAdd(p, t2, hn::Set(d, 0.9999993329F));
  auto turns = hn::Mul(hn::Mul(p, t), hn::Set(d, 0.15915494F));
  turns = hn::IfThenElse(hn::Gt(ay, ax), hn::Sub(hn::Set(d, 0.25F), turns), turns);
  turns = hn::IfThenElse(hn::Lt(x, hn::Zero(d)), hn::Sub(hn::Set(d, 0.5F), turns), turns);
  turns = hn::IfThenElse(hn::Lt(y, hn::Zero(d)), hn::Sub(hn::Set(d, 1.0F), turns), turns);
  return hn::IfThenElse(hn::Ge(turns, hn::Set(d, 1.0F)), hn::Zero(d), turns);
}

/// Returns whether a sample is cut off.
template <class D, typename Sample>
HWY_INLINE bool SolveAt(D d, const FringePlan& plan, const Sample* const* images, std::size_t i, const FringeRow& row) {
  auto mean = hn::Zero(d);
  auto a = hn::Zero(d);
  auto b = hn::Zero(d);
  auto low = hn::Set(d, 1e30F);
  auto high = hn::Set(d, -1e30F);
  if (i % kLine == 0) {
    for (int n = 0; n < plan.steps; ++n) hwy::Prefetch(images[n] + i + kAhead);
  }
  for (int n = 0; n < plan.steps; ++n) {
    const auto level = Load(d, images[n] + i);
    mean = hn::MulAdd(level, hn::Set(d, plan.mean_weight[n]), mean);
    a = hn::MulAdd(level, hn::Set(d, plan.a_weight[n]), a);
    b = hn::MulAdd(level, hn::Set(d, plan.b_weight[n]), b);
    low = hn::Min(low, level);
    high = hn::Max(high, level);
  }
  auto squares = hn::Zero(d);
  for (int n = 0; n < plan.steps; ++n) {
    auto r = hn::Sub(Load(d, images[n] + i), mean);
    r = hn::NegMulAdd(a, hn::Set(d, plan.cosine[n]), r);
    r = hn::NegMulAdd(b, hn::Set(d, plan.sine[n]), r);
    squares = hn::MulAdd(r, r, squares);
  }
  hn::StoreU(Turns(d, b, a), d, row.turns + i);
  hn::StoreU(hn::Sqrt(hn::MulAdd(a, a, hn::Mul(b, b))), d, row.modulation + i);
  hn::StoreU(mean, d, row.mean + i);
  hn::StoreU(hn::Mul(squares, hn::Set(d, plan.square_weight)), d, row.squares + i);
  const auto cut = hn::Or(hn::Le(low, hn::Set(d, plan.clip_low)), hn::Ge(high, hn::Set(d, plan.clip_high)));
  const hn::Rebind<std::int32_t, D> whole;
  const hn::Rebind<std::uint8_t, D> bytes;
  const auto flags = hn::IfThenElseZero(hn::RebindMask(whole, cut), hn::Set(whole, 1));
  hn::StoreU(hn::DemoteTo(bytes, flags), bytes, row.clipped + i);
  return !hn::AllFalse(d, cut);
}

template <typename Sample>
bool Solve(const FringePlan& plan, const Sample* const* images, std::size_t count, const FringeRow& row) {
  const std::size_t lanes = hn::Lanes(Wide());
  bool any = false;
  std::size_t i = 0;
  for (; i + lanes <= count; i += lanes) any |= SolveAt(Wide(), plan, images, i, row);
  for (; i < count; ++i) any |= SolveAt(One(), plan, images, i, row);
  return any;
}

bool Solve8(const FringePlan& plan, const std::uint8_t* const* images, std::size_t count, const FringeRow& row) {
  return Solve(plan, images, count, row);
}

bool Solve16(const FringePlan& plan, const std::uint16_t* const* images, std::size_t count, const FringeRow& row) {
  return Solve(plan, images, count, row);
}

}  // namespace crosstie::scan::detail::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace crosstie::scan::detail {

HWY_EXPORT(Solve8);
HWY_EXPORT(Solve16);

bool solve_fringes(const FringePlan& plan, const std::uint8_t* const* images, std::size_t count, const FringeRow& row) {
  return HWY_DYNAMIC_DISPATCH(Solve8)(plan, images, count, row);
}

bool solve_fringes(const FringePlan& plan, const std::uint16_t* const* images, std::size_t count, const FringeRow& row) {
  return HWY_DYNAMIC_DISPATCH(Solve16)(plan, images, count, row);
}

}  // namespace crosstie::scan::detail
#endif
