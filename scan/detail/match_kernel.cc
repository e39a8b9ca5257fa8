#include "scan/detail/match_kernel.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "scan/detail/match_kernel.cc"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace crosstie::scan::detail::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using D = hn::CappedTag<float, MatchBatch::kSize>;
using DI = hn::RebindToSigned<D>;
using V = hn::Vec<D>;
using VI = hn::Vec<DI>;
using M = hn::Mask<D>;

HWY_INLINE V Number(double value) { return hn::Set(D(), static_cast<float>(value)); }
HWY_INLINE V At(const float* plane, VI index) { return hn::GatherIndex(D(), plane, index); }
HWY_INLINE VI Beside(VI index, std::int32_t steps) { return hn::Add(index, hn::Set(DI(), steps)); }

/// A bilinear cell of a plane, as what is added to its upper left value.
struct Cell {
  V first, by_u, by_v, by_uv;
};

HWY_INLINE Cell CellAt(const float* plane, VI index, std::int32_t width) {
  const V v00 = At(plane, index);
  const V v10 = At(plane, Beside(index, 1));
  const V v01 = At(plane, Beside(index, width));
  const V v11 = At(plane, Beside(index, width + 1));
  const V by_u = hn::Sub(v10, v00);
  return {v00, by_u, hn::Sub(v01, v00), hn::Sub(hn::Sub(v11, v01), by_u)};
}

HWY_INLINE V SlopeU(const Cell& cell, V v) { return hn::MulAdd(v, cell.by_uv, cell.by_u); }
HWY_INLINE V SlopeV(const Cell& cell, V u) { return hn::MulAdd(u, cell.by_uv, cell.by_v); }
HWY_INLINE V Rise(const Cell& cell, V u, V v) { return hn::MulAdd(u, SlopeU(cell, v), hn::Mul(v, cell.by_v)); }
HWY_INLINE V Cross(V a, V b, V c, V d) { return hn::Sub(hn::Mul(a, d), hn::Mul(b, c)); }

/// Second difference of a smooth plane along one direction, of two lines the mean; 0 where it does not reach.
HWY_INLINE V Bend(const float* plane, VI index, std::int32_t along, std::int32_t across) {
  V sum = hn::Zero(D());
  for (const std::int32_t line : {0, across}) {
    const VI at = Beside(index, line);
    const V outer = hn::Add(At(plane, Beside(at, 4 * along)), At(plane, Beside(at, -3 * along)));
    sum = hn::Add(sum, hn::Sub(outer, hn::Add(At(plane, Beside(at, along)), At(plane, at))));
  }
  return hn::IfThenZeroElse(hn::IsNaN(sum), hn::Mul(sum, Number(0.5 / 12.0)));
}

/// A place and the smooth coordinates' slopes there.
struct Place {
  VI index;  ///< of a pixel of the image where nothing was found, too
  V x, y;    ///< of that pixel
  V u, v, au, av, bu, bv;
  M found;
};

HWY_INLINE M Within(V value, double least, double most) {
  return hn::And(hn::Ge(value, Number(least)), hn::Le(value, Number(most)));
}

/// By what a plane falls short of its chords at the place, over the pixels round its cell; 0 beside the image's border.
HWY_INLINE V Sag(const MatchPlanes& planes, const float* smooth, const Place& place) {
  constexpr int kReach = 4;
  const DI di;
  const V one = Number(1.0);
  const M roomy =
      hn::And(Within(place.x, kReach, planes.width - 1 - kReach), Within(place.y, kReach, planes.height - 1 - kReach));
  if (hn::AllFalse(D(), roomy)) return hn::Zero(D());
  const VI middle = hn::Set(di, planes.height / 2 * planes.width + planes.width / 2);  // has room where any pixel has
  const VI at = hn::IfThenElse(hn::RebindMask(di, roomy), place.index, middle);
  const V along = hn::Mul(hn::Mul(place.u, hn::Sub(one, place.u)), Bend(smooth, at, 1, planes.width));
  const V down = hn::Mul(hn::Mul(place.v, hn::Sub(one, place.v)), Bend(smooth, at, planes.width, 1));
  return hn::IfThenElseZero(roomy, hn::Mul(Number(0.5), hn::Add(along, down)));
}

/// What the coordinate is missing at the place: the left pixel's less the raw plane's, which bends as the smooth one does.
HWY_INLINE V Missing(const MatchPlanes& planes, const float* raw, const float* smooth, V wanted, const Place& place) {
  const Cell cell = CellAt(raw, place.index, planes.width);
  return hn::Add(hn::Sub(hn::Sub(wanted, cell.first), Rise(cell, place.u, place.v)), Sag(planes, smooth, place));
}

