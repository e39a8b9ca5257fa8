#include "markers/detail/ring.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <limits>
#include <numbers>
#include <span>

#include <Eigen/Cholesky>

#include "markers/detail/edge_profile.h"

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

  [[nodiscard]] std::size_t count() const { return directions_.size(); }
  /// Direction `k` in pixels for each dot radius.
  [[nodiscard]] const Eigen::Vector2d& direction(std::size_t k) const { return directions_[k]; }
  [[nodiscard]] double angle_rad(std::size_t k) const {
    return 2.0 * std::numbers::pi * static_cast<double>(k) / static_cast<double>(count());
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

/// How the level of what has tone 0 changes per dot radius from the centre, along both axes of the unit circle: the plane
/// through gap and quiet zone that most of both agree with (bright things, on the side of tone 1, have no say).
Eigen::Vector2d dark_slope(const Sweep& sweep, const std::vector<double>& gap, double gap_rho, const std::vector<double>& quiet,
                           double quiet_rho, double outer_level, double contrast) {
  constexpr int kIterations = 8;
  constexpr double kTolerated = 0.08;  // of the contrast
  Eigen::Vector3d plane(outer_level, 0.0, 0.0);
  for (int iteration = 0; iteration < kIterations; ++iteration) {
    Eigen::Matrix3d n = Eigen::Matrix3d::Zero();
    Eigen::Vector3d b = Eigen::Vector3d::Zero();
    const auto add = [&](const std::vector<double>& greys, double rho) {
      for (std::size_t k = 0; k < greys.size(); ++k) {
        if (!std::isfinite(greys[k])) continue;
        const Eigen::Vector3d row(1.0, rho * std::cos(sweep.angle_rad(k)), rho * std::sin(sweep.angle_rad(k)));
        const double residual = (greys[k] - row.dot(plane)) / contrast;
        const double weight = 1.0 / (1.0 + std::pow(residual / kTolerated, 2));
        n += weight * row * row.transpose();
        b += weight * greys[k] * row;
      }
    };
    add(gap, gap_rho);
    if (iteration > 0) add(quiet, quiet_rho);  // the gap first: it is known to be there
    n.diagonal() *= 1.0 + 1e-9;
    plane = n.ldlt().solve(b);
  }
  return plane.allFinite() ? Eigen::Vector2d(plane.tail<2>()) : Eigen::Vector2d(0.0, 0.0);
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

/// Levels round the marker: 0 = as dark as the gap in that direction, 1 = as bright as the dot.
class Levels {
 public:
  Levels(const Sweep& sweep, const MarkerFamily& family, const DotFit& dot)
      : sweep_(sweep), contrast_(dot.inner_level - dot.outer_level), gap_rho_(0.5 * (1.0 + family.ring_inner)) {
    const double quiet_rho = 0.5 * (family.ring_outer + family.disc_outer);
    const std::vector<double> gap = sweep.at(gap_rho_);
    slope_ = dark_slope(sweep, gap, gap_rho_, sweep.at(quiet_rho), quiet_rho, dot.outer_level, contrast_);
    base_ = smoothed(gap, kSamplesPerSegment / 2, dot.outer_level);
    for (std::size_t k = 0; k < gap.size(); ++k) {
      gap_.push_back((gap[k] - dot.outer_level - tilt(k, gap_rho_)) / contrast_);
      lift_ += (base_[k] - tilt(k, gap_rho_)) / static_cast<double>(gap.size());
    }
    quiet_ = sweep.at(quiet_rho);
    for (std::size_t k = 0; k < gap.size(); ++k) quiet_[k] = (quiet_[k] - lift_ - tilt(k, quiet_rho)) / contrast_;
  }

  [[nodiscard]] const std::vector<double>& gap() const { return gap_; }
  [[nodiscard]] const std::vector<double>& quiet() const { return quiet_; }
  /// At `rho`, from the gap's level in each direction; NaN outside of the image.
  [[nodiscard]] std::vector<double> at(double rho) const {
    std::vector<double> values = sweep_.at(rho);
    for (std::size_t k = 0; k < values.size(); ++k) {
      values[k] = (values[k] - base_[k] - tilt(k, rho - gap_rho_)) / contrast_;
    }
    return values;
  }

 private:
  [[nodiscard]] double tilt(std::size_t k, double rho) const {
    return rho * (slope_.x() * std::cos(sweep_.angle_rad(k)) + slope_.y() * std::sin(sweep_.angle_rad(k)));
  }

  const Sweep& sweep_;
  double contrast_;
  double gap_rho_;
  double lift_ = 0.0;  // of the dark plane at the centre
  Eigen::Vector2d slope_ = Eigen::Vector2d::Zero();
  std::vector<double> base_, gap_, quiet_;
};

/// The segments' grid and what was read on it.
struct Grid {
  int bits = 0;
  double phase = 0.0;  // samples
  std::uint64_t ring = 0;

  [[nodiscard]] double bit(int segment) const {
    return static_cast<double>((ring >> (bits - 1 - (segment % bits + bits) % bits)) & 1U);
  }
  /// Place of sample `k` in segments, 0 <= place < bits.
  [[nodiscard]] double place(std::size_t k) const {
    const double place = (static_cast<double>(k) - phase) / kSamplesPerSegment;
    return place < 0.0 ? place + bits : place;
  }
};

double quantile(std::vector<double> values, double share) {
  const auto place = values.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), place, values.end());
  return *place;
}

