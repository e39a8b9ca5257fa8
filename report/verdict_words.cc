#include "report/verdict_words.h"

#include <algorithm>
#include <array>
#include <utility>

#include <fmt/format.h>

namespace crosstie::report {

std::string verdict_words(std::string_view name) {
  using Entry = std::pair<std::string_view, std::string_view>;
  constexpr std::array<Entry, 19> kWords = {{
      {"sigma0_px", "sigma of an image coordinate (sigma0)"},
      {"scale_bar_w", "largest deviation of a check bar over its sigma"},
      {"control_w", "largest deviation of a control point over its sigma"},
      {"point_sigma_mm", "largest sigma of a coordinate"},
      {"deviation_rms_mm", "3D deviation from the reference, rms"},
      {"deviation_max_mm", "3D deviation from the reference, largest"},
      {"length_error_mm", "length error nearest to its limit"},
      {"heldout_rms_px", "residual of board images left out, rms per point"},
      {"halves_ratio", "odd against even images, difference over its prediction"},
      {"change_px", "change since the earlier calibration, rms over the image"},
      {"change_w", "change since the earlier calibration over its sigma"},
      {"area_not_covered", "share of the image without board corners"},
      {"prior_ratio", "board's shape against its prior, squares over expected"},
      {"baseline_sigma_mm", "sigma of the baseline"},
      {"sphere_w", "largest deviation of a probed sphere over its sigma"},
      {"rig_change_w", "change of the rig since its calibration over its sigma"},
      {"frame_u_mm", "U of a point of the working volume by the frame"},
      {"surface_p95_mm", "95 % of the surface's deviations are below"},
      {"edge_rms_mm", "deviation of the edge from its reference, rms"},
  }};
  const std::string_view key = name.substr(0, name.find(' '));
  const auto found = std::find_if(kWords.begin(), kWords.end(), [&](const Entry& entry) { return entry.first == key; });
  if (found == kWords.end()) return std::string(name);
  if (key.size() == name.size()) return std::string(found->second);
  return fmt::format("{}, {}", found->second, name.substr(key.size() + 1));
}

}  // namespace crosstie::report
