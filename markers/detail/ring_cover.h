#pragma once

#include <cstdint>
#include <vector>

#include "markers/detail/ring_levels.h"

namespace crosstie::markers::detail {

/// The segments' grid and what was read on it.
class RingGrid {
 public:
  /// The first segment begins at `phase` samples.
  RingGrid(int bits, double phase, std::uint64_t ring);

  [[nodiscard]] int bits() const { return static_cast<int>(set_.size()); }
  [[nodiscard]] double bit(int segment) const { return set_[static_cast<std::size_t>((segment + bits()) % bits())]; }
  /// Place of sample `k` in segments, 0 <= place < bits.
  [[nodiscard]] double place(std::size_t k) const {
    const double place = (static_cast<double>(k) - phase_) / kSamplesPerSegment;
    return place < 0.0 ? place + bits() : place;
  }

 private:
  double phase_;
  std::vector<double> set_;  ///< 0 or 1
};

/// What speaks for something lying over a ring; both of RingReading.
struct RingCover {
  double misfit = 0.0;
  bool hidden = false;
};

/// Compares what was sampled (`rings` at the radii `rhos`, `means` of the segments) with the image of the code that was read.
[[nodiscard]] RingCover look_for_cover(const MarkerFamily& family, const DotFit& dot, const RingSweep& sweep,
                                       const RingLevels& levels, const RingGrid& grid, const std::vector<double>& means,
                                       const std::vector<double>& rhos, std::vector<std::vector<double>> rings);

}  // namespace crosstie::markers::detail
