#include "scan/detail/fringe_kernel.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "scan/detail/fringe_kernel.cc"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace crosstie::scan::detail::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using D = hn::ScalableTag<float>;
using V = hn::Vec<D>;

template <typename Sample>
HWY_INLINE V Load(const Sample* from) {
  const D d;
  const hn::Rebind<Sample, D> samples;
  const hn::Rebind<std::int32_t, D> whole;
  return hn::ConvertTo(d, hn::PromoteTo(whole, hn::LoadU(samples, from)));
}

/// atan2(y, x) / (2 pi) in [0, 1); the arc tangent by Abramowitz and Stegun 4.4.49 (error below 2e-8 rad and rounding).
HWY_INLINE V Turns(V y, V x) {
  const D d;
  const V ax = hn::Abs(x);
  const V ay = hn::Abs(y);
  const V larger = hn::Max(hn::Max(ax, ay), hn::Set(d, 1e-30F));
  const V t = hn::Div(hn::Min(ax, ay), larger);
  const V t2 = hn::Mul(t, t);
  V p = hn::Set(d, -0.0040540580F);
  p = hn::MulAdd(p, t2, hn::Set(d, 0.0218612288F));
  p = hn::MulAdd(p, t2, hn::Set(d, -0.0559098861F));
  p = hn::MulAdd(p, t2, hn::Set(d, 0.0964200441F));
  p = hn::MulAdd(p, t2, hn::Set(d, -0.1390853351F));
  p = hn::MulAdd(p, t2, hn::Set(d, 0.1994653599F));
  p = hn::MulAdd(p, t2, hn::Set(d, -0.3332985605F));
  p = hn::MulAdd(p, t2, hn::Set(d, 0.9999993329F));
  V turns = hn::Mul(hn::Mul(p, t), hn::Set(d, 0.15915494F));
  turns = hn::IfThenElse(hn::Gt(ay, ax), hn::Sub(hn::Set(d, 0.25F), turns), turns);
  turns = hn::IfThenElse(hn::Lt(x, hn::Zero(d)), hn::Sub(hn::Set(d, 0.5F), turns), turns);
  turns = hn::IfThenElse(hn::Lt(y, hn::Zero(d)), hn::Sub(hn::Set(d, 1.0F), turns), turns);
  return hn::IfThenElse(hn::Ge(turns, hn::Set(d, 1.0F)), hn::Zero(d), turns);
}

template <typename Sample>
HWY_INLINE void SolveAt(const FringePlan& plan, const Sample* const* images, std::size_t i, const FringeRow& row) {
  const D d;
  V mean = hn::Zero(d);
  V a = hn::Zero(d);
  V b = hn::Zero(d);
  V low = hn::Set(d, 1e30F);
  V high = hn::Set(d, -1e30F);
  for (int n = 0; n < plan.steps; ++n) {
    const V level = Load(images[n] + i);
    mean = hn::MulAdd(level, hn::Set(d, plan.mean_weight[n]), mean);
    a = hn::MulAdd(level, hn::Set(d, plan.a_weight[n]), a);
    b = hn::MulAdd(level, hn::Set(d, plan.b_weight[n]), b);
    low = hn::Min(low, level);
    high = hn::Max(high, level);
  }
  V squares = hn::Zero(d);
  for (int n = 0; n < plan.steps; ++n) {
    V r = hn::Sub(Load(images[n] + i), mean);
    r = hn::NegMulAdd(a, hn::Set(d, plan.cosine[n]), r);
    r = hn::NegMulAdd(b, hn::Set(d, plan.sine[n]), r);
    squares = hn::MulAdd(r, r, squares);
  }
  hn::StoreU(Turns(b, a), d, row.turns + i);
  hn::StoreU(hn::Sqrt(hn::MulAdd(a, a, hn::Mul(b, b))), d, row.modulation + i);
  hn::StoreU(mean, d, row.mean + i);
  hn::StoreU(squares, d, row.squares + i);
  const auto cut = hn::Or(hn::Le(low, hn::Set(d, plan.clip_low)), hn::Ge(high, hn::Set(d, plan.clip_high)));
  const V flag = hn::IfThenElseZero(cut, hn::Set(d, 1.0F));
  const hn::Rebind<std::uint8_t, D> bytes;
  hn::StoreU(hn::DemoteTo(bytes, hn::ConvertTo(hn::Rebind<std::int32_t, D>(), flag)), bytes, row.clipped + i);
}

template <typename Sample>
void Solve(const FringePlan& plan, const Sample* const* images, std::size_t count, const FringeRow& row) {
  const std::size_t lanes = hn::Lanes(D());
  std::size_t i = 0;
  for (; i + lanes <= count; i += lanes) SolveAt(plan, images, i, row);
  if (i == count) return;
  if (count >= lanes) {  // the last ones once more with their neighbours: the same values
    SolveAt(plan, images, count - lanes, row);
    return;
  }
  Sample samples[kMaxSteps][hn::MaxLanes(D())] = {};
  const Sample* padded[kMaxSteps];
  for (int n = 0; n < plan.steps; ++n) {
    for (std::size_t k = 0; k < count; ++k) samples[n][k] = images[n][k];
    padded[n] = samples[n];
  }
  float turns[hn::MaxLanes(D())], modulation[hn::MaxLanes(D())], mean[hn::MaxLanes(D())], squares[hn::MaxLanes(D())];
  std::uint8_t clipped[hn::MaxLanes(D())];
  SolveAt(plan, padded, 0, {turns, modulation, mean, squares, clipped});
  for (std::size_t k = 0; k < count; ++k) {
    row.turns[k] = turns[k];
    row.modulation[k] = modulation[k];
    row.mean[k] = mean[k];
    row.squares[k] = squares[k];
    row.clipped[k] = clipped[k];
  }
}

void Solve8(const FringePlan& plan, const std::uint8_t* const* images, std::size_t count, const FringeRow& row) {
  Solve(plan, images, count, row);
}

void Solve16(const FringePlan& plan, const std::uint16_t* const* images, std::size_t count, const FringeRow& row) {
  Solve(plan, images, count, row);
}

}  // namespace crosstie::scan::detail::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace crosstie::scan::detail {

HWY_EXPORT(Solve8);
HWY_EXPORT(Solve16);

void solve_fringes(const FringePlan& plan, const std::uint8_t* const* images, std::size_t count, const FringeRow& row) {
  HWY_DYNAMIC_DISPATCH(Solve8)(plan, images, count, row);
}

void solve_fringes(const FringePlan& plan, const std::uint16_t* const* images, std::size_t count, const FringeRow& row) {
  HWY_DYNAMIC_DISPATCH(Solve16)(plan, images, count, row);
}

}  // namespace crosstie::scan::detail
#endif
