#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <random>
#include <vector>

namespace crosstie::bundle::detail {

/// Random samples of k distinct of n numbers; the same sequence for the same seed on every machine (the distributions of the
/// standard library promise no such thing, so the numbers are reduced by hand).
class Sampler {
 public:
  Sampler(int count, std::uint64_t seed) : count_(count), generator_(seed) {}

  template <std::size_t K>
  void draw(std::array<int, K>& sample) {
    for (std::size_t i = 0; i < K; ++i) {
      do {
        sample[i] = static_cast<int>(generator_() % static_cast<std::uint64_t>(count_));
      } while (std::find(sample.begin(), sample.begin() + static_cast<std::ptrdiff_t>(i), sample[i]) !=
               sample.begin() + static_cast<std::ptrdiff_t>(i));
    }
  }

 private:
  int count_;
  std::mt19937_64 generator_;
};

/// The truncated cost of MSAC (Torr & Zisserman 2000): outliers cost as much as an error at the tolerance.
inline double truncated_cost(double squared_error, double tolerance) {
  const double limit = tolerance * tolerance;
  return squared_error < limit ? squared_error : limit;
}

}  // namespace crosstie::bundle::detail
