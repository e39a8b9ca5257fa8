#include "edge/detail/rim_line.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include <fmt/format.h>
#include <Eigen/Cholesky>
#include <Eigen/Geometry>

#include "math/median.h"

namespace crosstie::edge::detail {
namespace {

using base::ErrorCode;
using base::fail;
using base::Result;

constexpr std::size_t kLeastMembers = 12;
constexpr std::size_t kSectors = 240;  // of the coarse outline that measures arc lengths
constexpr double kReachCells = 4.0;
constexpr double kReachOfRadius = 0.25;  // a parabola leaves a circle by reach^4 / 8 R^3
constexpr double kLeastScatter_mm = 0.01;
constexpr double kTukey = 4.7;
constexpr int kRounds = 8;

Eigen::Vector2d centroid_of(const std::vector<RimCandidate>& candidates, const Face& face) {
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  for (const RimCandidate& candidate : candidates) sum += face.local(candidate.point_mm).head<2>();
  return sum / static_cast<double>(candidates.size());
}

/// The cells within reach of one, itself too.
template <typename Visit>
void for_neighbours(const RimCells& cells, std::size_t at, const Visit& visit) {
  for (std::size_t i = 0; i < cells.size(); ++i) {
    if ((cells[i].middle_mm - cells[at].middle_mm).norm() <= cells.reach_mm()) visit(cells[i]);
  }
}

/// Marks the inner members of all cells.
void mark_inner(const RimCells& cells, std::vector<RimCell>& marked) {
  constexpr std::size_t kLeastBands = 5;
  constexpr double kOfBand = 0.4;
  constexpr double kLeastDistance_mm = 0.05;
  constexpr double kNearCells = 1.5;
  constexpr double kSigmas = 3.29;
  const double near_mm = kNearCells * cells.cell_mm();
  for (std::size_t i = 0; i < cells.size(); ++i) {
    const RimCell& cell = cells[i];
    // Offsets of the neighbours with bands, from the tangent line of this cell with their own curve taken off by a line to both sides.
    std::vector<double> offsets, bands, sigmas, places;
    for_neighbours(cells, i, [&](const RimCell& other) {
      for (const RimCandidate* member : other.members) {
        if (member->band_mm <= 0.0) continue;
        const Eigen::Vector3d d = member->point_mm - cell.middle_mm;
        offsets.push_back(cell.across.dot(d));
        places.push_back(cell.along.dot(d));
        bands.push_back(member->band_mm);
        sigmas.push_back(member->sigma_mm);
      }
    });
    if (bands.size() < kLeastBands) continue;
    Eigen::Matrix3d normal = Eigen::Vector3d(1e-9, 1e-6, 1e-3).asDiagonal();
    Eigen::Vector3d right = Eigen::Vector3d::Zero();
    for (std::size_t k = 0; k < offsets.size(); ++k) {
      const Eigen::Vector3d row(1.0, places[k], places[k] * places[k]);
      normal += row * row.transpose();
      right += offsets[k] * row;
    }
    const Eigen::Vector3d line = normal.ldlt().solve(right);
    const double least = std::max(kLeastDistance_mm, kOfBand * math::median(bands));
    const double sigma_of_near = math::median(sigmas);  // no less for many: what makes near sides uncertain, they share
    for (std::size_t m = 0; m < cell.members.size(); ++m) {
      const RimCandidate& member = *cell.members[m];
      if (member.band_mm > 0.0) continue;
      const Eigen::Vector3d d = member.point_mm - cell.middle_mm;
      const double a = cell.along.dot(d);
      // Beside bands that were seen: between or beyond distant ones the line is a guess.
      const auto beside =
          std::count_if(places.begin(), places.end(), [&](double place) { return std::abs(place - a) <= near_mm; });
      if (static_cast<std::size_t>(beside) < kLeastBands) continue;
      const double beyond = cell.across.dot(d) - line.x() - line.y() * a - line.z() * a * a;
      if (beyond > std::max(least, kSigmas * std::hypot(sigma_of_near, member.sigma_mm))) marked[i].inner[m] = 1;
    }
  }
}

/// `takes(cell, member's index)`.
template <typename Takes>
RimLine line_of(const RimCells& cells, std::size_t at, const Takes& takes) {
  struct Member {
    double a, b, sigma;
  };
  RimLine line;
  const RimCell& cell = cells[at];
  line.middle_mm = cell.middle_mm;
  line.across = cell.across;
  line.along = cell.along;
  std::vector<Member> members;
  for_neighbours(cells, at, [&](const RimCell& other) {
    if (other.across.dot(cell.across) < 0.5) return;
    for (std::size_t m = 0; m < other.members.size(); ++m) {
      if (!takes(other, m)) continue;
      const Eigen::Vector3d d = other.members[m]->point_mm - cell.middle_mm;
      members.push_back({cell.along.dot(d), cell.across.dot(d), other.members[m]->sigma_mm});
    }
  });
  if (members.size() < kLeastMembers) return line;
  std::vector<double> weights(members.size(), 1.0);
  for (int round = 0; round < kRounds; ++round) {
    // Slopes and curvatures of what could still be seen as one line.
    const double reach = cells.reach_mm();
    Eigen::Matrix3d normal = Eigen::Vector3d(0.0, 1e-6, 1e-6 * reach * reach).asDiagonal();
    Eigen::Vector3d right = Eigen::Vector3d::Zero();
    for (std::size_t i = 0; i < members.size(); ++i) {
      const double weight = weights[i] / std::max(1e-6, members[i].sigma * members[i].sigma);
      const Eigen::Vector3d row(1.0, members[i].a, members[i].a * members[i].a);
      normal += weight * row * row.transpose();
      right += weight * members[i].b * row;
    }
    line.shape = normal.ldlt().solve(right);
    std::vector<double> off(members.size());
    for (std::size_t i = 0; i < members.size(); ++i) {
      const double a = members[i].a;
      off[i] = std::abs(members[i].b - line.shape.x() - line.shape.y() * a - line.shape.z() * a * a);
    }
    line.scatter_mm = std::max(kLeastScatter_mm, 1.4826 * math::median(off));
    for (std::size_t i = 0; i < members.size(); ++i) {
      const double ratio = off[i] / (kTukey * std::hypot(line.scatter_mm, members[i].sigma));
      weights[i] = ratio < 1.0 ? std::pow(1.0 - ratio * ratio, 2) : 0.0;
    }
  }
  line.known = line.shape.allFinite();
  return line;
}

}  // namespace

Result<RimCells> cells_of(const std::vector<RimCandidate>& rim, const Face& face, double cell_mm, ChamferSide side) {
  constexpr double kTurn = 2.0 * std::numbers::pi;
  if (rim.size() < kLeastMembers) {
    return fail(ErrorCode::kNoUniqueSolution, fmt::format("only {} edge pixels are left that may belong to a rim", rim.size()));
  }
  if (cell_mm == 0.0) {
    std::vector<double> pieces;
    for (const RimCandidate& candidate : rim) pieces.push_back(candidate.piece_mm);
    cell_mm = math::median(pieces);
  }
  const Eigen::Vector2d centre = centroid_of(rim, face);
  struct Polar {
    double angle, radius;
  };
  std::vector<Polar> polar;
  std::vector<std::vector<double>> sectors(kSectors);
  const auto sector_of = [&](double angle) {
    return std::min(kSectors - 1, static_cast<std::size_t>((angle + std::numbers::pi) / kTurn * static_cast<double>(kSectors)));
  };
  for (const RimCandidate& candidate : rim) {
    const Eigen::Vector2d at = face.local(candidate.point_mm).head<2>() - centre;
    polar.push_back({std::atan2(at.y(), at.x()), at.norm()});
    sectors[sector_of(polar.back().angle)].push_back(polar.back().radius);
  }
  // A coarse outline tells arc lengths; where it is empty the radius before it goes on.
  std::vector<double> radii(kSectors, 0.0);
  std::vector<double> known;
  for (std::size_t i = 0; i < kSectors; ++i) {
    if (sectors[i].empty()) continue;
    radii[i] = math::median(sectors[i]);
    known.push_back(radii[i]);
  }
  double last = math::median(known);
  for (double& radius : radii) last = radius = radius > 0.0 ? radius : last;
  std::vector<double> lengths(kSectors + 1, 0.0);
  for (std::size_t i = 0; i < kSectors; ++i) {
    const double change = radii[(i + 1) % kSectors] - radii[i];
    const double arc = radii[i] * kTurn / static_cast<double>(kSectors);
    lengths[i + 1] = lengths[i] + std::hypot(arc, std::min(std::abs(change), arc));
  }
  const auto count = static_cast<std::size_t>(std::max(1.0, std::round(lengths.back() / cell_mm)));
  const double width = lengths.back() / static_cast<double>(count);
  std::vector<RimCell> all(count);
  for (std::size_t i = 0; i < rim.size(); ++i) {
    const std::size_t sector = sector_of(polar[i].angle);
    const double part =
        (polar[i].angle + std::numbers::pi) / kTurn * static_cast<double>(kSectors) - static_cast<double>(sector);
    const double s = lengths[sector] + part * (lengths[sector + 1] - lengths[sector]);
    all[std::min(count - 1, static_cast<std::size_t>(s / width))].members.push_back(&rim[i]);
  }
  std::vector<RimCell> cells;
  for (RimCell& cell : all) {
    if (cell.members.empty()) continue;
    std::vector<double> x, y, z;
    Eigen::Vector3d out = Eigen::Vector3d::Zero();
    for (const RimCandidate* member : cell.members) {
      x.push_back(member->point_mm.x());
      y.push_back(member->point_mm.y());
      z.push_back(member->point_mm.z());
      out += member->out;
    }
    cell.middle_mm = Eigen::Vector3d(math::median(x), math::median(y), math::median(z));
    const Eigen::Vector3d normal = face.normal_at(cell.middle_mm);
    cell.across = (out - out.dot(normal) * normal).normalized();
    cell.along = cell.across.cross(normal);
    cell.inner.assign(cell.members.size(), 0);
    cells.push_back(std::move(cell));
  }
  const double reach = std::min(kReachCells * width, std::max(1.5 * width, kReachOfRadius * math::median(known)));
  std::vector<RimCell> marked = cells;
  if (side == ChamferSide::kNear) mark_inner(RimCells(cells, width, reach), marked);
  return RimCells(std::move(marked), width, reach);
}

RimLine line_about(const RimCells& cells, std::size_t at) {
  return line_of(cells, at, [](const RimCell& cell, std::size_t member) { return !cell.inner[member]; });
}

RimLine line_about(const RimCells& cells, std::size_t at, const std::function<bool(const RimCandidate&)>& takes) {
  return line_of(cells, at, [&](const RimCell& cell, std::size_t member) { return takes(*cell.members[member]); });
}

}  // namespace crosstie::edge::detail
