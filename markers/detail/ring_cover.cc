#include "markers/detail/ring_cover.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <span>

#include "math/edge_profile.h"

namespace crosstie::markers::detail {
namespace {

constexpr int kBeside = 1;  // neighbours on either side that single samples are smoothed over

double quantile(std::vector<double> values, double share) {
  const auto place = values.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), place, values.end());
  return *place;
}

/// What the ring that was read would look like through the blur: along a radius and round the circle one after the other.
class RingImage {
 public:
  RingImage(const RingGrid& grid, const MarkerFamily& family, const DotFit& dot, const RingSweep& sweep,
            const std::vector<double>& means)
      : grid_(grid), family_(family) {
    constexpr double kInterpolationVariance = 1.0 / 6.0;  // of bilinear sampling, px^2
    per_blur_ = 1.0 / std::sqrt(dot.blur_px * dot.blur_px + kInterpolationVariance);
    set_brightness(means);
    const double a = dot.ellipse.semi_major_px;
    const double b = dot.ellipse.semi_minor_px;
    const double per_segment = a * b * 2.0 * std::numbers::pi / grid.bits() * per_blur_;
    directions_.reserve(sweep.count());
    for (std::size_t k = 0; k < sweep.count(); ++k) {
      const Eigen::Vector2d& unit = sweep.unit(k);
      const double across = per_blur_ / std::sqrt(std::pow(unit.x() / a, 2) + std::pow(unit.y() / b, 2));
      const double place = grid.place(k);
      const int segment = static_cast<int>(place);
      directions_.push_back({across, per_segment / sweep.direction(k).norm(), place - segment, grid.bit(segment),
                             grid.bit(segment - 1), grid.bit(segment + 1),
                             std::max(brightness_[static_cast<std::size_t>(segment % grid.bits())], 0.0)});
    }
  }

  /// Value at `rho` in direction `k`.
  [[nodiscard]] double at(std::size_t k, double rho) const {
    const Direction& d = directions_[k];
    double set = d.bit;
    const double blurs = d.along * rho;
    if (d.before != d.bit) set += (d.before - d.bit) * math::edge_distribution(-d.inside * blurs);
    if (d.after != d.bit) set += (d.after - d.bit) * math::edge_distribution((d.inside - 1.0) * blurs);
    return set == 0.0 ? zeros_ : zeros_ + (d.bright - zeros_) * set * share(k, rho, family_.ring_inner, family_.ring_outer);
  }

  /// Of the segment in direction `k`: the dot's, or more where it lies in brighter light than the dot.
  [[nodiscard]] double light(std::size_t k) const { return std::max(directions_[k].bright, 1.0); }

  /// What the blur leaves of a circle from `inner` to `outer` at `rho`.
  [[nodiscard]] double share(std::size_t k, double rho, double inner, double outer) const {
    const double across = directions_[k].across;
    return math::edge_distribution((rho - inner) * across) - math::edge_distribution((rho - outer) * across);
  }

 private:
  /// What stays the same along a radius.
  struct Direction {
    double across;              ///< blurs for each dot radius, across the ring
    double along;               ///< the same for each segment along it, at rho = 1
    double inside;              ///< place within its segment
    double bit, before, after;  ///< this segment, and those beside it
    double bright;              ///< of the segment
  };

  /// A whole segment is as bright as it is, light and print differ; what the blur spreads into a 0 comes from the nearest ones.
  void set_brightness(const std::vector<double>& means) {
    std::vector<double> all_ones, all_zeros;
    for (int s = 0; s < grid_.bits(); ++s) {
      (grid_.bit(s) > 0.5 ? all_ones : all_zeros).push_back(means[static_cast<std::size_t>(s)]);
    }
    // The darker ones of the zeros: what lies over some of them is brighter or hidden by being alike.
    zeros_ = all_zeros.empty() ? 0.0 : quantile(all_zeros, 0.25);
    const double ones = all_ones.empty() ? 1.0 : quantile(all_ones, 0.5);
    for (int s = 0; s < grid_.bits(); ++s) {
      const double before = means[static_cast<std::size_t>((s + grid_.bits() - 1) % grid_.bits())];
      const double after = means[static_cast<std::size_t>((s + 1) % grid_.bits())];
      double value = means[static_cast<std::size_t>(s)];
      if (grid_.bit(s) < 0.5) {
        const double n = grid_.bit(s - 1) + grid_.bit(s + 1);
        value = n > 0.0 ? (grid_.bit(s - 1) * before + grid_.bit(s + 1) * after) / n : ones;
      }
      brightness_.push_back(value);
    }
  }

  const RingGrid& grid_;
  const MarkerFamily& family_;
  double per_blur_ = 0.0;
  double zeros_ = 0.0;
  std::vector<double> brightness_;
  std::vector<Direction> directions_;
};

/// Values of all directions at a radius minus those of the image of the code.
std::vector<double> deviations(const std::vector<double>& values, const RingImage& image, double rho) {
  std::vector<double> result(values.size());
  for (std::size_t k = 0; k < values.size(); ++k) result[k] = values[k] - image.at(k, rho);
  return result;
}