/// What the ring that was read would look like through the blur: along a radius and round the circle one after the other.
class RingImage {
 public:
  RingImage(const Grid& grid, const MarkerFamily& family, const DotFit& dot, const Sweep& sweep,
            const std::vector<double>& means)
      : grid_(grid), family_(family), dot_(dot), sweep_(sweep) {
    constexpr double kInterpolationVariance = 1.0 / 6.0;  // of bilinear sampling, px^2
    blur_px_ = std::sqrt(dot.blur_px * dot.blur_px + kInterpolationVariance);
    set_brightness(means);
  }

  /// Value at `rho` in direction `k`.
  [[nodiscard]] double at(std::size_t k, double rho) const {
    const double radial = share(k, rho, family_.ring_inner, family_.ring_outer);
    const double a = dot_.ellipse.semi_major_px;
    const double b = dot_.ellipse.semi_minor_px;
    const double px_per_segment = a * b * rho / sweep_.direction(k).norm() * 2.0 * std::numbers::pi / grid_.bits;
    const double place = grid_.place(k);
    const int segment = static_cast<int>(place);
    const double inside = place - segment;
    const double before = edge_profile(-inside * px_per_segment / blur_px_).distribution;
    const double after = edge_profile((inside - 1.0) * px_per_segment / blur_px_).distribution;
    const double set =
        grid_.bit(segment) * (1.0 - before - after) + grid_.bit(segment - 1) * before + grid_.bit(segment + 1) * after;
    const double bright = std::max(brightness_[static_cast<std::size_t>(segment % grid_.bits)], 0.0);
    return zeros_ + (bright - zeros_) * radial * set;
  }

  /// What the blur leaves of a circle from `inner` to `outer` at `rho`.
  [[nodiscard]] double share(std::size_t k, double rho, double inner, double outer) const {
    const double phi = sweep_.angle_rad(k);
    const double px_per_rho =
        1.0 / std::hypot(std::cos(phi) / dot_.ellipse.semi_major_px, std::sin(phi) / dot_.ellipse.semi_minor_px);
    return edge_profile((rho - inner) * px_per_rho / blur_px_).distribution -
           edge_profile((rho - outer) * px_per_rho / blur_px_).distribution;
  }

 private:
  /// A whole segment is as bright as it is, light and print differ; what the blur spreads into a 0 comes from the nearest ones.
  void set_brightness(const std::vector<double>& means) {
    std::vector<double> all_ones, all_zeros;
    for (int s = 0; s < grid_.bits; ++s) {
      (grid_.bit(s) > 0.5 ? all_ones : all_zeros).push_back(means[static_cast<std::size_t>(s)]);
    }
    // The darker ones of the zeros: what lies over some of them is brighter or hidden by being alike.
    zeros_ = all_zeros.empty() ? 0.0 : quantile(all_zeros, 0.25);
    const double ones = all_ones.empty() ? 1.0 : quantile(all_ones, 0.5);
    for (int s = 0; s < grid_.bits; ++s) {
      const double before = means[static_cast<std::size_t>((s + grid_.bits - 1) % grid_.bits)];
      const double after = means[static_cast<std::size_t>((s + 1) % grid_.bits)];
      double value = means[static_cast<std::size_t>(s)];
      if (grid_.bit(s) < 0.5) {
        const double n = grid_.bit(s - 1) + grid_.bit(s + 1);
        value = n > 0.0 ? (grid_.bit(s - 1) * before + grid_.bit(s + 1) * after) / n : ones;
      }
      brightness_.push_back(value);
    }
  }

