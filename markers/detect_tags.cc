#include <algorithm>
#include <cmath>
#include <exception>
#include <tuple>

#include <fmt/format.h>

#include "markers/detail/apriltag_library.h"
#include "markers/detail/tag_cells.h"
#include "markers/detail/tag_edges.h"
#include "markers/tags.h"

namespace crosstie::markers {
namespace {

using base::ErrorCode;
using base::ObservationStatus;

constexpr double kMinCellPx = 3.0;
constexpr double kMinBorderMargin = 0.2;  // of the worst cell of the border's two rings: below, something lies over it
// What other things that looked like a tag are like: noise in flat places makes squares of a few pixels.
constexpr double kNotATag = -0.5;  // margin
constexpr double kNoCellPx = 2.0;

struct Measured {
  TagObservation tag;
  double power = 1.0;  // of the edges' deviations
};

/// A candidate with the corners that the library found, as long as nothing better is known.
TagObservation rough(const detail::TagCandidate& candidate) {
  TagObservation tag;
  tag.corners_px = candidate.corners_px;
  tag.centre_px = detail::meeting_of_diagonals(candidate.corners_px);
  tag.inverted = candidate.inverted;
  tag.mirrored = candidate.mirrored;
  tag.cov_px2 = Eigen::Matrix2d::Identity();  // the library's corners are good to about a pixel
  tag.corners_cov_px2.setIdentity();
  return tag;
}

/// The same cells with left and right exchanged, as a mirrored tag shows them.
TagLayout mirrored_layout(TagLayout layout) {
  for (int y = 0; y < layout.total_cells; ++y) {
    const auto row = layout.cells.begin() + y * layout.total_cells;
    std::reverse(row, row + layout.total_cells);
  }
  return layout;
}

ObservationStatus judged(const TagObservation& tag, const detail::TagReading& reading, int id, const DetectOptions& options) {
  if (reading.cut || reading.border_margin < kMinBorderMargin || tag.cell_px < kMinCellPx)
    return ObservationStatus::kUnreadable;
  if (reading.margin < options.min_margin) return ObservationStatus::kAmbiguous;
  const bool in_use = options.ids.empty() || std::find(options.ids.begin(), options.ids.end(), id) != options.ids.end();
  return in_use && !tag.mirrored ? ObservationStatus::kCoded : ObservationStatus::kRefused;
}

/// The library turns mirrored layouts the wrong way round: by half a turn where the tag lies on its side. Which of both it is
/// shows in the cells.
void turn_upright(const detail::Sampler& image, const detail::TagPattern& pattern, detail::Corners& corners_px) {
  const detail::Corners turned = {corners_px[2], corners_px[3], corners_px[0], corners_px[1]};
  const auto margin = [&](const detail::Corners& corners) {
    return detail::read_cells(image, pattern, detail::TagFrame(pattern.layout, corners)).margin;
  };
  if (margin(turned) > margin(corners_px)) corners_px = turned;
}

/// Nothing where the candidate is no tag.
std::optional<Measured> measured(const detail::Sampler& image, detail::TagCandidate candidate, const MarkerFamily& family,
                                 const DetectOptions& options) {
  if (!detail::is_proper(candidate.corners_px)) return std::nullopt;
  const double white_level = image.image().white_level;
  const TagLayout layout = candidate.mirrored ? mirrored_layout(*family.tag) : *family.tag;
  const detail::TagPattern pattern{layout, *family.code_of(candidate.id), family.bits, candidate.inverted};
  if (candidate.mirrored) turn_upright(image, pattern, candidate.corners_px);
  Measured result{rough(candidate), 1.0};
  TagObservation& tag = result.tag;
  const auto edges = detail::fit_tag_edges(
      image, pattern, candidate.corners_px,
      {.saturated_level = options.saturated_level * white_level, .min_contrast = options.min_contrast * white_level});
  if (edges) {
    tag.corners_px = edges->corners_px;
    tag.corners_cov_px2 = edges->corners_cov_px2;
    tag.centre_px = detail::meeting_of_diagonals(edges->corners_px);
    tag.cov_px2 = edges->centre_cov_px2;
    result.power = edges->deviation_power;
  }
  const detail::TagFrame frame(layout, tag.corners_px);
  tag.cell_px = frame.narrowest_cell_px(layout);
  const detail::TagReading reading = detail::read_cells(image, pattern, frame);
  if (tag.cell_px < kNoCellPx || (!reading.cut && (reading.margin < kNotATag || reading.border_margin < kNotATag ||
                                                   reading.contrast < options.min_contrast * white_level))) {
    return std::nullopt;
  }
  tag.margin = std::clamp(reading.margin, 0.0, 1.0);
  if (edges) tag.status = judged(tag, reading, candidate.id, options);
  if (tag.status != ObservationStatus::kUnreadable) tag.id = candidate.id;
  return result;
}

/// How well a finding deserves to stay where several lie on the same place.
bool better(const Measured& a, const Measured& b) {
  const auto rank = [](const Measured& m) {
    return std::make_tuple(m.tag.status == ObservationStatus::kUnreadable, m.tag.mirrored, -m.tag.margin, m.tag.id,
                           m.tag.inverted);
  };
  return rank(a) < rank(b);
}

/// Whether the centre of `one` lies on `other`: tags lie beside each other, but their cells look like squares too.
bool lies_on(const TagObservation& one, const TagObservation& other, const TagLayout& layout) {
  const Eigen::Vector2d cell = detail::TagFrame(layout, other.corners_px).cell(one.centre_px);
  return cell.minCoeff() > 0.0 && cell.maxCoeff() < layout.total_cells;
}

void remove_duplicates(std::vector<Measured>& tags, const TagLayout& layout) {
  std::sort(tags.begin(), tags.end(), better);
  std::vector<Measured> kept;
  for (const Measured& one : tags) {
    const bool known =
        std::any_of(kept.begin(), kept.end(), [&](const Measured& other) { return lies_on(one.tag, other.tag, layout); });
    if (!known) kept.push_back(one);
  }
  tags = std::move(kept);
}

/// As for dots: a tag tells the power of its edges' deviations with 8 degrees of freedom, the image's median with more.
void scale_covariances(std::vector<Measured>& tags) {
  constexpr double kMedianOfPower = 0.918;  // of chi-square with 8 degrees of freedom, over 8
  constexpr double kImageDof = 24.0;
  constexpr std::size_t kEnough = 5;
  double image_power = 1.0;
  if (tags.size() >= kEnough) {
    std::vector<double> powers;
    for (const Measured& one : tags) powers.push_back(one.power);
    const auto middle = powers.begin() + static_cast<std::ptrdiff_t>(powers.size() / 2);
    std::nth_element(powers.begin(), middle, powers.end());
    image_power = std::max(1.0, *middle / kMedianOfPower);
  }
  for (Measured& one : tags) {
    const double power = std::max(
        1.0, (kImageDof * image_power + detail::kTagDeviationDof * one.power) / (kImageDof + detail::kTagDeviationDof));
    one.tag.cov_px2 *= power;
    one.tag.corners_cov_px2 *= power;
  }
}

}  // namespace

Result<std::vector<TagObservation>> detect_tags(const ImageView& image, const MarkerFamily& family,
                                                const DetectOptions& options, const Progress& progress) {
  if (auto valid = options.validate(); !valid) return base::fail(std::move(valid));
  if (!family.tag) return base::fail(ErrorCode::kUsage, fmt::format("{} is a family of rings, not of tags", family.name));
  if (auto valid = check_image(image); !valid) return base::fail(std::move(valid));
  const detail::TagSearch search{.published = options.polarity != Polarity::kBrightDots,
                                 .inverted = options.polarity != Polarity::kDarkDots};
  const std::string_view library_name = std::string_view(family.name).substr(family.name.find(':') + 1);
  const std::vector<detail::TagCandidate> candidates = detail::find_tags(image, library_name, search);
  const detail::Sampler sampler(image);
  std::vector<Measured> tags;
  for (std::size_t i = 0; i < candidates.size(); ++i) {
    if (progress.cancelled()) return base::cancelled("detection of markers");
    progress("detect", i, candidates.size());
    if (auto one = measured(sampler, candidates[i], family, options)) tags.push_back(*one);
  }
  progress("detect", candidates.size(), candidates.size());
  remove_duplicates(tags, *family.tag);
  scale_covariances(tags);
  std::vector<TagObservation> result;
  for (const Measured& one : tags) result.push_back(one.tag);
  std::sort(result.begin(), result.end(), [](const TagObservation& a, const TagObservation& b) {
    return std::make_tuple(static_cast<int>(a.status), a.id, a.centre_px.y(), a.centre_px.x()) <
           std::make_tuple(static_cast<int>(b.status), b.id, b.centre_px.y(), b.centre_px.x());
  });
  return result;
}

}  // namespace crosstie::markers
