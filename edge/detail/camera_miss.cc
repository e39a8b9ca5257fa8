#include "edge/detail/camera_miss.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <optional>

#include <Eigen/Cholesky>
#include <Eigen/Geometry>

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

/// Off the epipolar curves about a place of the left image: value and slopes.
struct OffCurve {
  Eigen::Vector3d terms = Eigen::Vector3d::Zero();  ///< px, px/px, px/px
  double sigma_px = 0.0;                            ///< of the value
  int places = 0;
};

std::optional<OffCurve> off_curve_about(const std::vector<base::HeadTest::Place>& places, const Eigen::Vector2d& middle_px,
                                        double reach_px) {
  constexpr std::size_t kLeastPlaces = 12;
  constexpr double kLeastScatter_px = 0.02;
  constexpr double kMostSigma_px = 0.2;
  if (places.size() < kLeastPlaces) return std::nullopt;
  std::vector<double> distances;
  for (const auto& place : places) distances.push_back((place.left_px - middle_px).norm());
  std::vector<double> sorted = distances;
  std::nth_element(sorted.begin(), sorted.begin() + kLeastPlaces - 1, sorted.end());
  const double width_px = std::max(reach_px, 1.5 * sorted[kLeastPlaces - 1]);
  OffCurve result;
  double scatter = 1.0;  // in sigmas
  for (int round = 0; round < kRounds; ++round) {
    Eigen::Matrix3d normal = Eigen::Matrix3d::Zero(), squared = Eigen::Matrix3d::Zero();
    Eigen::Vector3d right = Eigen::Vector3d::Zero();
    std::vector<double> ratios;
    result.places = 0;
    for (std::size_t i = 0; i < places.size(); ++i) {
      const double t = distances[i] / width_px;
      if (t >= 1.0) continue;
      const double sigma = std::hypot(places[i].sigma_px, kLeastScatter_px);
      const Eigen::Vector3d row(1.0, places[i].left_px.x() - middle_px.x(), places[i].left_px.y() - middle_px.y());
      const double ratio = std::abs(places[i].off_px - row.dot(result.terms)) / sigma;
      ratios.push_back(ratio);
      const double off = round == 0 ? 0.0 : ratio / (kTukey * scatter);
      if (off >= 1.0) continue;
      const double weight = std::pow(1.0 - t * t * t, 3) * std::pow(1.0 - off * off, 2);
      normal += weight / (sigma * sigma) * row * row.transpose();
      squared += weight * weight / (sigma * sigma) * row * row.transpose();
      right += weight / (sigma * sigma) * places[i].off_px * row;
      ++result.places;
    }
    const Eigen::LDLT<Eigen::Matrix3d> ldlt(normal);
    const Eigen::Vector3d value = ldlt.solve(Eigen::Vector3d::UnitX());
    if (round > 0) scatter = std::max(1.0, 1.4826 * math::median(ratios));
    result.terms = ldlt.solve(right);
    result.sigma_px = scatter * std::sqrt(value.dot(squared * value));
  }
  if (!result.terms.allFinite() || !(result.sigma_px < kMostSigma_px)) return std::nullopt;
  return result;
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

void take_from_texture(std::vector<CameraMiss>& misses, std::span<const StationView> stations,
                       const std::vector<RimCandidate>& rim) {
  for (CameraMiss& miss : misses) {
    const StationView& view = stations[static_cast<std::size_t>(miss.station)];
    Eigen::Vector2d low = Eigen::Vector2d::Constant(HUGE_VAL), high = -low;
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    double count = 0.0;
    for (const RimCandidate& candidate : rim) {
      if (candidate.station != miss.station) continue;
      low = low.cwiseMin(candidate.left_px);
      high = high.cwiseMax(candidate.left_px);
      sum += candidate.point_in_rig_mm;
      count += 1.0;
    }
    const Eigen::Vector2d middle_px = 0.5 * (low + high);
    const auto off = off_curve_about(view.off_curve, middle_px, (high - low).norm());
    if (!off) continue;
    // What lies below its epipolar curve in the right image turns that camera's rays up, towards the base times the ray.
    const Eigen::Vector3d p_in_right = view.head->right_from_left * Eigen::Vector3d(sum / count);
    const Eigen::Vector3d base_in_right = view.head->right_from_left.translation_mm.normalized();
    const double rad_per_px = -p_in_right.z() / view.head->right.focal_px().mean() / base_in_right.cross(p_in_right).norm();
    miss.angle_rad = off->terms(0) * rad_per_px;
    miss.sigma_rad = off->sigma_px * std::abs(rad_per_px);
    miss.slope_rad_per_px = off->terms.tail<2>() * rad_per_px;
    miss.middle_px = middle_px;
    miss.places = off->places;
  }
}

void meet_half_way(const std::vector<CameraMiss>& misses, std::vector<RimCandidate>& rim) {
  for (RimCandidate& candidate : rim) {
    for (const CameraMiss& miss : misses) {
      if (miss.station != candidate.station) continue;
      const double angle_rad = miss.angle_rad + miss.slope_rad_per_px.dot(candidate.left_px - miss.middle_px);
      candidate.point_mm += 0.5 * angle_rad * candidate.turn_mm;
      if (candidate.camera == 1) candidate.point_mm -= angle_rad * candidate.slide_mm;
    }
  }
}

}  // namespace crosstie::edge::detail
