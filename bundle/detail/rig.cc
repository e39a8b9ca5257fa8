#include "bundle/detail/rig.h"

#include <algorithm>
#include <limits>

#include <fmt/format.h>

namespace crosstie::bundle::detail {
namespace {

/// Of several measured poses the one with the least sum of distances from the others; turns count with the poses' own length.
base::Pose most_central(const std::vector<base::Pose>& poses) {
  const base::Pose* best = &poses.front();
  double least = std::numeric_limits<double>::infinity();
  for (const base::Pose& candidate : poses) {
    double sum = 0.0;
    for (const base::Pose& other : poses) {
      sum += (candidate.translation_mm - other.translation_mm).norm() +
             candidate.translation_mm.norm() * candidate.rotation.angularDistance(other.rotation);
    }
    if (sum < least) {
      least = sum;
      best = &candidate;
    }
  }
  return *best;
}

}  // namespace

void mount_cameras(Survey& survey, State& state) {
  for (std::size_t r = 0; r < survey.rigs.size(); ++r) {
    const Rig& rig = survey.rigs[r];
    state.mounts[static_cast<std::size_t>(rig.cameras.front())] = base::Pose{};
    for (std::size_t k = 1; k < rig.cameras.size(); ++k) {
      std::vector<base::Pose> seen;
      for (const Station& station : survey.stations) {
        if (station.rig != static_cast<int>(r)) continue;
        const std::optional<base::Pose>* first = nullptr;
        const std::optional<base::Pose>* own = nullptr;
        for (const int image : station.images) {
          const int camera = survey.camera_of_image[static_cast<std::size_t>(image)];
          if (camera == rig.cameras.front()) first = &state.poses[static_cast<std::size_t>(image)];
          if (camera == rig.cameras[k]) own = &state.poses[static_cast<std::size_t>(image)];
        }
        if (first != nullptr && own != nullptr && *first && *own) seen.push_back((*first)->inverse() * **own);
      }
      const auto camera = static_cast<std::size_t>(rig.cameras[k]);
      if (!seen.empty()) {
        state.mounts[camera] = most_central(seen);
      } else {
        survey.warnings.push_back(
            {"camera_not_mounted", survey.cameras[camera].name,
             fmt::format("camera {} is adjusted apart from its rig {}: in no station could both it and camera {} be oriented",
                         survey.cameras[camera].name, rig.name,
                         survey.cameras[static_cast<std::size_t>(rig.cameras.front())].name)});
      }
    }
  }
  for (const Station& station : survey.stations) {
    const auto mounted = [&](int image) {
      return state.mounts[static_cast<std::size_t>(survey.camera_of_image[static_cast<std::size_t>(image)])];
    };
    const auto known = std::find_if(station.images.begin(), station.images.end(),
                                    [&](int image) { return state.poses[static_cast<std::size_t>(image)] && mounted(image); });
    if (known == station.images.end()) continue;
    const base::Pose network_from_rig = *state.poses[static_cast<std::size_t>(*known)] * mounted(*known)->inverse();
    for (const int image : station.images) {
      if (mounted(image)) state.poses[static_cast<std::size_t>(image)] = network_from_rig * *mounted(image);
    }
  }
}

}  // namespace crosstie::bundle::detail
