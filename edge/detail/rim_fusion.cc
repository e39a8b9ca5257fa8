#include "edge/detail/rim_fusion.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include <Eigen/Cholesky>
#include <Eigen/Geometry>

#include "math/distributions.h"

namespace crosstie::edge::detail {
namespace {

constexpr double kChance = 0.999;

/// Variance of the mean of edge pixels over an extent, each of which averages a piece of edge itself: with white noise along the edge, over that of
/// one pixel. `pieces` is the extent in pieces.
double share_of_variance(double pieces) { return pieces < 1.0 ? 1.0 - pieces / 3.0 : (1.0 - 1.0 / (3.0 * pieces)) / pieces; }

}  // namespace

std::vector<Voice> voices_of(const std::vector<const RimCandidate*>& members, const RimLine& line) {
  std::map<std::pair<int, int>, std::vector<const RimCandidate*>> groups;
  for (const RimCandidate* member : members) groups[{member->station, member->camera}].push_back(member);
  std::vector<Voice> voices;
  for (const auto& [who, group] : groups) {
    Voice voice{who.first, who.second, static_cast<int>(group.size())};
    double weights = 0.0, variance = 0.0, extent_low = 1e300, extent_high = -1e300;
    double piece = 0.0, surface_piece = 0.0, depths = 0.0;
    for (const RimCandidate* member : group) {
      const double weight = 1.0 / (member->sigma_mm * member->sigma_mm);
      weights += weight;
      voice.point_mm += weight * member->point_mm;
      voice.point_in_rig_mm += weight * member->point_in_rig_mm;
      voice.normal += weight * member->normal;
      voice.off_mm += weight * line.off_mm(member->point_mm);
      voice.surface_sigma_mm += weight * member->surface_sigma_mm;
      const double facing = std::max(0.1, std::abs(member->ray.dot(member->normal)));
      voice.slant += weight * -member->ray.dot(line.across) / facing;
      voice.tilt_sigma_rad += weight * member->tilt_sigma_rad;
      voice.band_mm += weight * member->band_mm;
      variance += weight * member->sigma_mm * member->sigma_mm;
      const double along = line.along_mm(member->point_mm);
      extent_low = std::min(extent_low, along);
      extent_high = std::max(extent_high, along);
      piece += weight * member->piece_mm;
      surface_piece += weight * member->surface_piece_mm;
      depths += weight * member->depths_mm;
    }
    for (double* value :
         {&voice.off_mm, &voice.surface_sigma_mm, &voice.slant, &voice.band_mm, &piece, &surface_piece, &depths})
      *value /= weights;
    voice.point_mm /= weights;
    voice.point_in_rig_mm /= weights;
    voice.normal.normalize();
    // The mean of points on a curve lies on its inner side.
    voice.point_mm += (voice.off_mm - line.off_mm(voice.point_mm)) * line.across;
    voice.surface_sigma_mm *= std::sqrt(share_of_variance((extent_high - extent_low) / surface_piece));
    voice.tilt_sigma_rad *= std::sqrt(share_of_variance((extent_high - extent_low) / depths)) / weights;
    voice.sigma_mm = std::sqrt(variance / weights * share_of_variance((extent_high - extent_low) / piece));
    voices.push_back(voice);
  }
  return voices;
}

double FusedCell::share(const Voice& voice) const {
  double weights = 0.0;
  for (const Voice& one : voices) weights += one.weight();
  return voice.weight() / weights;
}

FusedCell fuse(std::vector<Voice> voices, const RimLine& line, double max_w, HoleEdge::Counts& counts) {
  const auto contradicts = [&](const Voice& a, const Voice& b) {
    return std::abs(a.off_mm - b.off_mm) > max_w * std::hypot(a.sigma_mm, b.sigma_mm, line.scatter_mm);
  };
  for (bool changed = true; changed && voices.size() > 1;) {
    changed = false;
    for (std::size_t i = 0; i < voices.size() && !changed; ++i) {
      for (std::size_t j = i + 1; j < voices.size() && !changed; ++j) {
        if (!contradicts(voices[i], voices[j])) continue;
        const std::size_t worse = std::abs(voices[i].off_mm) > std::abs(voices[j].off_mm) ? i : j;
        counts.stray += voices[worse].pixels;
        counts.used -= voices[worse].pixels;
        voices.erase(voices.begin() + static_cast<std::ptrdiff_t>(worse));
        changed = true;
      }
    }
  }
  FusedCell cell;
  double weights = 0.0;
  std::map<int, Eigen::Vector3d> by_station;
  for (const Voice& voice : voices) {
    const double weight = voice.weight();
    weights += weight;
    cell.point_mm += weight * voice.point_mm;
    cell.normal += weight * voice.normal;
    cell.off_mm += weight * voice.off_mm;
    by_station.try_emplace(voice.station, Eigen::Vector3d::Zero()).first->second +=
        weight * Eigen::Vector3d(voice.surface_sigma_mm, voice.tilt_sigma_rad(0), voice.tilt_sigma_rad(1));
    cell.slant += weight * voice.slant;
  }
  cell.point_mm /= weights;
  for (double* value : {&cell.off_mm, &cell.slant}) *value /= weights;
  // The cameras of a station stand on the same depths, stations on their own.
  for (const auto& [station, sigmas] : by_station) {
    cell.surface_sigma_mm = std::hypot(cell.surface_sigma_mm, sigmas(0) / weights);
    for (int i = 0; i < 2; ++i) cell.tilt_sigma_rad(i) = std::hypot(cell.tilt_sigma_rad(i), sigmas(i + 1) / weights);
  }
  double squares = 0.0;
  for (const Voice& voice : voices) squares += std::pow((voice.off_mm - cell.off_mm) / voice.sigma_mm, 2);
  const double freedom = static_cast<double>(voices.size()) - 1.0;
  // Only where chance does not explain it: else sigmas would grow on average.
  if (freedom > 0.0 && squares > math::chi_square_quantile(kChance, freedom)) cell.disagreement = squares / freedom;
  cell.sigma_mm = std::sqrt(cell.disagreement / weights);
  // Of the surfaces themselves: a rim says little of the slopes of the face that it lies in.
  cell.normal.normalize();
  cell.across = (line.across - line.across.dot(cell.normal) * cell.normal).normalized();
  cell.voices = std::move(voices);
  return cell;
}

double roughness(const std::vector<FusedCell>& cells, double reach_mm, std::vector<double>& off_mm) {
  constexpr double kMedianOfSquare = 0.4549;  // of chi-square with one degree of freedom
  constexpr std::size_t kLeast = 10;
  off_mm.assign(cells.size(), 0.0);
  std::vector<double> ratios;
  for (std::size_t i = 0; i < cells.size(); ++i) {
    const Eigen::Vector3d tangent = cells[i].across.cross(cells[i].normal);
    Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
    Eigen::Vector3d right = Eigen::Vector3d::Zero();
    int count = 0;
    for (std::size_t j = 0; j < cells.size(); ++j) {
      const Eigen::Vector3d d = cells[j].point_mm - cells[i].point_mm;
      const double a = tangent.dot(d);
      if (j == i || d.norm() > reach_mm) continue;
      const Eigen::Vector3d row(1.0, a, a * a);
      const double weight = 1.0 / (cells[j].sigma_mm * cells[j].sigma_mm);
      normal += weight * row * row.transpose();
      right += weight * cells[i].across.dot(d) * row;
      ++count;
    }
    if (count < 5) continue;
    const Eigen::LDLT<Eigen::Matrix3d> factor(normal);
    const Eigen::Vector3d line = factor.solve(right);
    const double variance = factor.solve(Eigen::Vector3d::UnitX())(0);
    if (!(variance > 0.0)) continue;
    off_mm[i] = -line(0);
    ratios.push_back(line(0) * line(0) / (variance + cells[i].sigma_mm * cells[i].sigma_mm));
  }
  if (ratios.size() < kLeast) return 1.0;
  const auto middle = ratios.begin() + static_cast<std::ptrdiff_t>(ratios.size() / 2);
  std::nth_element(ratios.begin(), middle, ratios.end());
  // The median of so many varies by chance; what it may be without roughness is not counted as such.
  constexpr double kOfMedian = 1.17;  // sigma of a scale from the median of n absolute values, times sqrt(n)
  const double factor = std::sqrt(*middle / kMedianOfSquare);
  return factor > 1.0 + 3.0 * kOfMedian / std::sqrt(static_cast<double>(ratios.size())) ? factor : 1.0;
}

}  // namespace crosstie::edge::detail
