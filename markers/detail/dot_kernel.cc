#include "markers/detail/dot_kernel.h"

#include <algorithm>
#include <iterator>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "markers/detail/dot_kernel.cc"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include <hwy/contrib/math/math-inl.h>

HWY_BEFORE_NAMESPACE();
namespace crosstie::markers::detail::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using D = hn::CappedTag<float, kPixelPadding>;
using V = hn::Vec<D>;

/// The model at a vector of pixels.
struct Prediction {
  V grey, inside, slope;      // slope: d grey / d distance, 0 where cut off
  V ex, ey, nx, ny;           // offset from the centre, outward normal
  V rho, gradient, distance;  // gradient: |A e|
  V set_back;                 // of the blurred edge, by its curvature
};

/// The normal distribution's upper tail at |t|, and its density (Abramowitz and Stegun 7.1.26; error below 1e-7).
HWY_INLINE void Tail(V t, V& tail, V& density) {
  const D d;
  const V z = hn::Min(hn::Abs(t), hn::Set(d, 9.0F));
  const V bell = hn::Exp(d, hn::Mul(hn::Set(d, -0.5F), hn::Mul(z, z)));
  const V k = hn::Div(hn::Set(d, 1.0F), hn::MulAdd(z, hn::Set(d, 0.3275911F * 0.70710678F), hn::Set(d, 1.0F)));
  V p = hn::MulAdd(k, hn::Set(d, 1.061405429F), hn::Set(d, -1.453152027F));
  p = hn::MulAdd(k, p, hn::Set(d, 1.421413741F));
  p = hn::MulAdd(k, p, hn::Set(d, -0.284496736F));
  p = hn::MulAdd(k, p, hn::Set(d, 0.254829592F));
  tail = hn::Mul(hn::Mul(hn::Set(d, 0.5F), k), hn::Mul(p, bell));
  density = hn::Mul(bell, hn::Set(d, 0.39894228F));
}

HWY_INLINE Prediction Predict(const DotModel& m, V x, V y) {
  const D d;
  const V one = hn::Set(d, 1.0F);
  const V axx = hn::Set(d, m.axx);
  const V axy = hn::Set(d, m.axy);
  const V ayy = hn::Set(d, m.ayy);
  Prediction p;
  p.ex = hn::Sub(x, hn::Set(d, m.cx));
  p.ey = hn::Sub(y, hn::Set(d, m.cy));
  const V gx = hn::MulAdd(axx, p.ex, hn::Mul(axy, p.ey));
  const V gy = hn::MulAdd(axy, p.ex, hn::Mul(ayy, p.ey));
  p.rho = hn::Sqrt(hn::Max(hn::MulAdd(p.ex, gx, hn::Mul(p.ey, gy)), hn::Set(d, 1e-8F)));
  p.gradient = hn::Sqrt(hn::Max(hn::MulAdd(gx, gx, hn::Mul(gy, gy)), hn::Set(d, 1e-8F)));
  const V inverse = hn::Div(one, p.gradient);
  p.nx = hn::Mul(gx, inverse);
  p.ny = hn::Mul(gy, inverse);
  p.distance = hn::Mul(hn::Mul(hn::Sub(p.rho, one), p.rho), inverse);
  const V along = hn::MulAdd(hn::Mul(axx, p.ny), p.ny, hn::Mul(hn::Mul(ayy, p.nx), p.nx));
  // Of the edge in the pixel's direction, not of the level curve through the pixel, which diverges in the centre.
  const V curvature = hn::Mul(hn::NegMulAdd(hn::Mul(hn::Set(d, 2.0F * m.axy), p.nx), p.ny, along), hn::Mul(inverse, p.rho));
  p.set_back = hn::Mul(hn::Set(d, 0.5F * m.blur * m.blur), curvature);
  const V t = hn::Mul(hn::Add(p.distance, p.set_back), hn::Set(d, 1.0F / m.blur));
  V tail, density;
  Tail(t, tail, density);
  p.inside = hn::IfThenElse(hn::Gt(t, hn::Zero(d)), tail, hn::Sub(one, tail));
  const V outer = hn::MulAdd(hn::Set(d, m.ox), x, hn::MulAdd(hn::Set(d, m.oy), y, hn::Set(d, m.o)));
  const V inner = hn::MulAdd(hn::Set(d, m.ix), x, hn::MulAdd(hn::Set(d, m.iy), y, hn::Set(d, m.i)));
  const V contrast = hn::Sub(inner, outer);
  const V saturated = hn::Set(d, m.saturated);
  const V grey = hn::MulAdd(contrast, p.inside, outer);
  p.slope = hn::IfThenElseZero(hn::Lt(grey, saturated), hn::Mul(hn::Mul(contrast, density), hn::Set(d, -1.0F / m.blur)));
  p.grey = hn::Min(grey, saturated);
  return p;
}

