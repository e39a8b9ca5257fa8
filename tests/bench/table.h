#pragma once

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <vector>

namespace crosstie::bench {

/// Milliseconds that `work` takes.
template <typename Work>
double millis_of(Work&& work) {
  const auto start = std::chrono::steady_clock::now();
  work();
  return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
}

inline double median_of(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

/// The table that every bench prints: what, ours, peer, ratio (peer over ours: above 1 we are better, where less is better).
inline void print_heading(const char* peer) {
  std::printf("%-44s %10s %10s %8s   peer: %s\n", "what", "ours", "peer", "ratio", peer);
}
inline void print_row(const char* what, double ours, double peer) {
  std::printf("%-44s %10.2f %10.2f %8.2f\n", what, ours, peer, peer / ours);
}

}  // namespace crosstie::bench
