#include "edge/detail/chamfer_side.h"

#include <algorithm>
#include <cmath>

namespace crosstie::edge::detail {

std::size_t take_one_side(const RimCells& cells, std::vector<RimCandidate>& rim) {
  constexpr double kSigmas = 3.29;
  constexpr double kOnLine = 0.25;  // of the band
  constexpr double kOffLine = 0.75;
  std::vector<std::size_t> far;
  std::size_t alone = 0;  // edges without a band
  for (std::size_t i = 0; i < cells.size(); ++i) {
    for (const RimCandidate* member : cells[i].members) {
      if (member->band_mm <= 0.0) {
        ++alone;
        continue;
      }
      const RimLine line = line_about(cells, i, [&](const RimCandidate& other) {
        return other.band_mm <= 0.0 && other.camera == member->camera && other.station == member->station;
      });
      if (!line.known) continue;
      const double near_mm = std::abs(line.off_mm(member->point_mm));
      const double far_mm = std::abs(line.off_mm(member->point_mm + member->band_mm * member->out));
      const double noise_mm = kSigmas * std::hypot(line.scatter_mm, member->sigma_mm);
      if (far_mm < std::max(noise_mm, kOnLine * member->band_mm) && near_mm > std::max(noise_mm, kOffLine * member->band_mm))
        far.push_back(static_cast<std::size_t>(member - rim.data()));
    }
  }
  if (far.size() >= alone) return 0;
  for (const std::size_t i : far) {
    rim[i].point_mm += rim[i].band_mm * rim[i].out;
    rim[i].band_mm = 0.0;
  }
  return far.size();
}

}  // namespace crosstie::edge::detail
