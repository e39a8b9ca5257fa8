#include "live/focus.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <vector>

#include "live/detail/levels.h"

namespace crosstie::live {
namespace {

constexpr int kReach = 3;                 // pixels to either side of an edge
constexpr int kEveryLine = 2;             // row and column whose profiles are looked at
constexpr double kLeastContrast = 0.094;  // of the white level
constexpr double kOfRange = 0.25;         // of the image's own range of levels, for an edge to be looked at
constexpr double kOfStrongest = 0.5;      // of the strongest contrasts, for an edge to count
constexpr double kStrongest = 0.95;       // their quantile
constexpr double kFlattest = 0.3;         // least r that is looked at; a ramp without an end has 1/3
constexpr double kAgainst = 0.08;         // of the contrast: what a step against the edge's direction may be
constexpr double kAcross = 0.5;           // largest gradient along the edge, over that across
constexpr std::size_t kFewest = 20;
constexpr double kHiddenShare = 0.002;  // of the pixels at either end of the levels: what is no part of the image's range

struct Edge {
  int contrast = 0;
  double ratio = 0.0;
};

/// Looks at profiles through pixels, whose samples are `step` apart; `across` leads to the neighbouring profile.
template <typename Sample>
class Search {
 public:
  Search(int least_contrast, int saturated)
      : least_(least_contrast),
        least_slope_(std::max(1, static_cast<int>(kFlattest * least_contrast))),
        saturated_(saturated) {}

  void look(const Sample* at, std::ptrdiff_t step, std::ptrdiff_t across) {
    const int slope = at[step] - at[-step];
    if (std::abs(slope) < least_slope_) return;
    // The steepest place of the edge; the first of two that are alike.
    const int before = at[0] - at[-2 * step];
    const int after = at[2 * step] - at[0];
    if (slope > 0 ? (before >= slope || after > slope) : (before <= slope || after < slope)) return;
    take(at, step, across, slope);
  }

  [[nodiscard]] const std::vector<Edge>& edges() const { return edges_; }

 private:
  void take(const Sample* at, std::ptrdiff_t step, std::ptrdiff_t across, int slope) {
    const int change = at[kReach * step] - at[-kReach * step];
    const int contrast = slope > 0 ? change : -change;
    if (contrast < least_ || std::abs(at[across] - at[-across]) > kAcross * std::abs(slope)) return;
    const double against = kAgainst * contrast;
    for (int k = -kReach; k < kReach; ++k) {
      const int here = at[(k + 1) * step] - at[k * step];
      if ((slope > 0 ? here : -here) < -against) return;
    }
    if (std::max<int>(at[kReach * step], at[-kReach * step]) >= saturated_) return;
    edges_.push_back({contrast, std::abs(static_cast<double>(slope)) / contrast});
  }

  int least_;
  int least_slope_;
  int saturated_;
  std::vector<Edge> edges_;
};

template <typename Sample>
std::vector<Edge> edges_of(const base::ImageView& image, int least_contrast, int saturated) {
  Search<Sample> search(least_contrast, saturated);
  const std::ptrdiff_t stride = image.row_stride_bytes / static_cast<std::ptrdiff_t>(sizeof(Sample));
  for (int y = 1; y + 1 < image.height; y += kEveryLine) {
    const Sample* row = image.row<Sample>(y);
    for (int x = kReach; x < image.width - kReach; ++x) search.look(row + x, 1, stride);
  }
  for (int y = kReach; y < image.height - kReach; ++y) {
    const Sample* row = image.row<Sample>(y);
    for (int x = 1; x + 1 < image.width; x += kEveryLine) search.look(row + x, stride, 1);
  }
  return search.edges();
}

}  // namespace

std::optional<double> focus_number(const base::ImageView& image, double saturated_level) {
  if (image.width <= 2 * kReach || image.height <= 2 * kReach) return std::nullopt;
  const detail::LevelCounts levels(image);
  const double range = levels.quantile(1.0 - kHiddenShare) - levels.quantile(kHiddenShare);
  const double least = std::max(kLeastContrast * image.white_level, kOfRange * range);
  const int saturated = static_cast<int>(std::ceil(saturated_level * image.white_level));
  const auto least_contrast = static_cast<int>(std::ceil(least));
  std::vector<Edge> edges = image.bits == 8 ? edges_of<std::uint8_t>(image, least_contrast, saturated)
                                            : edges_of<std::uint16_t>(image, least_contrast, saturated);
  if (edges.size() < kFewest) return std::nullopt;
  const auto strongest = edges.begin() + static_cast<std::ptrdiff_t>(kStrongest * static_cast<double>(edges.size() - 1));
  std::nth_element(edges.begin(), strongest, edges.end(), [](const Edge& a, const Edge& b) { return a.contrast < b.contrast; });
  const double counts = kOfStrongest * strongest->contrast;
  std::erase_if(edges, [&](const Edge& edge) { return edge.contrast < counts; });
  if (edges.size() < kFewest) return std::nullopt;
  const auto middle = edges.begin() + static_cast<std::ptrdiff_t>(edges.size() / 2);
  std::nth_element(edges.begin(), middle, edges.end(), [](const Edge& a, const Edge& b) { return a.ratio < b.ratio; });
  return std::clamp(0.5 * (3.0 * middle->ratio - 1.0), 0.0, 1.0);
}

}  // namespace crosstie::live
