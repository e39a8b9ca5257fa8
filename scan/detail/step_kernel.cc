#include "scan/detail/step_kernel.h"

#include "math/edge_profile.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "scan/detail/step_kernel.cc"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace crosstie::scan::detail::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using D = hn::CappedTag<double, kStepLanes>;
using V = hn::Vec<D>;

/// math::edge_profile: a table and Taylor's series.
HWY_INLINE void Profile(const double* table, V t, V& distribution, V& density) {
  constexpr double kRound = 6755399441055744.0;  // 1.5 * 2^52: the last bits of a sum with it are a whole number
  const D d;
  const hn::RebindToSigned<D> whole;
  const V one = hn::Set(d, 1.0);
  const V half = hn::Set(d, 0.5);
  const V end = hn::Set(d, math::kTableEnd);
  t = hn::Min(hn::Max(t, hn::Neg(end)), end);
  const V shifted = hn::MulAdd(t, hn::Set(d, math::kNodesPerUnit), hn::Set(d, kRound));
  const V t0 = hn::Mul(hn::Sub(shifted, hn::Set(d, kRound)), hn::Set(d, 1.0 / math::kNodesPerUnit));
  const auto node =
      hn::Sub(hn::BitCast(whole, shifted), hn::BitCast(whole, hn::Set(d, kRound - math::kTableEnd * math::kNodesPerUnit)));
  const auto entry = hn::Add(node, node);  // of pairs
  const V distribution0 = hn::GatherIndex(d, table, entry);
  const V density0 = hn::GatherIndex(d, table + 1, entry);
  const V h = hn::Sub(t, t0);
  const V t0t0 = hn::Mul(t0, t0);
  const V curvature = hn::Mul(hn::Sub(t0t0, one), hn::Mul(h, h));
  const V slant = hn::Mul(t0, h);
  const V sixth = hn::Set(d, 1.0 / 6.0);
  const V series = hn::MulAdd(curvature, sixth, hn::NegMulAdd(half, slant, one));
  distribution = hn::MulAdd(hn::Mul(density0, h), series, distribution0);
  const V third = hn::Mul(hn::Mul(hn::Mul(slant, hn::Mul(h, h)), hn::Sub(hn::Set(d, 3.0), t0t0)), sixth);
  density = hn::Mul(density0, hn::Add(hn::MulAdd(curvature, half, hn::Sub(one, slant)), third));
}

template <std::size_t kSteps, std::size_t kImages>
HWY_INLINE void Sum(const StepSamples& samples, double blur_px, const double* places_px, StepSums& sums) {
  const D d;
  const V scale = hn::Set(d, 1.0 / blur_px);
  const double* table = &math::edge_table()[0].distribution;
  V step[kSteps], slope[kSteps], steps[kSteps][kSteps], cross[kSteps][kSteps], slopes[kSteps][kSteps];
  V by_step[kImages][kSteps], by_slope[kImages][kSteps];
  for (std::size_t j = 0; j < kSteps; ++j) {
    step[j] = slope[j] = hn::Zero(d);
    for (std::size_t l = 0; l < kSteps; ++l) steps[j][l] = cross[j][l] = slopes[j][l] = hn::Zero(d);
    for (std::size_t image = 0; image < kImages; ++image) by_step[image][j] = by_slope[image][j] = hn::Zero(d);
  }
  for (std::size_t i = 0; i < samples.padded; i += hn::Lanes(d)) {
    const V across = hn::LoadU(d, samples.across_px + i);
    V g[kSteps], p[kSteps];
    for (std::size_t j = 0; j < kSteps; ++j) {
      Profile(table, hn::Mul(hn::Sub(across, hn::Set(d, places_px[j])), scale), g[j], p[j]);
      p[j] = hn::Mul(p[j], scale);
    }
    for (std::size_t j = 0; j < kSteps; ++j) {
      step[j] = hn::Add(step[j], g[j]);
      slope[j] = hn::Add(slope[j], p[j]);
      for (std::size_t l = 0; l <= j; ++l) {
        steps[j][l] = hn::MulAdd(g[j], g[l], steps[j][l]);
        slopes[j][l] = hn::MulAdd(p[j], p[l], slopes[j][l]);
      }
      for (std::size_t l = 0; l < kSteps; ++l) cross[j][l] = hn::MulAdd(g[j], p[l], cross[j][l]);
    }
    for (std::size_t image = 0; image < kImages; ++image) {
      const V level = hn::LoadU(d, samples.levels[image] + i);
      for (std::size_t j = 0; j < kSteps; ++j) {
        by_step[image][j] = hn::MulAdd(g[j], level, by_step[image][j]);
        by_slope[image][j] = hn::MulAdd(p[j], level, by_slope[image][j]);
      }
    }
  }
  const auto total = [&](V lanes) { return hn::GetLane(hn::SumOfLanes(d, lanes)); };
  for (std::size_t j = 0; j < kSteps; ++j) {
    sums.step[j] = total(step[j]);
    sums.slope[j] = total(slope[j]);
    for (std::size_t l = 0; l <= j; ++l) {
      sums.steps[j][l] = total(steps[j][l]);
      sums.slopes[j][l] = total(slopes[j][l]);
    }
    for (std::size_t l = 0; l < kSteps; ++l) sums.cross[j][l] = total(cross[j][l]);
    for (std::size_t image = 0; image < kImages; ++image) {
      sums.by_step[image][j] = total(by_step[image][j]);
      sums.by_slope[image][j] = total(by_slope[image][j]);
    }
  }
}

template <std::size_t kSteps>
HWY_INLINE void SumImages(const StepSamples& samples, double blur_px, const double* places_px, StepSums& sums) {
  if (samples.images == 1) Sum<kSteps, 1>(samples, blur_px, places_px, sums);
  if (samples.images == 2) Sum<kSteps, 2>(samples, blur_px, places_px, sums);
  if (samples.images == 3) Sum<kSteps, 3>(samples, blur_px, places_px, sums);
}

void SumSteps(const StepSamples& samples, double blur_px, const double* places_px, std::size_t count, StepSums& sums) {
  if (count == 1) SumImages<1>(samples, blur_px, places_px, sums);
  if (count == 2) SumImages<2>(samples, blur_px, places_px, sums);
  if (count == 3) SumImages<3>(samples, blur_px, places_px, sums);
}

}  // namespace crosstie::scan::detail::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace crosstie::scan::detail {

HWY_EXPORT(SumSteps);

StepSums sum_steps(const StepSamples& samples, double blur_px, const double* places_px, std::size_t count) {
  StepSums sums;
  HWY_DYNAMIC_DISPATCH(SumSteps)(samples, blur_px, places_px, count, sums);
  return sums;
}

}  // namespace crosstie::scan::detail
#endif