  const Grid& grid_;
  const MarkerFamily& family_;
  const DotFit& dot_;
  const Sweep& sweep_;
  double blur_px_ = 0.0;
  double zeros_ = 0.0;
  std::vector<double> brightness_;
};

/// Values of all directions at a radius minus those of the image of the code.
std::vector<double> deviations(const std::vector<double>& values, const RingImage& image, double rho) {
  std::vector<double> result;
  for (std::size_t k = 0; k < values.size(); ++k) result.push_back(values[k] - image.at(k, rho));
  return result;
}

/// Largest mean deviation over the thirds of segments of one half of the ring; `rings` are the deviations at its radii.
double largest_misfit(const Grid& grid, std::span<const std::vector<double>> rings) {
  constexpr int kThirds = 3;
  const auto parts = static_cast<std::size_t>(grid.bits * kThirds);
  std::vector<double> sums(parts, 0.0), counts(parts, 0.0);
  for (const std::vector<double>& ring : rings) {
    for (std::size_t k = 0; k < ring.size(); ++k) {
      const auto part = static_cast<std::size_t>(grid.place(k) * kThirds) % parts;
      sums[part] += ring[k];
      counts[part] += 1.0;
    }
  }
  double largest = 0.0;
  for (std::size_t part = 0; part < parts; ++part) largest = std::max(largest, std::abs(sums[part] / counts[part]));
  return largest;
}

constexpr double kTold = 0.08;  // of the contrast: tones that are told apart

/// Directions in which something may lie over the ring, as the border shows: it is missing there, and the ring is not seen to
/// keep to its code while what hides the border has another tone. `outer` are the deviations near the ring's outer edge.
std::vector<bool> hidden_with_border(const std::vector<double>& border, const std::vector<double>& outer) {
  constexpr double kMissing = 0.6;  // of what the border is like elsewhere
  std::vector<bool> hidden(border.size(), false);
  std::vector<double> seen;
  for (const double value : border) {
    if (std::isfinite(value)) seen.push_back(value);
  }
  if (seen.size() < border.size() / 2) return hidden;
  const double usual = quantile(seen, 0.7);
  for (std::size_t k = 0; k < border.size(); ++k) {
    hidden[k] = std::isfinite(border[k]) && border[k] < kMissing * usual && (border[k] < kTold || outer[k] > 0.5 * border[k]);
  }
  return hidden;
}

/// The same without a border: ring and quiet zone are bright alike, more than dirt makes them.
std::vector<bool> hidden_without_border(const std::vector<double>& quiet, const std::vector<double>& outer) {
  constexpr double kDirt = 0.2;  // of the contrast
  std::vector<bool> hidden(quiet.size(), false);
  for (std::size_t k = 0; k < quiet.size(); ++k) hidden[k] = outer[k] > kDirt && quiet[k] > std::max(kDirt, 0.5 * outer[k]);
  return hidden;
}

/// Deviations in the quiet zone; NaN where the blur spreads much of the ring into it, since that is not known well enough.
std::vector<double> quiet_deviations(const MarkerFamily& family, const Levels& levels, const RingImage& expected) {
  constexpr double kBlurred = 0.08;  // of a 1
  const double rho = 0.5 * (family.ring_outer + family.disc_outer);
  std::vector<double> quiet = deviations(levels.quiet(), expected, rho);
  for (std::size_t k = 0; k < quiet.size(); ++k) {
    if (expected.share(k, rho, family.ring_inner, family.ring_outer) > kBlurred) quiet[k] = kOutside;
  }
  return quiet;
}

