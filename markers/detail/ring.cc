#include "markers/detail/ring.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <numbers>

#include "markers/detail/ring_cover.h"
#include "markers/detail/ring_levels.h"

namespace crosstie::markers::detail {
namespace {

constexpr int kRadii = 5;
constexpr double kEdgeShare = 0.2;  // of the ring's width that is left out at its inner and its outer edge

double fraction_over_half(const std::vector<double>& values) {
  int over = 0;
  int all = 0;
  for (const double value : values) {
    if (!std::isfinite(value)) continue;
    ++all;
    if (value > 0.5) ++over;
  }
  return all > 0 ? static_cast<double>(over) / all : 1.0;
}

/// The phase of the segment grid in samples, [0, kSamplesPerSegment), and how well the transitions agree with it.
std::pair<double, double> grid_phase(const std::vector<double>& ring) {
  const std::size_t n = ring.size();
  std::array<double, kSamplesPerSegment> squares{};  // of the steps at each place in a segment
  for (std::size_t k = 0; k < n; ++k) {
    const double step = ring[k + 1 < n ? k + 1 : 0] - ring[k > 0 ? k - 1 : n - 1];
    squares[k % kSamplesPerSegment] += step * step;
  }
  std::complex<double> sum = 0.0;
  double total = 0.0;
  for (std::size_t i = 0; i < squares.size(); ++i) {
    sum += squares[i] * std::polar(1.0, 2.0 * std::numbers::pi * static_cast<double>(i) / kSamplesPerSegment);
    total += squares[i];
  }
  if (total <= 0.0) return {0.0, 0.0};
  double phase = std::arg(sum) / (2.0 * std::numbers::pi) * kSamplesPerSegment;
  if (phase < 0.0) phase += kSamplesPerSegment;
  return {phase, std::abs(sum) / total};
}

/// Mean of each segment over its middle half, for segments that begin at `phase` samples.
std::vector<double> segment_means(const std::vector<double>& ring, int bits, double phase) {
  const int n = static_cast<int>(ring.size());
  std::vector<double> means;
  for (int s = 0; s < bits; ++s) {
    double sum = 0.0;
    constexpr int kCount = kSamplesPerSegment / 2 + 1;
    for (int i = 0; i < kCount; ++i) {
      const double position = phase + s * kSamplesPerSegment + 0.25 * kSamplesPerSegment + i;
      const int k = static_cast<int>(position);
      const double fraction = position - k;
      sum += (1.0 - fraction) * ring[static_cast<std::size_t>(k % n)] + fraction * ring[static_cast<std::size_t>((k + 1) % n)];
    }
    means.push_back(sum / kCount);
  }
  return means;
}

/// A way to tell the ones from the zeros.
struct Split {
  double level = 0.5;
  double contrast = 0.0;
  double margin = 0.0;
};

/// In even light: at the level between the means of both classes.
Split split_between_means(const std::vector<double>& segments) {
  Split split;
  for (int iteration = 0; iteration < 4; ++iteration) {
    double sum1 = 0.0, sum0 = 0.0;
    int n1 = 0, n0 = 0;
    for (const double value : segments) {
      (value > split.level ? sum1 : sum0) += value;
      ++(value > split.level ? n1 : n0);
    }
    const double ones = n1 > 0 ? sum1 / n1 : 1.0;
    const double zeros = n0 > 0 ? sum0 / n0 : 0.0;
    split.level = 0.5 * (ones + zeros);
    split.contrast = ones - zeros;
  }
  split.margin = 1.0;
  for (const double value : segments) {
    split.margin = std::min(split.margin, std::abs(value - split.level) / std::max(0.5 * split.contrast, 1e-9));
  }
  return split;
}

/// Where a shadow lies across the ring, its ones differ by more than ones from zeros; but all zeros are as dark as the gap. The
/// split is then at the largest step in proportion, from values near the gap's level to others well above it.
Split split_above_gap(std::vector<double> segments) {
  constexpr double kDark = 0.12;   // largest value of a zero,
  constexpr double kBright = 0.2;  // smallest of a one, in contrasts of the dot
  constexpr double kProportion = 3.0;
  constexpr double kFloor = 0.05;  // values are not told apart below it
  std::sort(segments.begin(), segments.end());
  Split split;
  for (std::size_t i = 0; i + 1 < segments.size(); ++i) {
    const double dark = std::max(segments[i], kFloor);
    const double bright = segments[i + 1];
    if (segments[i] > kDark || bright < kBright || bright < kProportion * dark) continue;
    split.level = std::sqrt(dark * bright);
    split.contrast = segments.back() - segments.front();
    split.margin = std::min(1.0 - split.level / bright, 1.0 - segments[i] / split.level);
  }
  return split;
}

void classify(const std::vector<double>& segments, RingReading& reading) {
  Split split = split_between_means(segments);
  constexpr double kDoubtful = 0.4;
  if (split.margin < kDoubtful) {
    const Split in_shadow = split_above_gap(segments);
    if (in_shadow.margin > split.margin) split = in_shadow;
  }
  for (const double value : segments) reading.ring = (reading.ring << 1) | (value > split.level ? 1U : 0U);
  reading.contrast = split.contrast;
  reading.margin = split.margin;
}

}  // namespace

RingReading read_ring(const Sampler& image, const MarkerFamily& family, const DotFit& dot) {
  RingReading reading;
  const int count = family.bits * kSamplesPerSegment;
  const RingSweep sweep(image, dot, count);
  const RingLevels levels(sweep, family, dot);
  reading.bright_gap = fraction_over_half(levels.gap());
  reading.bright_quiet = fraction_over_half(levels.quiet());

  std::vector<double> ring(static_cast<std::size_t>(count), 0.0);
  std::vector<double> rhos;
  std::vector<std::vector<double>> rings;
  const double width = family.ring_outer - family.ring_inner;
  for (int i = 0; i < kRadii; ++i) {
    rhos.push_back(family.ring_inner + width * (kEdgeShare + (1.0 - 2.0 * kEdgeShare) * i / (kRadii - 1)));
    rings.push_back(levels.at(rhos.back()));
    for (std::size_t k = 0; k < ring.size(); ++k) {
      if (!std::isfinite(rings.back()[k])) reading.cut = true;
      ring[k] += rings.back()[k] / kRadii;
    }
  }
  if (reading.cut) return reading;
  const auto [smallest, largest] = std::minmax_element(ring.begin(), ring.end());
  reading.range = *largest - *smallest;
  const auto [phase, quality] = grid_phase(ring);
  reading.grid_quality = quality;
  reading.first_rad = 2.0 * std::numbers::pi * phase / count;
  const std::vector<double> means = segment_means(ring, family.bits, phase);
  classify(means, reading);

  if (family.id_of_ring(reading.ring)) {
    const RingGrid grid(family.bits, phase, reading.ring);
    const RingCover cover = look_for_cover(family, dot, sweep, levels, grid, means, rhos, std::move(rings));
    reading.misfit = cover.misfit;
    reading.hidden = cover.hidden;
  }
  return reading;
}

}  // namespace crosstie::markers::detail