/// Largest mean deviation over the thirds of segments of one half of the ring, in that segment's own light; `rings` are the
/// deviations at its radii. The edge of a shadow that crosses a segment is no other thing over it.
double largest_misfit(const RingGrid& grid, const RingImage& expected, std::span<const std::vector<double>> rings) {
  constexpr int kThirds = 3;
  const auto parts = static_cast<std::size_t>(grid.bits() * kThirds);
  std::vector<double> sums(parts, 0.0), counts(parts, 0.0);
  for (const std::vector<double>& ring : rings) {
    for (std::size_t k = 0; k < ring.size(); ++k) {
      const auto part = static_cast<std::size_t>(grid.place(k) * kThirds) % parts;
      sums[part] += ring[k] / expected.light(k);
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
std::vector<double> quiet_deviations(const MarkerFamily& family, const RingLevels& levels, const RingImage& expected) {
  constexpr double kBlurred = 0.08;  // of a 1
  const double rho = 0.5 * (family.ring_outer + family.disc_outer);
  std::vector<double> quiet = deviations(levels.quiet(), expected, rho);
  for (std::size_t k = 0; k < quiet.size(); ++k) {
    if (expected.share(k, rho, family.ring_inner, family.ring_outer) > kBlurred) quiet[k] = kOutside;
  }
  return quiet;
}

std::vector<bool> hidden_directions(const MarkerFamily& family, const RingLevels& levels, const RingImage& expected,
                                    const std::vector<double>& quiet, const std::vector<double>& outer) {
  constexpr double kFaintest = 0.3;  // of a border that the blur leaves enough of
  if (family.border_outer > family.disc_outer) {
    const double rho = 0.5 * (family.disc_outer + family.border_outer);
    std::vector<double> border = smoothed(levels.at(rho), kBeside, kOutside);
    for (std::size_t k = 0; k < border.size(); ++k) {
      const double left = expected.share(k, rho, family.disc_outer, family.border_outer);
      border[k] = left > kFaintest ? border[k] / left : kOutside;
    }
    return hidden_with_border(border, outer);
  }
  return hidden_without_border(smoothed(quiet, kBeside, kOutside), outer);
}

/// Directions in which something reaches over the gap too: the ring's values count from the gap's level and say nothing there.
std::vector<bool> covered_gap(const MarkerFamily& family, const RingLevels& levels, const RingImage& expected) {
  const std::vector<double> gap =
      deviations(smoothed(levels.gap(), kBeside, kOutside), expected, 0.5 * (1.0 + family.ring_inner));
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
bool has_hidden_segment(const RingGrid& grid, const std::vector<bool>& hidden, const std::vector<double>& quiet,
                        const std::vector<double>& means) {
  constexpr double kPart = 0.25;  // of a segment's width
  constexpr double kQuiet = 0.5;  // of a 1
  std::vector<int> counts(static_cast<std::size_t>(grid.bits()), 0);
  for (std::size_t k = 0; k < hidden.size(); ++k) {
    const auto segment = static_cast<std::size_t>(grid.place(k)) % counts.size();
    const bool one = grid.bit(static_cast<int>(segment)) > 0.5;
    if (one ? quiet[k] > kQuiet * means[segment] : hidden[k]) ++counts[segment];
  }
  return std::any_of(counts.begin(), counts.end(), [](int count) { return count > kPart * kSamplesPerSegment; });
}

}  // namespace

RingGrid::RingGrid(int bits, double phase, std::uint64_t ring) : phase_(phase) {
  for (int s = bits - 1; s >= 0; --s) set_.push_back(static_cast<double>(ring >> s & 1U));
}

RingCover look_for_cover(const MarkerFamily& family, const DotFit& dot, const RingSweep& sweep, const RingLevels& levels,
                         const RingGrid& grid, const std::vector<double>& means, const std::vector<double>& rhos,
                         std::vector<std::vector<double>> rings) {
  const RingImage expected(grid, family, dot, sweep, means);
  for (std::size_t i = 0; i < rings.size(); ++i) rings[i] = deviations(rings[i], expected, rhos[i]);
  const std::span<const std::vector<double>> halves(rings);
  const std::size_t half = (rings.size() + 1) / 2;
  RingCover cover;
  cover.misfit =
      std::max(largest_misfit(grid, expected, halves.first(half)), largest_misfit(grid, expected, halves.last(half)));
  const std::vector<double> quiet = quiet_deviations(family, levels, expected);
  std::vector<bool> hidden = hidden_directions(family, levels, expected, quiet, smoothed(rings.back(), kBeside, 0.0));
  const std::vector<bool> covered = covered_gap(family, levels, expected);
  for (std::size_t k = 0; k < hidden.size(); ++k) hidden[k] = hidden[k] || covered[k];
  cover.hidden = has_hidden_segment(grid, hidden, quiet, means);
  return cover;
}

}  // namespace crosstie::markers::detail
