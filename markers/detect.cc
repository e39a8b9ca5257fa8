#include "markers/detect.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <tuple>
#include <utility>

#include <fmt/format.h>
#include <opencv2/core.hpp>

#include "markers/detail/candidates.h"
#include "markers/detail/exposure.h"
#include "markers/detail/marker.h"
#include "markers/detail/quick_look.h"
#include "markers/detection.h"
#include "markers/tags.h"

namespace crosstie::markers {
namespace {

using base::ErrorCode;
using base::fail;

base::Observation observation_of(const detail::Marker& marker) {
  base::Observation observation;
  observation.id = marker.id;
  observation.centre_px = marker.dot.ellipse.centre_px;
  observation.cov_px2 = marker.cov_px2;
  observation.semi_major_px = marker.dot.ellipse.semi_major_px;
  observation.semi_minor_px = marker.dot.ellipse.semi_minor_px;
  observation.angle_rad = marker.dot.ellipse.angle_rad;
  observation.margin = marker.ring.margin;
  observation.status = marker.status;
  return observation;
}

/// A tag's centre is the image of its centre already: it has no ellipse to reduce from.
Result<std::vector<base::Observation>> observed_tags(const ImageView& image, const MarkerFamily& family,
                                                     const DetectOptions& options, const Progress& progress) {
  auto tags = detect_tags(image, family, options, progress);
  if (!tags) return fail(std::move(tags));
  std::vector<base::Observation> observations;
  for (const TagObservation& tag : *tags) {
    observations.push_back(
        {.id = tag.id, .centre_px = tag.centre_px, .cov_px2 = tag.cov_px2, .margin = tag.margin, .status = tag.status});
  }
  return observations;
}

/// Whether the candidate is a dot that was measured already, or a segment of a ring that was read.
bool explained(const detail::Candidate& candidate, const std::vector<detail::Marker>& markers, const MarkerFamily& family) {
  return std::any_of(markers.begin(), markers.end(), [&](const detail::Marker& marker) {
    const detail::Ellipse& dot = marker.dot.ellipse;
    const Eigen::Vector2d e = candidate.ellipse.centre_px - dot.centre_px;
    if (e.cwiseAbs().maxCoeff() > family.ring_outer * dot.semi_major_px) return false;
    const bool read = marker.status == base::ObservationStatus::kCoded || marker.status == base::ObservationStatus::kRefused;
    if (read) return e.dot(dot.shape() * e) < family.ring_outer * family.ring_outer;
    constexpr double kSameSize = 1.4;  // what is concentric but larger or smaller is something else
    const double ratio = candidate.ellipse.semi_minor_px / dot.semi_minor_px;
    return e.dot(dot.shape() * e) < 0.25 && ratio < kSameSize && ratio > 1.0 / kSameSize;
  });
}

bool before(const base::Observation& a, const base::Observation& b) {
  return std::make_tuple(static_cast<int>(a.status), a.id, a.centre_px.y(), a.centre_px.x()) <
         std::make_tuple(static_cast<int>(b.status), b.id, b.centre_px.y(), b.centre_px.x());
}

}  // namespace

Result<> DetectOptions::validate() const {
  const auto wrong = [](std::string_view field, double value, std::string_view domain) {
    return fail(ErrorCode::kUsage, fmt::format("option {} is {}, but must be {}", field, value, domain));
  };
  if (!(min_radius_px >= 1.5)) return wrong("min_radius_px", min_radius_px, "at least 1.5");
  if (!(max_radius_px == 0.0 || max_radius_px > min_radius_px)) {
    return wrong("max_radius_px", max_radius_px, "0 or larger than min_radius_px");
  }
  if (!(min_axis_ratio > 0.0 && min_axis_ratio <= 1.0)) return wrong("min_axis_ratio", min_axis_ratio, "in (0, 1]");
  if (!(min_margin >= 0.0 && min_margin < 1.0)) return wrong("min_margin", min_margin, "in [0, 1)");
  if (!(min_contrast > 0.0 && min_contrast < 1.0)) return wrong("min_contrast", min_contrast, "in (0, 1)");
  if (!(saturated_level > 0.5 && saturated_level <= 1.0)) return wrong("saturated_level", saturated_level, "in (0.5, 1]");
  if (!(dark_level >= 0.0 && dark_level < 0.5)) return wrong("dark_level", dark_level, "in [0, 0.5)");
  return {};
}

Result<> check_image(const ImageView& image) {
  if (image.data == nullptr || image.width < 8 || image.height < 8 || (image.bits != 8 && image.bits != 16) ||
      !(image.white_level > 0.0)) {
    return fail(ErrorCode::kBadInput,
                fmt::format("an image of {} x {} pixels of {} bits holds no markers", image.width, image.height, image.bits));
  }
  return {};
}

Result<ImageObservations> detect(const ImageView& image, const MarkerFamily& family, const DetectOptions& options,
                                 const Progress& progress) {
  auto detection = detect_in_detail(image, family, options, progress);
  if (!detection) return fail(std::move(detection));
  return std::move(detection->observations);
}

Result<Detection> detect_in_detail(const ImageView& image, const MarkerFamily& family, const DetectOptions& options,
                                   const Progress& progress) {
  const auto start = std::chrono::steady_clock::now();
  if (auto valid = options.validate(); !valid) return fail(std::move(valid));
  if (auto valid = check_image(image); !valid) return fail(std::move(valid));
  Detection detection;
  ImageObservations& result = detection.observations;
  result.family = family.name;
  result.width_px = image.width;
  result.height_px = image.height;
  std::vector<detail::Candidate> candidates;
  try {
    const detail::Exposure exposure = detail::measure_exposure(image, options.saturated_level, options.dark_level);
    result.saturated_fraction = exposure.saturated_fraction;
    result.dark_fraction = exposure.dark_fraction;
    if (!family.tag) candidates = detail::find_candidates(image, options);
  } catch (const cv::Exception& error) {
    if (error.code == cv::Error::StsNoMem) return fail(ErrorCode::kFileSystem, "not enough memory");
    return fail(ErrorCode::kInternal, fmt::format("OpenCV failed while looking for dots: {}", error.what()));
  }

  if (family.tag) {
    auto tags = observed_tags(image, family, options, progress);
    if (!tags) return fail(std::move(tags));
    result.observations = std::move(*tags);
    detection.blur_px.assign(result.observations.size(), 0.0);
    result.millis = std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
    return detection;
  }

  const detail::Sampler sampler(image);
  std::vector<detail::Marker> markers;
  for (std::size_t i = 0; i < candidates.size(); ++i) {
    if (progress.cancelled()) return base::cancelled("detection of markers");
    progress("detect", i, candidates.size());
    if (explained(candidates[i], markers, family) ||
        !detail::looks_like_dot(sampler, candidates[i], family.ring_inner, options.min_contrast * image.white_level)) {
      continue;
    }
    if (auto marker = detail::measure_marker(sampler, candidates[i], family, options)) markers.push_back(*marker);
  }
  progress("detect", candidates.size(), candidates.size());
  detail::remove_duplicates(markers, family);
  detail::scale_covariances(markers);

  std::vector<std::pair<base::Observation, double>> found;  // with the blur
  found.reserve(markers.size());
  for (const detail::Marker& marker : markers) found.emplace_back(observation_of(marker), marker.dot.blur_px);
  std::sort(found.begin(), found.end(), [](const auto& a, const auto& b) { return before(a.first, b.first); });
  for (const auto& [observation, blur_px] : found) {
    result.observations.push_back(observation);
    detection.blur_px.push_back(blur_px);
  }
  result.millis = std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
  return detection;
}

}  // namespace crosstie::markers
