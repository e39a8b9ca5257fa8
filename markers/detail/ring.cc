#include "markers/detail/ring.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <limits>
#include <numbers>

namespace crosstie::markers::detail {
namespace {

constexpr int kSamplesPerSegment = 16;
constexpr int kRadii = 5;
constexpr double kEdgeShare = 0.2;  // of the ring's width that is left out at its inner and its outer edge
constexpr double kOutside = std::numeric_limits<double>::quiet_NaN();

/// Unit vectors of the sampled directions, clockwise in the image.
class Sweep {
 public:
  Sweep(const Sampler& image, const DotFit& dot, int count)
      : image_(image), centre_px_(dot.ellipse.centre_px), pixel_from_unit_(dot.ellipse.pixel_from_unit()) {
    directions_.reserve(static_cast<std::size_t>(count));
    for (int k = 0; k < count; ++k) {
      const double phi = 2.0 * std::numbers::pi * k / count;
      directions_.emplace_back(pixel_from_unit_ * Eigen::Vector2d(std::cos(phi), std::sin(phi)));
    }
  }

  /// Grey levels at `rho` round the circle; NaN outside of the image.
  [[nodiscard]] std::vector<double> at(double rho) const {
    std::vector<double> greys;
    greys.reserve(directions_.size());
    for (const Eigen::Vector2d& direction : directions_) {
      const Eigen::Vector2d p = centre_px_ + rho * direction;
      greys.push_back(image_.inside(p.x(), p.y()) ? image_.bilinear(p.x(), p.y()) : kOutside);
    }
    return greys;
  }

 private:
  const Sampler& image_;
  Eigen::Vector2d centre_px_;
  Eigen::Matrix2d pixel_from_unit_;
  std::vector<Eigen::Vector2d> directions_;
};

/// Mean over 2 * half + 1 neighbours round the circle; what is not finite counts as `outside`.
std::vector<double> smoothed(const std::vector<double>& values, int half, double outside) {
  const int n = static_cast<int>(values.size());
  std::vector<double> means(values.size());
  for (int k = 0; k < n; ++k) {
    double sum = 0.0;
    for (int i = -half; i <= half; ++i) {
      const double value = values[static_cast<std::size_t>((k + i + n) % n)];
      sum += std::isfinite(value) ? value : outside;
    }
    means[static_cast<std::size_t>(k)] = sum / (2 * half + 1);
  }
  return means;
}

double fraction_over_half(const std::vector<double>& greys, double outer_level, double contrast) {
  int over = 0;
  int all = 0;
  for (const double grey : greys) {
    if (!std::isfinite(grey)) continue;
    ++all;
    if ((grey - outer_level) / contrast > 0.5) ++over;
  }
  return all > 0 ? static_cast<double>(over) / all : 1.0;
}

/// The phase of the segment grid in samples, [0, kSamplesPerSegment), and how well the transitions agree with it.
std::pair<double, double> grid_phase(const std::vector<double>& ring, int bits) {
  const int n = static_cast<int>(ring.size());
  std::complex<double> sum = 0.0;
  double total = 0.0;
  for (int k = 0; k < n; ++k) {
    const double step = ring[static_cast<std::size_t>((k + 1) % n)] - ring[static_cast<std::size_t>((k + n - 1) % n)];
    sum += step * step * std::polar(1.0, 2.0 * std::numbers::pi * bits * k / n);
    total += step * step;
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
  const Sweep sweep(image, dot, count);
  const double contrast = dot.inner_level - dot.outer_level;

  const std::vector<double> gap = sweep.at(0.5 * (1.0 + family.ring_inner));
  reading.bright_gap = fraction_over_half(gap, dot.outer_level, contrast);
  const std::vector<double> quiet = sweep.at(0.5 * (family.ring_outer + family.disc_outer));
  reading.bright_quiet = fraction_over_half(quiet, dot.outer_level, contrast);

  const std::vector<double> base = smoothed(gap, kSamplesPerSegment / 2, dot.outer_level);
  std::vector<double> ring(static_cast<std::size_t>(count), 0.0);
  const double width = family.ring_outer - family.ring_inner;
  for (int i = 0; i < kRadii; ++i) {
    const double rho = family.ring_inner + width * (kEdgeShare + (1.0 - 2.0 * kEdgeShare) * i / (kRadii - 1));
    const std::vector<double> greys = sweep.at(rho);
    for (std::size_t k = 0; k < ring.size(); ++k) {
      if (!std::isfinite(greys[k])) reading.cut = true;
      ring[k] += (greys[k] - base[k]) / (contrast * kRadii);
    }
  }
  if (reading.cut) return reading;
  const auto [smallest, largest] = std::minmax_element(ring.begin(), ring.end());
  reading.range = *largest - *smallest;
  const auto [phase, quality] = grid_phase(ring, family.bits);
  reading.grid_quality = quality;
  classify(segment_means(ring, family.bits, phase), reading);
  reading.profile = std::move(ring);
  return reading;
}

}  // namespace crosstie::markers::detail
