#include "edge/detail/opening.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>

#include "math/median.h"

namespace crosstie::edge::detail {
namespace {

constexpr std::size_t kDirections = 72;
constexpr int kGrid = 32;                 // places over the longer side of what the edges span
constexpr std::size_t kMostEdges = 1500;  // that the grid looks at
constexpr double kFacing =
    0.5;  // cosine between an edge's way out and the way to the middle: ovals as long as thrice their width
constexpr std::size_t kNone = std::numeric_limits<std::size_t>::max();

using Firsts = std::array<std::size_t, kDirections>;

struct Span {
  Eigen::Vector2d low = Eigen::Vector2d::Constant(std::numeric_limits<double>::infinity());
  Eigen::Vector2d high = -low;

  void add(const Eigen::Vector2d& at) {
    low = low.cwiseMin(at);
    high = high.cwiseMax(at);
  }
  [[nodiscard]] bool holds(const Eigen::Vector2d& at) const {
    return (at.array() >= low.array()).all() && (at.array() <= high.array()).all();
  }
};

std::size_t direction_of(const Eigen::Vector2d& way) {
  const double turn = (std::atan2(way.y(), way.x()) + std::numbers::pi) / (2.0 * std::numbers::pi);
  return std::min(kDirections - 1, static_cast<std::size_t>(turn * static_cast<double>(kDirections)));
}

bool faces(const FlatEdge& edge, const Eigen::Vector2d& way, double distance) {
  return -edge.out.dot(way) > kFacing * distance;
}

/// The nearest edge in each direction.
Firsts first_edges(const std::vector<FlatEdge>& edges, const Eigen::Vector2d& middle, std::size_t every) {
  Firsts firsts;
  firsts.fill(kNone);
  std::array<double, kDirections> nearest;
  nearest.fill(std::numeric_limits<double>::infinity());
  for (std::size_t i = 0; i < edges.size(); i += every) {
    const Eigen::Vector2d way = edges[i].at_mm - middle;
    const std::size_t direction = direction_of(way);
    const double square = way.squaredNorm();
    if (square >= nearest[direction]) continue;
    nearest[direction] = square;
    firsts[direction] = i;
  }
  return firsts;
}

/// How far the rim is in a direction as its neighbours tell; nothing where they do not show it.
constexpr std::size_t kBeside = 2;
using Distances = std::array<std::optional<double>, kDirections>;

std::vector<double> distances_beside(const Distances& distances, std::size_t direction) {
  std::vector<double> beside;
  for (std::size_t j = 0; j <= 2 * kBeside; ++j) {
    const auto& there = distances[(direction + kDirections + j - kBeside) % kDirections];
    if (there) beside.push_back(*there);
  }
  return beside;
}

/// Those with material beyond; `against` counts the others, which speak against an opening here.
Opening opening_at(const std::vector<FlatEdge>& edges, const Eigen::Vector2d& middle, std::size_t every, int& against) {
  Opening opening;
  opening.middle_mm = middle;
  against = 0;
  for (const std::size_t first : first_edges(edges, middle, every)) {
    if (first == kNone) continue;
    const Eigen::Vector2d way = edges[first].at_mm - middle;
    if (faces(edges[first], way, way.norm()))
      opening.rim.push_back(first);
    else
      ++against;
  }
  // A rim goes on from one direction to the next; edges that lie about by chance do not.
  constexpr double kLikeNeighbours = 0.15;
  Distances distances;
  for (const std::size_t i : opening.rim) {
    const Eigen::Vector2d way = edges[i].at_mm - middle;
    distances[direction_of(way)] = way.norm();
  }
  int connected = 0;
  for (std::size_t i = 0; i < kDirections; ++i) {
    const std::vector<double> beside = distances_beside(distances, i);
    if (!distances[i] || beside.size() <= kBeside) continue;
    const double expected = math::median(beside);
    if (std::abs(*distances[i] - expected) <= kLikeNeighbours * expected) ++connected;
  }
  opening.support = static_cast<double>(connected) / static_cast<double>(kDirections);
  return opening;
}

Span span_of(const std::vector<FlatEdge>& edges, const Opening& opening) {
  Span span;
  for (const std::size_t i : opening.rim) span.add(edges[i].at_mm);
  return span;
}

/// The middle between what is seen in opposite directions; nothing where too few of them show the rim.
std::optional<Eigen::Vector2d> middle_of(const std::vector<FlatEdge>& edges, const Opening& opening) {
  constexpr std::size_t kLeast = 6;
  std::array<std::size_t, kDirections> by_direction;
  by_direction.fill(kNone);
  for (const std::size_t i : opening.rim) by_direction[direction_of(edges[i].at_mm - opening.middle_mm)] = i;
  std::vector<double> x, y;
  for (std::size_t i = 0; i < kDirections / 2; ++i) {
    const std::size_t one = by_direction[i];
    const std::size_t other = by_direction[i + kDirections / 2];
    if (one == kNone || other == kNone) continue;
    const Eigen::Vector2d middle = 0.5 * (edges[one].at_mm + edges[other].at_mm);
    x.push_back(middle.x());
    y.push_back(middle.y());
  }
  if (x.size() < kLeast) return std::nullopt;
  return Eigen::Vector2d(math::median(x), math::median(y));
}

/// The opening about a place with its middle where it belongs: near a rim a few edges fill many directions.
Opening centred(const std::vector<FlatEdge>& edges, const Eigen::Vector2d& start) {
  constexpr int kRounds = 12;
  int against = 0;
  Opening opening = opening_at(edges, start, 1, against);
  for (int round = 0; round < kRounds; ++round) {
    const auto middle = middle_of(edges, opening);
    if (!middle) break;
    const Span span = span_of(edges, opening);
    const double moved = (*middle - opening.middle_mm).norm();
    opening = opening_at(edges, *middle, 1, against);
    if (moved < 1e-3 * (span.high - span.low).norm()) break;
  }
  return opening;
}

}  // namespace

std::vector<Opening> find_openings(const std::vector<FlatEdge>& edges, std::size_t most) {
  if (edges.empty()) return {};
  Span all;
  for (const FlatEdge& edge : edges) all.add(edge.at_mm);
  const std::size_t every = (edges.size() + kMostEdges - 1) / kMostEdges;
  const double step = (all.high - all.low).maxCoeff() / kGrid;
  struct Place {
    Eigen::Vector2d at;
    int score;
  };
  std::vector<Place> places;
  for (double y = all.low.y() + 0.5 * step; y < all.high.y(); y += step) {
    for (double x = all.low.x() + 0.5 * step; x < all.high.x(); x += step) {
      int against = 0;
      const Opening here = opening_at(edges, {x, y}, every, against);
      const int score = static_cast<int>(here.rim.size()) - against;
      if (score > 0) places.push_back({{x, y}, score});
    }
  }
  std::stable_sort(places.begin(), places.end(), [](const Place& a, const Place& b) { return a.score > b.score; });
  std::vector<Opening> openings;
  std::vector<Span> taken;
  for (const Place& place : places) {
    if (openings.size() == most) break;
    const auto inside = [&](const Eigen::Vector2d& at) {
      return std::any_of(taken.begin(), taken.end(), [&](const Span& span) { return span.holds(at); });
    };
    if (inside(place.at)) continue;
    Opening opening = centred(edges, place.at);
    taken.push_back(span_of(edges, opening));
    openings.push_back(std::move(opening));
  }
  std::stable_sort(openings.begin(), openings.end(), [](const Opening& a, const Opening& b) { return a.support > b.support; });
  return openings;
}

std::vector<std::size_t> rim_edges(const std::vector<FlatEdge>& edges, const Opening& opening, double slack_mm) {
  // How far the rim is in each direction, single strays left out: the median of a direction and its neighbours.
  Distances far;
  for (const std::size_t i : opening.rim) {
    const Eigen::Vector2d way = edges[i].at_mm - opening.middle_mm;
    far[direction_of(way)] = way.norm();
  }
  struct Reach {
    double low = 0.0, high = -1.0;
  };
  std::array<Reach, kDirections> reaches;
  for (std::size_t i = 0; i < kDirections; ++i) {
    const std::vector<double> beside = distances_beside(far, i);
    if (beside.empty()) continue;
    const double middle = math::median(beside);
    // The rim of an oval goes away from the middle within a direction as it does between directions.
    double change = 0.0;
    for (const double one : beside) change = std::max(change, std::min(std::abs(one - middle), 0.2 * middle));
    reaches[i] = {middle - change - slack_mm, middle + change + slack_mm};
  }
  std::vector<std::size_t> rim;
  for (std::size_t i = 0; i < edges.size(); ++i) {
    const Eigen::Vector2d way = edges[i].at_mm - opening.middle_mm;
    const double distance = way.norm();
    const Reach& reach = reaches[direction_of(way)];
    if (distance >= reach.low && distance <= reach.high && faces(edges[i], way, distance)) rim.push_back(i);
  }
  return rim;
}

}  // namespace crosstie::edge::detail
