#include "markers/detail/blur_kernel.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "markers/detail/blur_kernel.cc"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace crosstie::markers::detail::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

template <std::size_t kOrders>
HWY_INLINE void WeighRows(const float* const* rows, const float* weights, std::size_t taps, std::size_t count,
                          float* const* out) {
  const hn::CappedTag<float, kBlurPadding> d;
  for (std::size_t i = 0; i < count; i += hn::Lanes(d)) {
    hn::Vec<decltype(d)> sums[kOrders];
    for (std::size_t k = 0; k < kOrders; ++k) sums[k] = hn::Zero(d);
    for (std::size_t t = 0; t < taps; ++t) {
      const auto values = hn::LoadU(d, rows[t] + i);
      for (std::size_t k = 0; k < kOrders; ++k) sums[k] = hn::MulAdd(hn::Set(d, weights[k * taps + t]), values, sums[k]);
    }
    for (std::size_t k = 0; k < kOrders; ++k) hn::StoreU(sums[k], d, out[k] + i);
  }
}

void Weigh(const float* const* rows, const float* weights, std::size_t taps, std::size_t count, std::size_t orders,
           float* const* out) {
  if (orders == 1) {
    WeighRows<1>(rows, weights, taps, count, out);
  } else if (orders == 2) {
    WeighRows<2>(rows, weights, taps, count, out);
  } else {
    WeighRows<kBlurOrders>(rows, weights, taps, count, out);
  }
}

}  // namespace crosstie::markers::detail::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace crosstie::markers::detail {

HWY_EXPORT(Weigh);

void weigh_rows(const float* const* rows, const float* weights, std::size_t taps, std::size_t count, std::size_t orders,
                float* const* out) {
  HWY_DYNAMIC_DISPATCH(Weigh)(rows, weights, taps, count, orders, out);
}

}  // namespace crosstie::markers::detail
#endif