void Evaluate(const DotModel& m, const float* x, const float* y, const float* grey, std::size_t count, float* residual,
              float* inside, float* slope) {
  const D d;
  for (std::size_t i = 0; i < count; i += hn::Lanes(d)) {
    const Prediction p = Predict(m, hn::LoadU(d, x + i), hn::LoadU(d, y + i));
    hn::StoreU(hn::Sub(hn::Min(hn::LoadU(d, grey + i), hn::Set(d, m.saturated)), p.grey), d, residual + i);
    hn::StoreU(p.inside, d, inside + i);
    hn::StoreU(p.slope, d, slope + i);
  }
}

constexpr std::size_t kChunk = 192;
constexpr std::size_t kBlock = 4;  // columns are multiplied in tiles of this many

/// Vectors of partial sums, one after the other.
struct Partial {
  V cost, squares, edge, edge_lost;
};

/// Fills `columns` (kChunk apart) with the derivatives and, as the last one, the residual; all by the root of the weight.
template <bool kHarmonics>
HWY_INLINE void FillColumns(const DotModel& m, const DotPixels& pixels, const float* unit, std::size_t begin, std::size_t count,
                            float* columns, Partial& partial) {
  const D d;
  const V one = hn::Set(d, 1.0F);
  const V half = hn::Set(d, 0.5F);
  for (std::size_t i = 0; i < count; i += hn::Lanes(d)) {
    const V x = hn::LoadU(d, pixels.x + begin + i);
    const V y = hn::LoadU(d, pixels.y + begin + i);
    const V weight = hn::LoadU(d, pixels.weight + begin + i);
    const V limit2 = hn::LoadU(d, pixels.limit2 + begin + i);
    const Prediction p = Predict(m, x, y);
    const V r = hn::Sub(hn::Min(hn::LoadU(d, pixels.grey + begin + i), hn::Set(d, m.saturated)), p.grey);
    const V r2 = hn::Mul(r, r);
    const auto used = hn::Gt(weight, hn::Zero(d));
    partial.squares = hn::Add(partial.squares, hn::IfThenElseZero(used, r2));
    const V slope2 = hn::IfThenElseZero(used, hn::Mul(p.slope, p.slope));
    partial.edge = hn::Add(partial.edge, slope2);
    V robust = one;
    V cost = hn::Mul(r2, weight);
    const auto within = hn::Le(r2, limit2);
    if (!hn::AllTrue(d, within)) {
      const V ratio = hn::Max(hn::Div(r2, limit2), one);
      robust = hn::Div(one, ratio);
      partial.edge_lost = hn::MulAdd(slope2, hn::Sub(one, robust), partial.edge_lost);
      cost = hn::IfThenElse(within, cost, hn::Mul(hn::Mul(limit2, weight), hn::Add(one, hn::Log(d, ratio))));
    }
    partial.cost = hn::Add(partial.cost, cost);
    // Pixels whose model is cut off say nothing of the parameters: their slope is 0, and so is their root.
    const auto open = hn::Lt(p.grey, hn::Set(d, m.saturated));
    const V root = hn::IfThenElseZero(open, hn::Sqrt(hn::Mul(weight, robust)));
    const V slope = hn::Mul(p.slope, root);
    // distance = (rho^2 - rho) / g with g = |A e|: distance' = (2 rho - 1) rho' / g - distance g' / g.
    const V inverse = hn::Div(one, p.gradient);
    const V by_rho = hn::Mul(hn::Mul(slope, hn::Sub(hn::Add(p.rho, p.rho), one)), inverse);
    const V by_g = hn::Neg(hn::Mul(hn::Mul(slope, p.distance), inverse));
    const V by_rho2 = hn::Div(by_rho, p.rho);
    const V axx = hn::Set(d, m.axx);
    const V axy = hn::Set(d, m.axy);
    const V ayy = hn::Set(d, m.ayy);
    float* out = columns + i;
    const auto store = [&](int column, V value) { hn::StoreU(value, d, out + static_cast<std::size_t>(column) * kChunk); };
    const V pull = hn::Mul(by_rho2, p.gradient);
    store(0, hn::Neg(hn::MulAdd(pull, p.nx, hn::Mul(by_g, hn::MulAdd(axx, p.nx, hn::Mul(axy, p.ny))))));
    store(1, hn::Neg(hn::MulAdd(pull, p.ny, hn::Mul(by_g, hn::MulAdd(axy, p.nx, hn::Mul(ayy, p.ny))))));
    const V gx = hn::Mul(by_g, p.nx);
    const V gy = hn::Mul(by_g, p.ny);
    const V bx = hn::Mul(by_rho2, p.ex);
    const V by = hn::Mul(by_rho2, p.ey);
    store(2, hn::Mul(hn::MulAdd(half, bx, gx), p.ex));
    store(3, hn::MulAdd(bx, p.ey, hn::MulAdd(gx, p.ey, hn::Mul(gy, p.ex))));
    store(4, hn::Mul(hn::MulAdd(half, by, gy), p.ey));
    store(5, hn::Mul(hn::Mul(slope, hn::Sub(p.set_back, p.distance)), hn::Set(d, 1.0F / m.blur)));
    const V inside = hn::Mul(p.inside, root);
    const V outside = hn::Sub(root, inside);
    store(6, outside);
    store(7, hn::Mul(outside, x));
    store(8, hn::Mul(outside, y));
    store(9, inside);
    store(10, hn::Mul(inside, x));
    store(11, hn::Mul(inside, y));
    if constexpr (kHarmonics) {
      const V inverse_rho = hn::Div(one, p.rho);
      const V c = hn::Mul(hn::MulAdd(hn::Set(d, unit[0]), p.ex, hn::Mul(hn::Set(d, unit[1]), p.ey)), inverse_rho);
      const V s = hn::Mul(hn::MulAdd(hn::Set(d, unit[2]), p.ex, hn::Mul(hn::Set(d, unit[3]), p.ey)), inverse_rho);
      V re = hn::NegMulAdd(s, s, hn::Mul(c, c));  // of (c + i s)^2
      V im = hn::Mul(hn::Add(c, c), s);
      const V amount = hn::Neg(slope);
      for (int h = 0; h < kEdgeHarmonics / 2; ++h) {
        const V next = hn::NegMulAdd(im, s, hn::Mul(re, c));
        im = hn::MulAdd(re, s, hn::Mul(im, c));
        re = next;
        store(kDotColumns + 2 * h, hn::Mul(amount, re));
        store(kDotColumns + 2 * h + 1, hn::Mul(amount, im));
      }
    }
    store(kHarmonics ? kAllColumns : kDotColumns, hn::Mul(r, root));
  }
}

