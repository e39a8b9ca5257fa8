#include "scan/detail/edge_class.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "scan/detail/small_factor.h"

namespace crosstie::scan::detail {
namespace {

using base::EdgeClass;

constexpr double kGuard_px = 2.5;  // pixels nearer to the edge see both sides
constexpr double kDepth_px = 7.0;  // how far from there on phases are looked at
constexpr double kHalfWidth_px = 5.0;
constexpr std::size_t kLeastPixels = 15;
constexpr double kSlack_px = 1.5;  // deviation of a phase that goes on, in pixels of its own slope: surfaces are curved
constexpr double kSigmas = 5.0;
constexpr int kAcross_px = 200;    // how far a shadow may reach
constexpr double kNearer = 0.004;  // of the depth, from which on a surface counts as nearer

/// A plane through values over a piece of the image, robust against a few strays.
struct Trend {
  Eigen::Vector3d at = Eigen::Vector3d::Zero();  ///< value, slope across, slope along
  double rms = 0.0;
  std::size_t count = 0;

  [[nodiscard]] double value(double t, double s) const { return at.x() + at.y() * t + at.z() * s; }
};

struct Place {
  double t, s, value;
};

Trend trend_of(const std::vector<Place>& places) {
  using Factor = SmallFactor<3>;
  Trend trend;
  double limit = std::numeric_limits<double>::infinity();
  std::vector<double> off;
  for (int round = 0; round < 3; ++round) {
    Factor::Matrix normal = {{{1e-9}, {0.0, 1e-9}, {0.0, 0.0, 1e-9}}};
    Factor::Vector right = {};
    trend.count = 0;
    for (const Place& place : places) {
      if (round > 0 && std::abs(place.value - trend.value(place.t, place.s)) > limit) continue;
      normal[0][0] += 1.0;
      normal[1][0] += place.t;
      normal[1][1] += place.t * place.t;
      normal[2][0] += place.s;
      normal[2][1] += place.s * place.t;
      normal[2][2] += place.s * place.s;
      right[0] += place.value;
      right[1] += place.value * place.t;
      right[2] += place.value * place.s;
      ++trend.count;
    }
    if (trend.count < 4) return trend;
    const Factor::Vector solution = Factor(normal, 3).solve(right);
    trend.at = {solution[0], solution[1], solution[2]};
    off.clear();
    for (const Place& place : places) off.push_back(std::abs(place.value - trend.value(place.t, place.s)));
    trend.rms = 1.4826 * middle(off);
    limit = 3.5 * trend.rms + 1e-9;
  }
  return trend;
}

/// Whether the phases beyond go on as those before; nothing: there are too few.
struct Continuation {
  bool before = false;  ///< there is a surface
  bool beyond = false;  ///< there are phases
  bool smooth = true;   ///< they go on as those before
};

/// The phases of a strip beyond an edge, whose depth is `depth_px`, against those before it.
Continuation continuation(const base::PhaseMap& map, const base::PhasePlane& plane, const EdgeImages& images,
                          const PieceFrame& frame, double beyond_px, double depth_px) {
  std::vector<Place> before;
  std::vector<double> sigmas;
  images.for_each(frame, kHalfWidth_px, -kGuard_px - kDepth_px, -kGuard_px, [&](std::size_t at, double t, double s) {
    if (map.status[at] != base::PhaseStatus::kValid) return;
    before.push_back({t, s, plane.turns[at]});
    sigmas.push_back(plane.sigma_turns[at]);
  });
  Continuation result;
  if (before.size() < kLeastPixels) return result;
  const Trend trend = trend_of(before);
  if (trend.count < kLeastPixels) return result;
  result.before = true;
  const double slope = std::hypot(trend.at.y(), trend.at.z());
  const double sigma = middle(sigmas);
  std::vector<double> off;
  std::size_t seen = 0;
  images.for_each(frame, kHalfWidth_px, beyond_px + kGuard_px, beyond_px + kGuard_px + depth_px,
                  [&](std::size_t at, double t, double s) {
                    ++seen;
                    if (map.status[at] == base::PhaseStatus::kValid)
                      off.push_back(static_cast<double>(plane.turns[at]) - trend.value(t, s));
                  });
  result.beyond = off.size() >= kLeastPixels && 2 * off.size() >= seen;
  if (!result.beyond) return result;
  // Phases extrapolated by as far as they were seen are known four times worse than their mean.
  const double extrapolated = 4.0 * std::max(sigma, trend.rms) / std::sqrt(static_cast<double>(trend.count));
  result.smooth = std::abs(middle(off)) <= kSlack_px * slope + kSigmas * extrapolated;
  return result;
}

std::optional<double> depth_about(const std::vector<float>& depth_mm, const EdgeImages& images, const PieceFrame& frame,
                                  double from_px, double to_px) {
  std::vector<double> depths;
  images.for_each(frame, kHalfWidth_px, from_px, to_px, [&](std::size_t at, double, double) {
    if (!std::isnan(depth_mm[at])) depths.push_back(depth_mm[at]);
  });
  if (depths.size() < 6) return std::nullopt;
  return middle(depths);
}

}  // namespace

std::optional<EdgeClass> classify_edge(const base::PhaseMap& map, const std::vector<float>* depth_mm, const EdgeImages& images,
                                       const PieceFrame& frame, double beyond_px) {
  bool beyond = true;
  bool smooth = true;
  for (const auto* plane : {&map.x, &map.y}) {
    if (!*plane) continue;
    const Continuation here = continuation(map, **plane, images, frame, beyond_px, kDepth_px);
    if (!here.before) return std::nullopt;
    beyond = beyond && here.beyond;
    smooth = smooth && here.smooth;
  }
  if (beyond && smooth) return EdgeClass::kPaint;
  if (depth_mm == nullptr) return EdgeClass::kMaterial;
  const auto own = depth_about(*depth_mm, images, frame, -kGuard_px - kDepth_px - 2.0, -kGuard_px);
  if (!own) return EdgeClass::kMaterial;
  if (beyond) {
    const auto other = depth_about(*depth_mm, images, frame, beyond_px + kGuard_px, beyond_px + kGuard_px + kDepth_px + 2.0);
    // A bend goes either way; a jump to nearer material is that material's edge.
    const auto slopes = depth_slopes(*depth_mm, images, frame);
    const double allowed =
        kNearer * *own + (slopes ? 10.0 * std::max(std::abs(slopes->before), std::abs(slopes->beyond)) : 0.0);
    if (other && *other < *own - allowed) return std::nullopt;
    return EdgeClass::kMaterial;
  }
  // What follows across the dark.
  for (int step = 4; step < kAcross_px; step += 2) {
    PieceFrame there = frame;
    there.origin_px += (beyond_px + step) * frame.out;
    if (there.origin_px.minCoeff() < 0.0 || there.origin_px.x() > map.width - 1 || there.origin_px.y() > map.height - 1) break;
    const auto depth = depth_about(*depth_mm, images, there, 0.0, 4.0);
    if (!depth) continue;
    return *depth < (1.0 - kNearer) * *own ? EdgeClass::kShadow : EdgeClass::kMaterial;
  }
  return EdgeClass::kMaterial;
}

bool ends_here(const base::PhaseMap& map, const EdgeImages& images, const PieceFrame& frame, double beyond_px) {
  constexpr double kStrip_px = 3.0;
  for (const auto* plane : {&map.x, &map.y}) {
    if (!*plane) continue;
    const Continuation here = continuation(map, **plane, images, frame, beyond_px, kStrip_px);
    if (!here.beyond || !here.smooth) return true;
  }
  return false;
}

std::optional<DepthSlopes> depth_slopes(const std::vector<float>& depth_mm, const EdgeImages& images, const PieceFrame& frame) {
  std::array<std::vector<Place>, 2> places;
  images.for_each(frame, kHalfWidth_px, -kGuard_px - kDepth_px - 2.0, kGuard_px + kDepth_px + 2.0,
                  [&](std::size_t at, double t, double s) {
                    if (std::abs(t) < kGuard_px || std::isnan(depth_mm[at])) return;
                    places[t < 0.0 ? 0 : 1].push_back({t, s, depth_mm[at]});
                  });
  if (places[0].size() < kLeastPixels || places[1].size() < kLeastPixels) return std::nullopt;
  return DepthSlopes{trend_of(places[0]).at.y(), trend_of(places[1]).at.y()};
}

}  // namespace crosstie::scan::detail
