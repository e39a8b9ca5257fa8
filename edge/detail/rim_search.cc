#include "edge/detail/rim_search.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include <fmt/format.h>
#include <Eigen/Geometry>

#include "edge/detail/opening.h"

namespace crosstie::edge::detail {
namespace {

using base::ErrorCode;
using base::fail;
using base::Result;

constexpr std::size_t kWindows = 8;    // places of an image at which a hole is looked for
constexpr double kMargin = 0.3;        // of a window about what an opening spans, in its extent
constexpr double kLeastSupport = 0.5;  // of a hole that is found without a region
constexpr double kNearlyAsGood = 0.8;  // of the best support: another hole
constexpr double kLeastMargin_mm = 10.0;

/// Those on the face and not under a mask.
std::vector<RimCandidate> on_face(const std::vector<RimCandidate>& candidates, const Face& face, const HoleEdgeOptions& options,
                                  HoleEdge::Counts& counts, LostEdges& lost) {
  std::vector<RimCandidate> kept;
  for (const RimCandidate& candidate : candidates) {
    const bool off = std::abs(face.off_mm(candidate.point_mm)) > options.max_off_face_mm ||
                     candidate.normal.dot(face.normal_at(candidate.point_mm)) < std::cos(options.max_turn_rad);
    if (off) {
      ++counts.off_face;
      lost.emplace_back(candidate.point_mm, "the edge there is that of another surface");
      continue;
    }
    const auto mask = std::find_if(options.masks.begin(), options.masks.end(), [&](const MaskedDisc& disc) {
      return (candidate.point_mm - disc.centre_mm).norm() < disc.radius_mm;
    });
    if (mask != options.masks.end()) {
      ++counts.masked;
      lost.emplace_back(candidate.point_mm, mask->name + " lies there");
      continue;
    }
    kept.push_back(candidate);
  }
  return kept;
}

/// Without those before which another edge of the same camera lies, nearer to the material: of a thick wall's far rim, seen through the hole, some
/// lie so near to the rim that its face is carried on to them.
std::vector<RimCandidate> without_far_rim(const std::vector<RimCandidate>& candidates, HoleEdge::Counts& counts,
                                          LostEdges& lost) {
  // In pieces of edge, some ten pixels long.
  constexpr double kAlong = 0.5;
  constexpr double kLeast = 0.15;  // noise along one edge stays below
  constexpr double kMost = 0.6;    // the face is not carried farther
  std::vector<RimCandidate> kept;
  for (const RimCandidate& one : candidates) {
    const bool far = std::any_of(candidates.begin(), candidates.end(), [&](const RimCandidate& other) {
      if (other.station != one.station || other.camera != one.camera) return false;
      const Eigen::Vector3d d = one.point_mm - other.point_mm;
      const double across = one.out.dot(d);
      if (!(across > kLeast * one.piece_mm && across < kMost * one.piece_mm) || other.out.dot(one.out) < 0.8) return false;
      // The far side of its own band: a chamfer, of which detail/chamfer_side.h takes one side.
      if (other.band_mm > 0.0 && std::abs(across - other.band_mm) < kLeast * one.piece_mm) return false;
      return (d - across * one.out).norm() < kAlong * one.piece_mm;
    });
    if (!far) {
      kept.push_back(one);
      continue;
    }
    ++counts.inner;
    lost.emplace_back(one.point_mm, "only the far side of the wall was seen");
  }
  return kept;
}

/// Edges as they lie in the plane of two axes.
std::vector<FlatEdge> flattened(const std::vector<RimCandidate>& candidates, const Eigen::Vector3d& origin_mm,
                                const Eigen::Matrix<double, 3, 2>& axes) {
  std::vector<FlatEdge> edges;
  for (const RimCandidate& candidate : candidates) {
    const Eigen::Vector2d out = axes.transpose() * candidate.out;
    edges.push_back({axes.transpose() * (candidate.point_mm - origin_mm), out.normalized()});
  }
  return edges;
}

Result<FoundRim> rim_among(const std::vector<RimCandidate>& candidates, const HoleEdgeOptions& options,
                           HoleEdge::Counts& counts, LostEdges& lost) {
  auto face = find_face(candidates, options.max_off_face_mm);
  if (!face) return tl::unexpected(face.error());
  FoundRim found;
  found.face = *face;
  const auto kept = without_far_rim(on_face(candidates, *face, options, counts, lost), counts, lost);
  const auto edges = flattened(kept, face->origin_mm, face->axes.leftCols<2>());
  const auto openings = find_openings(edges, 1);
  if (openings.empty()) return fail(ErrorCode::kNoUniqueSolution, "no edge of the face in the region has a hole beside it");
  const Opening& opening = openings.front();
  for (const std::size_t i : rim_edges(edges, opening, options.max_off_face_mm)) found.rim.push_back(kept[i]);
  counts.inwards += static_cast<std::int64_t>(kept.size() - found.rim.size());
  found.middle_mm = face->origin_mm + face->axes.leftCols<2>() * opening.middle_mm;
  found.support = opening.support;
  return found;
}

/// Candidates about each of the openings as the cameras see them.
std::vector<std::vector<RimCandidate>> windows_of(const std::vector<RimCandidate>& candidates) {
  Eigen::Vector3d towards = Eigen::Vector3d::Zero();
  for (const RimCandidate& candidate : candidates) towards -= candidate.ray;
  towards.normalize();
  Eigen::Matrix<double, 3, 2> axes;
  axes.col(0) = towards.unitOrthogonal();
  axes.col(1) = towards.cross(axes.col(0));
  const auto edges = flattened(candidates, Eigen::Vector3d::Zero(), axes);
  std::vector<std::vector<RimCandidate>> windows;
  for (const Opening& opening : find_openings(edges, kWindows)) {
    Eigen::Vector2d low = opening.middle_mm, high = opening.middle_mm;
    for (const std::size_t i : opening.rim) {
      low = low.cwiseMin(edges[i].at_mm);
      high = high.cwiseMax(edges[i].at_mm);
    }
    const Eigen::Vector2d margin = (kMargin * (high - low)).cwiseMax(kLeastMargin_mm);
    std::vector<RimCandidate>& window = windows.emplace_back();
    for (std::size_t i = 0; i < edges.size(); ++i) {
      const Eigen::Vector2d& at = edges[i].at_mm;
      if ((at.array() >= (low - margin).array()).all() && (at.array() <= (high + margin).array()).all())
        window.push_back(candidates[i]);
    }
  }
  return windows;
}

}  // namespace

Result<FoundRim> find_rim(const std::vector<RimCandidate>& candidates, const HoleEdgeOptions& options, HoleEdge::Counts& counts,
                          LostEdges& lost) {
  if (options.roi_px || options.expected) return rim_among(candidates, options, counts, lost);
  struct Try {
    FoundRim rim;
    HoleEdge::Counts counts;
    LostEdges lost;
  };
  std::vector<Try> tries;
  for (const auto& window : windows_of(candidates)) {
    Try one{{}, counts, lost};
    auto found = rim_among(window, options, one.counts, one.lost);
    if (!found) continue;
    one.rim = *std::move(found);
    tries.push_back(std::move(one));
  }
  std::stable_sort(tries.begin(), tries.end(), [](const Try& a, const Try& b) { return a.rim.support > b.rim.support; });
  if (tries.empty() || tries.front().rim.support < kLeastSupport) {
    return fail(
        ErrorCode::kNoUniqueSolution,
        fmt::format(
            "no hole stands out in the whole image: the rim of the best supported one is seen in {:.0f} % of the directions "
            "from its middle, and {:.0f} % are asked for; give the region of the image in which it lies",
            tries.empty() ? 0.0 : 100.0 * tries.front().rim.support, 100.0 * kLeastSupport));
  }
  Try& best = tries.front();
  for (std::size_t i = 1; i < tries.size(); ++i) {
    const FoundRim& other = tries[i].rim;
    const bool same = (other.middle_mm - best.rim.middle_mm).norm() < 2.0 * options.max_off_face_mm;
    if (!same && other.support >= kNearlyAsGood * best.rim.support) best.rim.others_mm.push_back(other.middle_mm);
  }
  counts = best.counts;
  lost = std::move(best.lost);
  return std::move(best.rim);
}

}  // namespace crosstie::edge::detail
