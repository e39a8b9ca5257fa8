#include "markers/mirrored.h"

#include <algorithm>

#include <fmt/format.h>

namespace crosstie::markers {

using base::ObservationStatus;

Handedness handedness(const base::ImageObservations& image, const MarkerFamily& family, std::span<const int> ids) {
  Handedness counts;
  const auto in_use = [&](int id) { return std::find(ids.begin(), ids.end(), id) != ids.end(); };
  for (const base::Observation& observation : image.observations) {
    const bool coded = observation.status == ObservationStatus::kCoded;
    if (observation.id == base::kNoId || (!coded && observation.status != ObservationStatus::kRefused)) continue;
    ++counts.read;
    if (family.tag) {
      if (coded) ++counts.only_direct;
      if (!coded && (ids.empty() || in_use(observation.id))) ++counts.only_mirrored;
      continue;
    }
    const std::optional<std::uint64_t> code = family.code_of(observation.id);
    if (ids.empty() || !code) continue;
    const std::optional<int> mirrored = family.id_of_ring(mirrored_ring(*code, family.bits));
    const bool other_way = mirrored && in_use(*mirrored);
    if (coded && !other_way) ++counts.only_direct;
    if (!coded && other_way) ++counts.only_mirrored;
  }
  return counts;
}

std::optional<std::string> mirror_warning(const base::ImageObservations& image, const MarkerFamily& family,
                                          std::span<const int> ids) {
  constexpr int kEnough = 3;
  const Handedness counts = handedness(image, family, ids);
  if (counts.only_mirrored < kEnough || counts.only_mirrored <= counts.only_direct) return std::nullopt;
  return fmt::format(
      "image seems mirrored: {} of {} markers are ids {} only when read the other way round; flip it, or photograph the "
      "markers "
      "themselves and not their reflection",
      counts.only_mirrored, counts.read, family.tag && ids.empty() ? "of the family" : "of the list");
}

}  // namespace crosstie::markers