/// Of the interpolated plane and the left pixel together.
HWY_INLINE V Variance(const MatchPlanes& planes, const float* sigmas, V own, const Place& place) {
  const V u1 = hn::Sub(Number(1.0), place.u);
  const V v1 = hn::Sub(Number(1.0), place.v);
  const V s00 = hn::Mul(hn::Mul(u1, v1), At(sigmas, place.index));
  const V s10 = hn::Mul(hn::Mul(place.u, v1), At(sigmas, Beside(place.index, 1)));
  const V s01 = hn::Mul(hn::Mul(u1, place.v), At(sigmas, Beside(place.index, planes.width)));
  const V s11 = hn::Mul(hn::Mul(place.u, place.v), At(sigmas, Beside(place.index, planes.width + 1)));
  V sum = hn::Mul(own, own);
  for (const V s : {s00, s10, s01, s11}) sum = hn::MulAdd(s, s, sum);
  return sum;
}

HWY_INLINE Place FindPlace(const MatchPlanes& planes, V a, V b, V column, V row) {
  constexpr int kSteps = 8;        // from cell to cell
  constexpr int kNewtons = 3;      // in each
  constexpr double kSlack = 1e-3;  // of a cell, beyond which a place is the next one's
  const D d;
  const DI di;
  const auto inside = [&](V x, V y) { return hn::And(Within(x, 0.0, planes.width - 2), Within(y, 0.0, planes.height - 2)); };
  Place place = {};
  for (V* value : {&place.x, &place.y, &place.u, &place.v, &place.au, &place.av, &place.bu, &place.bv}) *value = hn::Zero(d);
  place.index = hn::Zero(di);
  place.found = hn::Lt(place.x, place.x);  // nowhere
  V x = hn::Floor(column);
  V y = hn::Floor(row);
  V u = hn::Sub(column, x);
  V v = hn::Sub(row, y);
  M open = inside(x, y);
  for (int step = 0; step < kSteps && !hn::AllFalse(d, open); ++step) {
    const VI whole = hn::Add(hn::Mul(hn::ConvertTo(di, y), hn::Set(di, planes.width)), hn::ConvertTo(di, x));
    const VI index = hn::IfThenElseZero(hn::RebindMask(di, open), whole);
    const Cell cell_a = CellAt(planes.a_smooth, index, planes.width);
    const Cell cell_b = CellAt(planes.b_smooth, index, planes.width);
    const V want_a = hn::Sub(a, cell_a.first);
    const V want_b = hn::Sub(b, cell_b.first);
    V au, av, bu, bv;
    for (int newton = 0; newton < kNewtons; ++newton) {
      au = SlopeU(cell_a, v);
      av = SlopeV(cell_a, u);
      bu = SlopeU(cell_b, v);
      bv = SlopeV(cell_b, u);
      const V inverse = hn::Div(Number(1.0), Cross(au, av, bu, bv));
      const V ra = hn::Sub(want_a, Rise(cell_a, u, v));
      const V rb = hn::Sub(want_b, Rise(cell_b, u, v));
      u = hn::MulAdd(Cross(ra, av, rb, bv), inverse, u);
      v = hn::MulAdd(Cross(au, ra, bu, rb), inverse, v);
    }
    const M met = hn::And(open, hn::And(Within(u, -kSlack, 1.0 + kSlack), Within(v, -kSlack, 1.0 + kSlack)));
    const auto keep = [&](V now, V& kept) { kept = hn::IfThenElse(met, now, kept); };
    place.index = hn::IfThenElse(hn::RebindMask(di, met), index, place.index);
    keep(x, place.x);
    keep(y, place.y);
    keep(u, place.u);
    keep(v, place.v);
    keep(au, place.au);
    keep(av, place.av);
    keep(bu, place.bu);
    keep(bv, place.bv);
    place.found = hn::Or(place.found, met);
    const V move_x = hn::Floor(u);
    const V move_y = hn::Floor(v);
    x = hn::Add(x, move_x);
    y = hn::Add(y, move_y);
    u = hn::Sub(u, move_x);
    v = hn::Sub(v, move_y);
    open = hn::And(hn::AndNot(met, open), inside(x, y));  // not where anything is no number
  }
  return place;
}

