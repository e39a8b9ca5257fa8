#include "markers/detail/marker.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "markers/detail/quick_look.h"
#include "markers/detail/whole_fit.h"

namespace crosstie::markers::detail {
namespace {

using base::ObservationStatus;

// What a dot must be like. Measured on photographs (glare, carbon weave, print, JPEG) and on blurred renderings.
constexpr double kMaxResidual = 0.12;     // RMS of the fit's residuals over the contrast
constexpr double kMaxOutliers = 0.35;     // share of the edge that may be hidden
constexpr double kMaxBlur = 0.6;          // over the semi-minor axis
constexpr double kMaxDeviation = 0.03;    // amplitude of the harmonics 3..5 over the semi-minor axis,
constexpr double kMaxDeviationPx = 0.08;  // in addition
constexpr double kSharp = 0.12;    // blur over the semi-minor axis, up to which nothing is gained from the gap's outer part
constexpr double kBlurred = 0.15;  // the same from which on the ring's light matters much
constexpr double kMixed = 0.19;    // the same, or over the gap where that is narrower, for dot and ring to be fitted together
constexpr double kMuchBlurred = 0.35;  // blur over the semi-minor axis from which on something close by is not told from a ring
// What a ring must be like.
constexpr double kMaxBrightGap = 0.10;    // of the gap's circumference
constexpr double kMaxBrightQuiet = 0.25;  // of the quiet zone's circumference
constexpr double kPlainRange = 0.35;      // of the contrast: below it there is no ring
constexpr double kMinGridQuality = 0.25;
constexpr double kMinRingContrast = 0.4;
constexpr double kMaxMisfit = 0.4;         // of the contrast
constexpr double kMaxSegmentMisfit = 0.2;  // the same of whole segments
constexpr double kMinSegmentPx = 2.5;      // smallest width of a segment that is read,
constexpr double kRoughly = 0.9;           // of it before ring and dot were fitted together

bool is_dot(const DotFit& fit, const Candidate& candidate, const ImageView& image, const DetectOptions& options) {
  const double contrast = fit.inner_level - fit.outer_level;
  const double a = fit.ellipse.semi_major_px;
  const double b = fit.ellipse.semi_minor_px;
  const double max_radius_px = options.max_radius_px > 0.0 ? options.max_radius_px : 0.25 * std::min(image.width, image.height);
  return (contrast > 0.0) == candidate.bright && std::abs(contrast) >= options.min_contrast * image.white_level &&
         b >= options.min_radius_px && a <= max_radius_px && b >= options.min_axis_ratio * a &&
         fit.residual <= kMaxResidual * std::abs(contrast) && fit.outlier_fraction <= kMaxOutliers &&
         fit.blur_px <= kMaxBlur * b && fit.deviation_px <= kMaxDeviation * b + kMaxDeviationPx;
}

/// Width of a segment where tilt shortens it most: along the ring in the middle of its width, or across.
double narrowest_segment_px(const MarkerFamily& family, const DotFit& dot) {
  const double along = std::numbers::pi * (family.ring_inner + family.ring_outer) / family.bits;
  return std::min(along, family.ring_outer - family.ring_inner) * dot.ellipse.semi_minor_px;
}

void judge_ring(const MarkerFamily& family, const DetectOptions& options, double min_segment_px, Marker& marker) {
  const RingReading& ring = marker.ring;
  marker.id = base::kNoId;
  if (ring.cut) {
    marker.status = ObservationStatus::kUnreadable;
    return;
  }
  if (ring.range < kPlainRange || ring.grid_quality < kMinGridQuality || ring.contrast < kMinRingContrast) {
    const bool told = marker.dot.blur_px < kMuchBlurred * marker.dot.ellipse.semi_minor_px;
    marker.status = told ? ObservationStatus::kUncoded : ObservationStatus::kUnreadable;
    marker.ring.margin = 0.0;
    return;
  }
  const std::optional<int> id = family.id_of_ring(ring.ring);
  if (!id || narrowest_segment_px(family, marker.dot) < min_segment_px) {
    marker.status = ObservationStatus::kUnreadable;
    return;
  }
  marker.id = *id;
  if (ring.margin < options.min_margin || ring.bright_quiet > kMaxBrightQuiet || ring.misfit > kMaxMisfit ||
      ring.segment_misfit > kMaxSegmentMisfit || ring.hidden) {
    marker.status = ObservationStatus::kAmbiguous;
  } else if (!options.ids.empty() && std::find(options.ids.begin(), options.ids.end(), *id) == options.ids.end()) {
    marker.status = ObservationStatus::kRefused;
  } else {
    marker.status = ObservationStatus::kCoded;
  }
}

bool read_in_full(const Marker& marker) {
  return marker.status == ObservationStatus::kCoded || marker.status == ObservationStatus::kRefused;
}

/// Better findings first: read ones by their margin, then the others by how well an ellipse fits.
bool better(const Marker& a, const Marker& b) {
  const auto rank = [](const Marker& m) {
    switch (m.status) {
      case ObservationStatus::kCoded:
      case ObservationStatus::kRefused:
        return 0;
      case ObservationStatus::kAmbiguous:
        return 1;
      default:
        return 2;
    }
  };
  if (rank(a) != rank(b)) return rank(a) < rank(b);
  const auto misfit = [](const Marker& m) { return m.dot.residual / std::abs(m.dot.inner_level - m.dot.outer_level); };
  return misfit(a) < misfit(b);
}

}  // namespace

std::optional<Marker> measure_marker(const Sampler& image, const Candidate& candidate, const MarkerFamily& family,
                                     const DetectOptions& options) {
  const double white_level = image.image().white_level;
  DotFitOptions fit_options{.gap_outer = family.ring_inner,
                            .saturated_level = options.saturated_level * white_level,
                            .min_contrast = options.min_contrast * white_level,
                            .min_radius_px = options.min_radius_px,
                            .start_error_px = candidate.scale};
  const std::optional<DotFit> fit = fit_dot(image, candidate.ellipse, fit_options);
  if (!fit || !is_dot(*fit, candidate, image.image(), options)) return std::nullopt;
  Marker marker;
  marker.dot = *fit;
  if (stands_alone(image, fit->ellipse, fit->inner_level, fit->outer_level, family)) {
    if (fit->blur_px < kSharp * fit->ellipse.semi_minor_px) return marker;
    fit_options.alone = true;
    const std::optional<DotFit> refined = refine_dot(image, *fit, fit_options);
    if (refined && is_dot(*refined, candidate, image.image(), options)) marker.dot = *refined;
    return marker;
  }
  marker.ring = read_ring(image, family, *fit);
  if (marker.ring.bright_gap > kMaxBrightGap) return std::nullopt;
  judge_ring(family, options, kRoughly * kMinSegmentPx, marker);
  if (marker.status == ObservationStatus::kUncoded || marker.ring.cut) return marker;
  const auto take = [&](const std::optional<DotFit>& refined) {
    const bool taken = refined && is_dot(*refined, candidate, image.image(), options);
    if (taken) marker.dot = *refined;
    return taken;
  };
  const ReadRing ring{fit->ellipse, marker.ring.first_rad, marker.ring.ring};
  bool together = false;
  const double gap_px = std::min(family.ring_inner - 1.0, 1.0) * fit->ellipse.semi_minor_px;
  if (read_in_full(marker) && fit->blur_px > kMixed * gap_px) {
    const std::optional<WholeFit> whole = fit_whole_marker(image, *fit, ring, family, fit_options);
    if (whole) marker.ring.segment_misfit = whole->misfit;
    together = whole && whole->misfit <= kMaxSegmentMisfit && take(whole->dot);
  }
  if (!together) {
    // Where the blur is large, the dot is known well enough to take the ring's light off only after that was done once.
    const int passes = fit->blur_px < kBlurred * fit->ellipse.semi_minor_px ? 1 : 3;
    for (int pass = 0; pass < passes; ++pass) {
      const std::optional<RingLight> light = RingLight::of(image, marker.dot, family, fit_options.saturated_level);
      fit_options.ring = light ? &*light : nullptr;
      if (!light || !take(refine_dot(image, marker.dot, fit_options))) break;
    }
  }
  judge_ring(family, options, kMinSegmentPx, marker);  // the sizes that it asks for are known better now
  return marker;
}

void remove_duplicates(std::vector<Marker>& markers, const MarkerFamily& family) {
  std::sort(markers.begin(), markers.end(), better);
  std::vector<Marker> kept;
  for (const Marker& marker : markers) {
    const bool known = std::any_of(kept.begin(), kept.end(), [&](const Marker& other) {
      const Eigen::Vector2d e = marker.dot.ellipse.centre_px - other.dot.ellipse.centre_px;
      if (e.cwiseAbs().maxCoeff() > family.ring_outer * other.dot.ellipse.semi_major_px) return false;
      const double rho = std::sqrt(e.dot(other.dot.ellipse.shape() * e));
      return rho < (read_in_full(other) ? family.ring_outer : 0.7);
    });
    if (!known) kept.push_back(marker);
  }
  markers = std::move(kept);
}

void scale_covariances(std::vector<Marker>& markers) {
  constexpr double kMedianOfPower = 0.891;  // of chi-square with 6 degrees of freedom, over 6
  constexpr double kImageDof = 24.0;        // how much the image's median counts against the dot's own 6
  constexpr std::size_t kEnough = 5;
  double image_power = 1.0;
  if (markers.size() >= kEnough) {
    std::vector<double> powers;
    for (const Marker& marker : markers) powers.push_back(marker.dot.harmonic_power);
    const auto middle = powers.begin() + static_cast<std::ptrdiff_t>(powers.size() / 2);
    std::nth_element(powers.begin(), middle, powers.end());
    image_power = std::max(1.0, *middle / kMedianOfPower);
  }
  for (Marker& marker : markers) {
    const double power = (kImageDof * image_power + kHarmonicDof * marker.dot.harmonic_power) / (kImageDof + kHarmonicDof);
    marker.cov_px2 = std::max(1.0, power) * marker.dot.cov_px2;
  }
}

}  // namespace crosstie::markers::detail