std::vector<bool> hidden_directions(const MarkerFamily& family, const Levels& levels, const RingImage& expected,
                                    const std::vector<double>& outer) {
  constexpr double kFaintest = 0.3;  // of a border that the blur leaves enough of
  if (family.border_outer > family.disc_outer) {
    const double rho = 0.5 * (family.disc_outer + family.border_outer);
    std::vector<double> border = smoothed(levels.at(rho), 2, kOutside);
    for (std::size_t k = 0; k < border.size(); ++k) {
      const double left = expected.share(k, rho, family.disc_outer, family.border_outer);
      border[k] = left > kFaintest ? border[k] / left : kOutside;
    }
    return hidden_with_border(border, outer);
  }
  return hidden_without_border(smoothed(quiet_deviations(family, levels, expected), 2, kOutside), outer);
}

/// Directions in which something reaches over the gap too: the ring's values count from the gap's level and say nothing there.
std::vector<bool> covered_gap(const MarkerFamily& family, const Levels& levels, const RingImage& expected) {
  const std::vector<double> gap = deviations(smoothed(levels.gap(), 2, kOutside), expected, 0.5 * (1.0 + family.ring_inner));
  std::vector<double> seen;
  for (const double value : gap) {
    if (std::isfinite(value)) seen.push_back(value);
  }
  constexpr double kCovered = 0.2;  // of the contrast; the ring's light and the dot's leave less
  std::vector<bool> covered(gap.size(), false);
  if (seen.empty()) return covered;
  const double usual = quantile(seen, 0.4);
  for (std::size_t k = 0; k < gap.size(); ++k) covered[k] = gap[k] - usual > kCovered;
  return covered;
}

/// Whether a part of the width of a segment shows what its code cannot: a 0 that is hidden, or a 1 beyond which the quiet zone is
/// as bright as itself. `quiet` are the deviations there, `means` the segments' own.
bool has_hidden_segment(const Grid& grid, const std::vector<bool>& hidden, const std::vector<double>& quiet,
                        const std::vector<double>& means) {
  constexpr double kPart = 0.25;  // of a segment's width
  constexpr double kQuiet = 0.5;  // of a 1
  std::vector<int> counts(static_cast<std::size_t>(grid.bits), 0);
  for (std::size_t k = 0; k < hidden.size(); ++k) {
    const auto segment = static_cast<std::size_t>(grid.place(k)) % counts.size();
    const bool one = grid.bit(static_cast<int>(segment)) > 0.5;
    if (one ? quiet[k] > kQuiet * means[segment] : hidden[k]) ++counts[segment];
  }
  return std::any_of(counts.begin(), counts.end(), [](int count) { return count > kPart * kSamplesPerSegment; });
}

}  // namespace

RingReading read_ring(const Sampler& image, const MarkerFamily& family, const DotFit& dot) {
  RingReading reading;
  const int count = family.bits * kSamplesPerSegment;
  const Sweep sweep(image, dot, count);
  const Levels levels(sweep, family, dot);
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
  const auto [phase, quality] = grid_phase(ring, family.bits);
  reading.grid_quality = quality;
  const std::vector<double> means = segment_means(ring, family.bits, phase);
  classify(means, reading);

  const Grid grid{family.bits, phase, reading.ring};
  const RingImage expected(grid, family, dot, sweep, means);
  for (std::size_t i = 0; i < rings.size(); ++i) rings[i] = deviations(rings[i], expected, rhos[i]);
  const std::span<const std::vector<double>> halves(rings);
  constexpr std::size_t kHalf = (kRadii + 1) / 2;
  reading.misfit = std::max(largest_misfit(grid, halves.first(kHalf)), largest_misfit(grid, halves.last(kHalf)));
  std::vector<bool> hidden = hidden_directions(family, levels, expected, smoothed(rings.back(), 2, 0.0));
  const std::vector<bool> covered = covered_gap(family, levels, expected);
  for (std::size_t k = 0; k < hidden.size(); ++k) hidden[k] = hidden[k] || covered[k];
  reading.hidden = has_hidden_segment(grid, hidden, quiet_deviations(family, levels, expected), means);
  reading.profile = std::move(ring);
  return reading;
}

}  // namespace crosstie::markers::detail