HWY_INLINE void MatchLanes(const MatchPlanes& planes, MatchBatch& batch, std::size_t i) {
  const D d;
  const DI di;
  const auto load = [&](const MatchBatch::Each<float>& each) { return hn::LoadU(d, each.data() + i); };
  const auto store = [&](V value, MatchBatch::Each<float>& each) { hn::StoreU(value, d, each.data() + i); };
  const V a = load(batch.a);
  const V b = load(batch.b);
  const V curve = load(batch.curve_px);
  const std::int32_t width = planes.width;
  const Place place = FindPlace(planes, a, b, load(batch.column), load(batch.row));
  const auto store_found = [&](M found) {
    const hn::Rebind<std::uint8_t, D> bytes;
    const V told = hn::IfThenElseZero(found, Number(1.0));
    hn::StoreU(hn::DemoteTo(bytes, hn::ConvertTo(di, told)), bytes, batch.found.data() + i);
  };
  if (hn::AllFalse(d, place.found)) {
    store_found(place.found);
    return;
  }
  const V u = place.u;
  const V v = place.v;
  const Cell cell_x = CellAt(planes.x_px, place.index, width);
  const Cell cell_y = CellAt(planes.y_px, place.index, width);
  const V xu = SlopeU(cell_x, v), xv = SlopeV(cell_x, u), yu = SlopeU(cell_y, v), yv = SlopeV(cell_y, u);
  const V area = Cross(xu, xv, yu, yv);
  const V slope = hn::Div(Cross(place.au, place.av, yu, yv), area);  // of a along the curve
  const V expected = hn::Set(d, planes.slope);
  M found = hn::And(place.found, hn::Gt(hn::Abs(area), Number(1e-6)));
  found = hn::And(found, hn::Ge(hn::Mul(slope, expected), hn::Mul(hn::Mul(expected, expected), hn::Set(d, planes.min_slope))));
  const V missing_a = Missing(planes, planes.a_raw, planes.a_smooth, a, place);
  const V variance_a = Variance(planes, planes.a_sigma, load(batch.a_sigma), place);
  V beside = Rise(cell_x, u, v);
  V sigma = hn::Div(hn::Sqrt(variance_a), hn::Abs(slope));
  if (planes.b_raw == nullptr) {
    beside = hn::Add(beside, hn::Div(missing_a, slope));
  } else {
    const V missing_b = Missing(planes, planes.b_raw, planes.b_smooth, b, place);
    const V variance_b = Variance(planes, planes.b_sigma, load(batch.b_sigma), place);
    // d (x, y) / d (a, b)
    const V determinant = Cross(place.au, place.av, place.bu, place.bv);
    found = hn::And(found, hn::Gt(hn::Abs(determinant), Number(1e-12)));
    const V inverse = hn::Div(Number(1.0), determinant);
    const V x_by_a = hn::Mul(Cross(xu, xv, place.bu, place.bv), inverse);
    const V x_by_b = hn::Mul(Cross(place.au, place.av, xu, xv), inverse);
    const V y_by_a = hn::Mul(Cross(yu, yv, place.bu, place.bv), inverse);
    const V y_by_b = hn::Mul(Cross(place.au, place.av, yu, yv), inverse);
    const auto sum = [&](V p, V q, V r, V s) {
      return hn::MulAdd(hn::Mul(p, q), variance_a, hn::Mul(hn::Mul(r, s), variance_b));
    };
    const V cov_xx = sum(x_by_a, x_by_a, x_by_b, x_by_b);
    const V cov_xy = sum(x_by_a, y_by_a, x_by_b, y_by_b);
    const V cov_yy = sum(y_by_a, y_by_a, y_by_b, y_by_b);
    const V off = hn::Add(hn::Add(hn::Sub(cell_y.first, curve), Rise(cell_y, u, v)),
                          hn::MulAdd(y_by_a, missing_a, hn::Mul(y_by_b, missing_b)));
    // Of all places on the curve the likeliest.
    const V lean = hn::Div(cov_xy, cov_yy);
    beside = hn::Add(beside, hn::NegMulAdd(lean, off, hn::MulAdd(x_by_a, missing_a, hn::Mul(x_by_b, missing_b))));
    sigma = hn::Sqrt(hn::Max(hn::Zero(d), hn::NegMulAdd(lean, cov_xy, cov_xx)));
    store(off, batch.off_px);
    store(hn::Sqrt(cov_yy), batch.off_sigma_px);
  }
  store_found(hn::AndNot(hn::IsNaN(hn::Add(beside, sigma)), found));
  store(beside, batch.beside_px);
  store(sigma, batch.sigma_px);
  hn::StoreU(place.index, di, batch.cell.data() + i);
  store(hn::Add(place.x, u), batch.column);
  store(hn::Add(place.y, v), batch.row);
}

void Match(const MatchPlanes& planes, MatchBatch& batch) {
  for (std::size_t i = 0; i < MatchBatch::kSize; i += hn::Lanes(D())) MatchLanes(planes, batch, i);
}

}  // namespace crosstie::scan::detail::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace crosstie::scan::detail {

HWY_EXPORT(Match);

void match_batch(const MatchPlanes& planes, MatchBatch& batch) { HWY_DYNAMIC_DISPATCH(Match)(planes, batch); }

}  // namespace crosstie::scan::detail
#endif
