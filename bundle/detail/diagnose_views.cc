#include <algorithm>
#include <cmath>
#include <numbers>

#include <fmt/format.h>

#include "bundle/detail/diagnose.h"

namespace crosstie::bundle::detail {
namespace {

using base::AdjustedNetwork;

constexpr double kDegrees = 180.0 / std::numbers::pi;
/// The projection centres stand on one side where a sector of the directions round the points' middle that is wider than this
/// holds none of them: half a turn and some margin, so that two cameras that face each other across the object pass.
constexpr double kEmptySector_rad = 210.0 / kDegrees;
constexpr double kFromInFront_rad = 5.0 / kDegrees;  // nearer to the normal an image has no side
constexpr double kSmallInImage = 0.05;               // share of the image's area
constexpr std::size_t kMostNamed = 8;

std::string listed(const std::vector<std::string>& names) {
  std::string text;
  for (std::size_t i = 0; i < std::min(names.size(), kMostNamed); ++i) text += (i > 0 ? ", " : "") + names[i];
  if (names.size() > kMostNamed) text += fmt::format(" and {} more", names.size() - kMostNamed);
  return text;
}

void about_sides(AdjustedNetwork& result) {
  const Spread spread = spread_of(result);
  std::vector<double> sides;
  for (const auto& image : result.images) {
    const Eigen::Vector3d at = spread.directions.transpose() * (image.network_from_camera.translation_mm - spread.middle_mm);
    if (std::atan2(at.tail<2>().norm(), std::abs(at.x())) < kFromInFront_rad) continue;
    sides.push_back(std::atan2(at.z(), at.y()));
  }
  if (sides.empty()) return;
  std::sort(sides.begin(), sides.end());
  double widest = 2.0 * std::numbers::pi - (sides.back() - sides.front());
  for (std::size_t i = 1; i < sides.size(); ++i) widest = std::max(widest, sides[i] - sides[i - 1]);
  if (widest <= kEmptySector_rad) return;
  result.warnings.push_back(
      {"one_side", "",
       fmt::format("all images are taken from one side: round the middle of the points a sector of {:.0f} degrees holds no "
                   "camera. What they have in common bends the network and does not show; take images from the other side",
                   widest * kDegrees)});
}

void about_size_in_images(AdjustedNetwork& result) {
  std::vector<std::string> small;
  for (const auto& image : result.images) {
    if (image.coverage < kSmallInImage) small.push_back(image.name);
  }
  if (small.empty()) return;
  result.warnings.push_back(
      {"small_in_image", listed(small),
       fmt::format("in {} of {} images the points fill less than {:.0f} % of the image ({}): their poses are weak. Go nearer, "
                   "or show more points",
                   small.size(), result.images.size(), 100.0 * kSmallInImage, listed(small))});
}

void about_twins(const Survey& survey, AdjustedNetwork& result) {
  std::vector<std::string> twins;
  for (std::size_t r = 0; r < survey.rays.size(); ++r) {
    const Ray& ray = survey.rays[r];
    if (!ray.twin) continue;
    const bool told = r > 0 && survey.rays[r - 1].image == ray.image && survey.rays[r - 1].point == ray.point;
    if (told) continue;
    twins.push_back(fmt::format("{} in {}", survey.ids[static_cast<std::size_t>(ray.point)],
                                survey.images[static_cast<std::size_t>(ray.image)]));
  }
  if (twins.empty()) return;
  result.warnings.push_back(
      {"id_twice", listed(twins),
       fmt::format("an id was read more than once in an image: {}. The one that fits was kept, where one does; look for "
                   "reflections, misread rings, or two markers with the same id",
                   listed(twins))});
}

}  // namespace

void about_views(const Survey& survey, AdjustedNetwork& result) {
  about_sides(result);
  about_size_in_images(result);
  about_twins(survey, result);
}

}  // namespace crosstie::bundle::detail
