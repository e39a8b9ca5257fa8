#include "edge/detail/camera_miss.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include "math/median.h"

namespace crosstie::edge::detail {
namespace {

constexpr std::size_t kLeastCells = 6;
constexpr double kSigmas = 4.0;  // from which on a miss is told from nothing
constexpr double kTukey = 4.7;
constexpr double kLeastScatter_mm = 0.01;
constexpr int kRounds = 10;

/// How far apart the cameras see a cell's edge, and by how much a turn of one radian moves it.
struct Apart {
  double off_mm = 0.0;
  double slide_mm = 0.0;
};

std::map<int, std::vector<Apart>> cells_of_both(const RimCells& cells) {
  std::map<int, std::vector<Apart>> all;
  for (std::size_t i = 0; i < cells.size(); ++i) {
    const RimLine line = line_about(cells, i);
    if (!line.known) continue;
    struct Seen {
      std::array<std::vector<double>, 2> off_mm;
      std::vector<double> slide_mm;
    };
    std::map<int, Seen> stations;
    for (std::size_t m = 0; m < cells[i].members.size(); ++m) {
      if (cells[i].inner[m]) continue;
      const RimCandidate& member = *cells[i].members[m];
      Seen& seen = stations[member.station];
      seen.off_mm[static_cast<std::size_t>(member.camera)].push_back(line.off_mm(member.point_mm));
      seen.slide_mm.push_back(line.across.dot(member.slide_mm));
    }
    for (const auto& [station, seen] : stations) {
      if (seen.off_mm[0].empty() || seen.off_mm[1].empty()) continue;
      all[station].push_back({math::median(seen.off_mm[1]) - math::median(seen.off_mm[0]), math::median(seen.slide_mm)});
    }
  }
  return all;
}

CameraMiss miss_of(int station, const std::vector<Apart>& cells) {
  CameraMiss miss{station, 0.0, 0.0, static_cast<int>(cells.size())};
  std::vector<double> weights(cells.size(), 1.0);
  for (int round = 0; round < kRounds; ++round) {
    double normal = 0.0, right = 0.0;
    for (std::size_t i = 0; i < cells.size(); ++i) {
      normal += weights[i] * cells[i].slide_mm * cells[i].slide_mm;
      right += weights[i] * cells[i].slide_mm * cells[i].off_mm;
    }
    miss.angle_rad = right / normal;
    std::vector<double> off;
    for (const Apart& cell : cells) off.push_back(std::abs(cell.off_mm - miss.angle_rad * cell.slide_mm));
    const double scatter = std::max(kLeastScatter_mm, 1.4826 * math::median(off));
    for (std::size_t i = 0; i < cells.size(); ++i) {
      const double ratio = off[i] / (kTukey * scatter);
      weights[i] = ratio < 1.0 ? std::pow(1.0 - ratio * ratio, 2) : 0.0;
    }
    miss.sigma_rad = scatter / std::sqrt(normal);
  }
  return miss;
}

}  // namespace

std::vector<CameraMiss> camera_misses(const RimCells& cells) {
  std::vector<CameraMiss> misses;
  for (const auto& [station, both] : cells_of_both(cells)) {
    if (both.size() < kLeastCells) continue;
    const CameraMiss miss = miss_of(station, both);
    if (std::abs(miss.angle_rad) > kSigmas * miss.sigma_rad) misses.push_back(miss);
  }
  return misses;
}

void meet_half_way(const std::vector<CameraMiss>& misses, std::vector<RimCandidate>& rim) {
  for (RimCandidate& candidate : rim) {
    for (const CameraMiss& miss : misses) {
      if (miss.station != candidate.station) continue;
      candidate.point_mm += 0.5 * miss.angle_rad * candidate.turn_mm;
      if (candidate.camera == 1) candidate.point_mm -= miss.angle_rad * candidate.slide_mm;
    }
  }
}

}  // namespace crosstie::edge::detail