/// sums[a][b] += columns_a . columns_b for the kBlock x kB columns at `a` and `b`; each sum is a vector in `sums`, which holds
/// nothing yet where the columns are the `first`.
template <std::size_t kB>
HWY_INLINE void Multiply(const float* a, const float* b, std::size_t count, bool first, float* sums) {
  const D d;
  const std::size_t lanes = hn::Lanes(d);
  V acc[kBlock * kB];
  for (std::size_t k = 0; k < kBlock * kB; ++k) acc[k] = first ? hn::Zero(d) : hn::LoadU(d, sums + k * lanes);
  for (std::size_t i = 0; i < count; i += lanes) {
    V left[kBlock];
    for (std::size_t k = 0; k < kBlock; ++k) left[k] = hn::LoadU(d, a + k * kChunk + i);
    for (std::size_t l = 0; l < kB; ++l) {
      const V right = hn::LoadU(d, b + l * kChunk + i);
      for (std::size_t k = 0; k < kBlock; ++k) acc[l * kBlock + k] = hn::MulAdd(left[k], right, acc[l * kBlock + k]);
    }
  }
  for (std::size_t k = 0; k < kBlock * kB; ++k) hn::StoreU(acc[k], d, sums + k * lanes);
}

template <bool kHarmonics>
HWY_INLINE void SumAll(const DotModel& m, const DotPixels& pixels, const float* unit, DotSums& result) {
  constexpr std::size_t kColumns = kHarmonics ? kAllColumns : kDotColumns;
  constexpr std::size_t kBlocks = (kColumns + kBlock - 1) / kBlock;
  constexpr std::size_t kTiles = kBlocks * (kBlocks + 1) / 2;
  constexpr std::size_t kTileSums = kBlock * kBlock;
  const D d;
  const std::size_t lanes = hn::Lanes(d);
  // The residual follows the derivatives; what fills the last block up meets only sums that nobody reads.
  HWY_ALIGN float columns[(kBlocks * kBlock + 1) * kChunk];
  HWY_ALIGN float sums[(kTiles * kTileSums + kBlocks * kBlock) * kPixelPadding];
  std::fill(columns + (kColumns + 1) * kChunk, std::end(columns), 0.0F);
  float* const right = sums + kTiles * kTileSums * lanes;
  Partial partial{hn::Zero(d), hn::Zero(d), hn::Zero(d), hn::Zero(d)};
  for (std::size_t begin = 0; begin < pixels.count; begin += kChunk) {
    const std::size_t count = pixels.count - begin < kChunk ? pixels.count - begin : kChunk;
    FillColumns<kHarmonics>(m, pixels, unit, begin, count, columns, partial);
    float* tile = sums;
    for (std::size_t b = 0; b < kBlocks; ++b) {
      for (std::size_t a = 0; a <= b; ++a, tile += kTileSums * lanes) {
        Multiply<kBlock>(columns + a * kBlock * kChunk, columns + b * kBlock * kChunk, count, begin == 0, tile);
      }
      Multiply<1>(columns + b * kBlock * kChunk, columns + kColumns * kChunk, count, begin == 0, right + b * kBlock * lanes);
    }
  }
  const auto total = [&](const float* at) { return static_cast<double>(hn::GetLane(hn::SumOfLanes(d, hn::LoadU(d, at)))); };
  const float* tile = sums;
  for (std::size_t b = 0; b < kBlocks; ++b) {
    for (std::size_t a = 0; a <= b; ++a, tile += kTileSums * lanes) {
      for (std::size_t l = 0; l < kBlock; ++l) {
        for (std::size_t k = 0; k < kBlock; ++k) {
          const std::size_t row = a * kBlock + k;
          const std::size_t column = b * kBlock + l;
          if (row <= column && column < kColumns) {
            result.normal[column * kAllColumns + row] = total(tile + (l * kBlock + k) * lanes);
          }
        }
      }
    }
  }
  for (std::size_t k = 0; k < kColumns; ++k) result.right[k] = total(right + k * lanes);
  const auto lane_sum = [&](V v) { return static_cast<double>(hn::GetLane(hn::SumOfLanes(d, v))); };
  result.cost = lane_sum(partial.cost);
  result.squares = lane_sum(partial.squares);
  result.edge = lane_sum(partial.edge);
  result.edge_lost = lane_sum(partial.edge_lost);
}

void Sum(const DotModel& m, const DotPixels& pixels, const float* unit, DotSums& sums) {
  if (unit == nullptr) {
    SumAll<false>(m, pixels, unit, sums);
  } else {
    SumAll<true>(m, pixels, unit, sums);
  }
}

}  // namespace crosstie::markers::detail::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace crosstie::markers::detail {

HWY_EXPORT(Evaluate);
HWY_EXPORT(Sum);

void evaluate_dot(const DotModel& model, const float* x, const float* y, const float* grey, std::size_t count, float* residual,
                  float* inside, float* slope) {
  HWY_DYNAMIC_DISPATCH(Evaluate)(model, x, y, grey, count, residual, inside, slope);
}
void sum_dot(const DotModel& model, const DotPixels& pixels, const float* unit_from_offset, DotSums& sums) {
  HWY_DYNAMIC_DISPATCH(Sum)(model, pixels, unit_from_offset, sums);
}

}  // namespace crosstie::markers::detail
#endif
