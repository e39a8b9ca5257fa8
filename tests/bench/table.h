#pragma once

#include <algorithm>
#include <cstdio>
#include <ctime>
#include <vector>

namespace crosstie::bench {

/// Milliseconds of processor time that `work` takes: what other programs do meanwhile does not count.
template <typename Work>
double millis_of(Work&& work) {
  const std::clock_t start = std::clock();
  work();
  return 1e3 * static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC;
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
