#pragma once

#include <cstddef>

namespace crosstie::markers::detail {

/// The loop of a convolution, compiled for several instruction sets and chosen at run time. Raw pointers, and no Eigen in this
/// file's source: objects built for AVX may not exchange its types with the rest.

inline constexpr std::size_t kBlurPadding = 16;  ///< counts are multiples of it
inline constexpr std::size_t kBlurOrders = 3;    ///< a kernel and its first two derivatives

/// out[order][i] = sum over t of weights[order taps + t] rows[t][i], for 0 <= i < count and the first `orders` of them.
void weigh_rows(const float* const* rows, const float* weights, std::size_t taps, std::size_t count, std::size_t orders,
                float* const* out);

}  // namespace crosstie::markers::detail
