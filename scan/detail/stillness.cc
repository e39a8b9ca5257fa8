#include "scan/detail/stillness.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <fmt/format.h>

#include "scan/detail/image_shift.h"

namespace crosstie::scan::detail {
namespace {

using base::PatternKind;

constexpr double kSignificant = 25.0;  // chi-square: 5 sigmas
constexpr double kLeastMoved = 0.1;    // of the image's parts, for it to count as moved
constexpr double kLeastChanged = 0.1;  // of the parts that look different
constexpr double kSaturated = 0.98;    // of the white level
constexpr std::size_t kEvery = 5;      // pixels and rows that tell the light

/// Sums of white's and black's levels, first and last, over pixels that are saturated in neither.
template <typename Sample>
std::array<double, 4> sums_of(const Repeated& white, const Repeated& black) {
  std::array<double, 4> sums = {};
  const double limit = kSaturated * white.first.white_level();
  const std::array<base::ImageView, 4> views = {white.first.view(), white.last.view(), black.first.view(), black.last.view()};
  for (int y = 0; y < white.first.height(); y += static_cast<int>(kEvery)) {
    for (std::size_t x = 0; x < static_cast<std::size_t>(white.first.width()); x += kEvery) {
      std::array<double, 4> levels = {};
      for (std::size_t i = 0; i < 4; ++i) levels[i] = views[i].row<Sample>(y)[x];
      if (levels[0] >= limit || levels[1] >= limit) continue;
      for (std::size_t i = 0; i < 4; ++i) sums[i] += levels[i];
    }
  }
  return sums;
}

const Repeated* of_kind(const std::vector<Repeated>& repeated, PatternKind kind) {
  const auto found =
      std::find_if(repeated.begin(), repeated.end(), [&](const Repeated& one) { return one.pattern.kind == kind; });
  return found == repeated.end() ? nullptr : &*found;
}

}  // namespace

base::Result<> compare_repeated(const std::vector<Repeated>& repeated, const base::GreyNoise& noise, double limit_px,
                                int threads, base::Stillness& stillness) {
  const Repeated* white = of_kind(repeated, PatternKind::kWhite);
  const Repeated* black = of_kind(repeated, PatternKind::kBlack);
  if (white != nullptr && black != nullptr) {
    const auto sums = white->first.bits() == 8 ? sums_of<std::uint8_t>(*white, *black) : sums_of<std::uint16_t>(*white, *black);
    const double light = sums[0] - sums[2];
    if (light > 0.0) {
      stillness.light_change = (sums[1] - sums[3]) / light - 1.0;
      stillness.ambient_change = (sums[3] - sums[2]) / light;
    }
  }
  std::optional<ImageShift> shift;
  for (const Repeated& one : repeated) {
    if (one.pattern.kind == PatternKind::kBlack) continue;
    if (!shift) shift.emplace(one.first.width(), one.first.height());
    if (auto added = shift->add(one.first.view(), one.last.view(), noise.read, noise.shot, threads); !added) return added;
  }
  if (!shift) return {};
  stillness.compared = true;
  const ImageShift::Part whole = shift->whole();
  stillness.shift_told = whole.told;
  stillness.shift_px = whole.shift_px.norm();
  stillness.shift_sigma_px = whole.sigma_px;
  double moved = 0.0, told = 0.0;
  for (const ImageShift::Part& part : shift->parts()) {
    if (!part.told) continue;
    told += 1.0;
    if (part.statistic < kSignificant) continue;
    const double length = part.shift_px.norm();
    if (length > limit_px) moved += 1.0;
    if (length > stillness.part_shift_px) {
      stillness.part_shift_px = length;
      stillness.part_sigma_px = part.sigma_px;
    }
  }
  stillness.moved_share = told > 0.0 ? moved / told : 0.0;
  stillness.changed_share = shift->changed();
  return {};
}

base::Result<> judge_stillness(const base::Stillness& stillness, double max_movement_px, double max_light_change) {
  const auto refuse = [](const std::string& what) { return base::fail(base::ErrorCode::kBadInput, what); };
  if (max_light_change > 0.0) {
    for (const auto& [change, what] : {std::pair{stillness.light_change, "the projector's light changed"},
                                       std::pair{stillness.ambient_change, "other light changed"}}) {
      if (!change || std::abs(*change) <= max_light_change) continue;
      return refuse(
          fmt::format("{} by {:+.1f} % of the projector's light from the first to the last image ({:.0f} % are "
                      "allowed); let the projector warm up, shield the scene, scan once more",
                      what, 100.0 * *change, 100.0 * max_light_change));
    }
  }
  if (max_movement_px > 0.0) {
    const double ratio = stillness.shift_sigma_px > 0.0 ? stillness.shift_px / stillness.shift_sigma_px : 0.0;
    if (stillness.shift_px > max_movement_px && ratio * ratio > kSignificant) {
      return refuse(
          fmt::format("scene or head moved during the scan: the last image is shifted by {:.3f} +- {:.3f} px against the first "
                      "one of the same pattern ({} px are allowed); scan once more",
                      stillness.shift_px, stillness.shift_sigma_px, max_movement_px));
    }
    if (stillness.moved_share >= kLeastMoved) {
      return refuse(
          fmt::format("something moved during the scan: {:.0f} % of the image are shifted by more than {} px from the first to "
                      "the last image of the same pattern, by up to {:.3f} +- {:.3f} px; scan once more",
                      100.0 * stillness.moved_share, max_movement_px, stillness.part_shift_px, stillness.part_sigma_px));
    }
    if (stillness.changed_share >= kLeastChanged) {
      return refuse(
          fmt::format("scene or head moved during the scan: {:.0f} % of the image look different in the first and the last "
                      "image of the same pattern, by more than a shift of a pixel or other light explains; scan once more",
                      100.0 * stillness.changed_share));
    }
    if (stillness.drift_px > max_movement_px) {
      return refuse(fmt::format(
          "the fringes moved during the scan, their light flickered, or their steps are not those of the manifest: an "
          "image of a set lies {:.3f} +- {:.3f} px beside its place ({} px are allowed); scan once more, or check "
          "order and steps",
          stillness.drift_px, stillness.drift_sigma_px, max_movement_px));
    }
  }
  return {};
}

}  // namespace crosstie::scan::detail
