#include "registration/detail/start.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <random>

#include <fmt/format.h>
#include <Eigen/Geometry>

namespace crosstie::registration::detail {
namespace {

using base::ErrorCode;
using base::fail;
using base::Pose;
using base::Result;
using Eigen::Vector3d;
using math::AlignmentPair;

constexpr double kSigmas = 5.0;
constexpr std::size_t kAllTriples = 12;  // of up to so many pairs every three are tried: 220
constexpr int kDrawnTriples = 400;
constexpr int kRefinements = 3;
constexpr int kLeastCommon = 3;

bool within(const AlignmentPair& pair, const Pose& a_from_b, double tolerance_mm) {
  const double sigma = std::sqrt((pair.cov_a_mm2 + pair.cov_b_mm2).trace() / 3.0);
  return (pair.a_mm - a_from_b * pair.b_mm).norm() <= tolerance_mm + kSigmas * sigma;
}

/// A thing that knows places of markers: a station, or the list (the last one).
struct Node {
  std::map<int, std::size_t> at;  ///< index of the sighting by id
  std::vector<Vector3d> place;
  std::vector<Eigen::Matrix3d> cov;
};

std::vector<Node> nodes_of(const StitchInput& input) {
  std::vector<Node> nodes;
  for (const StationScan& station : input.stations) {
    Node& node = nodes.emplace_back();
    for (const Sighting& sighting : station.markers) {
      node.at.emplace(sighting.id, node.place.size());
      node.place.push_back(sighting.p_in_rig_mm);
      node.cov.push_back(sighting.cov_mm2);
    }
  }
  if (input.reference) {
    Node& node = nodes.emplace_back();
    for (std::size_t i = 0; i < input.reference->points.ids.size(); ++i) {
      const auto row = 3 * static_cast<Eigen::Index>(i);
      node.at.emplace(input.reference->points.ids[i], i);
      node.place.emplace_back(input.reference->points.xyz_mm.segment<3>(row));
      node.cov.emplace_back(input.reference->points.cov_mm2.block<3, 3>(row, row));
    }
  }
  return nodes;
}

/// What two nodes say of their common markers.
struct Edge {
  std::size_t a = 0;
  std::size_t b = 0;
  std::vector<int> ids;
  std::optional<Consensus> consensus;  ///< a_from_b; nothing: too few common markers
};

std::string node_name(const StitchInput& input, std::size_t node) {
  return node < input.stations.size() ? fmt::format("station '{}'", input.stations[node].name)
                                      : std::string("the list of reference coordinates");
}

Result<std::vector<Edge>> edges_of(const StitchInput& input, const std::vector<Node>& nodes, double tolerance_mm) {
  std::vector<Edge> edges;
  for (std::size_t a = 0; a < nodes.size(); ++a) {
    for (std::size_t b = a + 1; b < nodes.size(); ++b) {
      Edge edge{a, b, {}, {}};
      std::vector<AlignmentPair> pairs;
      for (const auto& [id, at] : nodes[a].at) {
        const auto other = nodes[b].at.find(id);
        if (other == nodes[b].at.end()) continue;
        edge.ids.push_back(id);
        pairs.push_back({nodes[a].place[at], nodes[b].place[other->second], nodes[a].cov[at], nodes[b].cov[other->second]});
      }
      if (edge.ids.empty()) continue;
      edge.consensus = find_consensus(pairs, tolerance_mm);
      if (!edge.consensus && edge.ids.size() > kLeastCommon) {
        return fail(
            ErrorCode::kBadInput,
            fmt::format("{} and {} have {} markers in common, but no three of them lie alike in both: ids are swapped or "
                        "misread, markers were moved, or a list has another unit",
                        node_name(input, a), node_name(input, b), edge.ids.size()));
      }
      edges.push_back(std::move(edge));
    }
  }
  return edges;
}

/// Poses that are known without markers, and where they come from.
Result<std::vector<std::optional<Pose>>> known_poses(const StitchInput& input) {
  std::vector<std::optional<Pose>> poses(input.stations.size());
  for (std::size_t k = 0; k < poses.size(); ++k) {
    const StationScan& station = input.stations[k];
    if (input.commissioned && station.axis_mm) {
      auto at = input.commissioned->frame.at(*station.axis_mm);
      if (!at) return fail(at.error().code, fmt::format("station '{}': {}", station.name, at.error().message));
      poses[k] = at->machine_from_rig;
    } else if (station.start) {
      poses[k] = *station.start;
    }
  }
  return poses;
}

/// Joins the nodes that are not placed yet to those that are, the best consensus first.
void grow(const std::vector<Edge>& edges, std::vector<std::optional<Pose>>& poses) {
  for (;;) {
    const Edge* best = nullptr;
    for (const Edge& edge : edges) {
      if (!edge.consensus || poses[edge.a].has_value() == poses[edge.b].has_value()) continue;
      if (best == nullptr || edge.consensus->agreeing > best->consensus->agreeing) best = &edge;
    }
    if (best == nullptr) return;
    if (poses[best->a]) {
      poses[best->b] = *poses[best->a] * best->consensus->a_from_b;
    } else {
      poses[best->a] = *poses[best->b] * best->consensus->a_from_b.inverse();
    }
  }
}

/// For each marker the groups of nodes that agree on its place.
class Agreement {
 public:
  explicit Agreement(std::size_t nodes) : parent_(nodes) { std::iota(parent_.begin(), parent_.end(), std::size_t{0}); }
  std::size_t root(std::size_t node) {
    while (parent_[node] != node) node = parent_[node] = parent_[parent_[node]];
    return node;
  }
  void join(std::size_t a, std::size_t b) { parent_[std::max(root(a), root(b))] = std::min(root(a), root(b)); }

 private:
  std::vector<std::size_t> parent_;
};

class Judge {
 public:
  Judge(const StitchInput& input, const std::vector<Node>& nodes, const std::vector<Edge>& edges,
        const std::vector<std::optional<Pose>>& poses, double tolerance_mm)
      : input_(input), nodes_(nodes), edges_(edges), poses_(poses), tolerance_mm_(tolerance_mm) {}

  /// Nodes whose place of the marker is not that of the largest group.
  std::map<int, std::vector<std::size_t>> odd_ones() const {
    std::map<int, Agreement> agreements;
    for (const Edge& edge : edges_) {
      for (std::size_t i = 0; i < edge.ids.size(); ++i) {
        auto& agreement = agreements.try_emplace(edge.ids[i], nodes_.size()).first->second;
        if (!edge.consensus || edge.consensus->agrees[i]) agreement.join(edge.a, edge.b);
      }
    }
    std::map<int, std::vector<std::size_t>> odd;
    for (auto& [id, agreement] : agreements) {
      std::map<std::size_t, std::vector<std::size_t>> groups;
      for (std::size_t n = 0; n < nodes_.size(); ++n) {
        if (nodes_[n].at.contains(id)) groups[agreement.root(n)].push_back(n);
      }
      if (groups.size() < 2) continue;
      std::size_t largest = 0;
      for (const auto& [root, group] : groups) largest = std::max(largest, group.size());
      // Of groups of one size the one with the list counts; without it nobody knows.
      const auto counts = [&](const std::vector<std::size_t>& group) {
        const bool with_list = input_.reference && group.back() == input_.stations.size();
        const auto rivals =
            std::count_if(groups.begin(), groups.end(), [&](const auto& g) { return g.second.size() == largest; });
        return group.size() == largest && (rivals == 1 || with_list);
      };
      for (const auto& [root, group] : groups) {
        if (!counts(group)) odd[id].insert(odd[id].end(), group.begin(), group.end());
      }
    }
    return odd;
  }

  base::RejectedSighting rejected(std::size_t node, int id, const std::map<int, std::vector<std::size_t>>& odd) const {
    base::RejectedSighting result;
    result.station = node < input_.stations.size() ? static_cast<int>(node) : -1;
    result.id = id;
    const Vector3d& own = nodes_[node].place[nodes_[node].at.at(id)];
    std::string other_name;
    for (const Edge& edge : edges_) {
      if (!edge.consensus || (edge.a != node && edge.b != node)) continue;
      const std::size_t other = edge.a == node ? edge.b : edge.a;
      const Pose other_from_node = edge.a == node ? edge.consensus->a_from_b.inverse() : edge.consensus->a_from_b;
      const Vector3d seen = other_from_node * own;
      const auto same = nodes_[other].at.find(id);
      if (same != nodes_[other].at.end()) {
        const double off = (seen - nodes_[other].place[same->second]).norm();
        if (off > result.distance_mm) {
          result.distance_mm = off;
          other_name = node_name(input_, other);
        }
      }
      for (const auto& [its_id, at] : nodes_[other].at) {
        const double sigma = std::sqrt((nodes_[other].cov[at] + nodes_[node].cov[nodes_[node].at.at(id)]).trace() / 3.0);
        if (its_id == id || (seen - nodes_[other].place[at]).norm() > tolerance_mm_ + kSigmas * sigma) continue;
        const auto its_odd = odd.find(its_id);
        const bool both =
            its_odd != odd.end() && std::find(its_odd->second.begin(), its_odd->second.end(), node) != its_odd->second.end();
        result.reason = both ? fmt::format("ids {} and {} are swapped in {}", std::min(id, its_id), std::max(id, its_id),
                                           node_name(input_, node))
                             : fmt::format("it lies where {} has marker {}: its id is wrong", node_name(input_, other), its_id);
        result.distance_mm =
            same != nodes_[other].at.end() ? (seen - nodes_[other].place[same->second]).norm() : result.distance_mm;
        return result;
      }
    }
    result.reason =
        result.station < 0
            ? fmt::format("it lies {:.2f} mm from where {} sees it: the marker was moved after its coordinates were measured",
                          result.distance_mm, other_name)
            : fmt::format("it lies {:.2f} mm from where {} has it: the marker was moved in between, or misread",
                          result.distance_mm, other_name);
    return result;
  }

 private:
  const StitchInput& input_;
  const std::vector<Node>& nodes_;
  const std::vector<Edge>& edges_;
  const std::vector<std::optional<Pose>>& poses_;
  double tolerance_mm_;
};

Result<> check_joined(const StitchInput& input, const std::vector<Node>& nodes, const std::vector<std::optional<Pose>>& poses) {
  for (std::size_t k = 0; k < input.stations.size(); ++k) {
    if (poses[k]) continue;
    std::size_t most = 0;
    std::string with = "any other";
    for (std::size_t n = 0; n < nodes.size(); ++n) {
      if (n == k || !poses[n]) continue;
      const auto common = static_cast<std::size_t>(std::count_if(
          nodes[k].at.begin(), nodes[k].at.end(), [&](const auto& seen) { return nodes[n].at.contains(seen.first); }));
      if (common <= most) continue;
      most = common;
      with = node_name(input, n);
    }
    return fail(
        ErrorCode::kNoUniqueSolution,
        fmt::format(
            "station '{}' sees {} markers and shares {} with {}; three that are not on one line are needed to join it, or "
            "the reading of a commissioned axis",
            input.stations[k].name, nodes[k].at.size(), most, with));
  }
  return {};
}

}  // namespace

std::optional<Consensus> find_consensus(const std::vector<AlignmentPair>& pairs, double tolerance_mm) {
  const std::size_t count = pairs.size();
  if (count < kLeastCommon) return {};
  std::vector<std::array<std::size_t, 3>> triples;
  if (count <= kAllTriples) {
    for (std::size_t i = 0; i < count; ++i) {
      for (std::size_t j = i + 1; j < count; ++j) {
        for (std::size_t k = j + 1; k < count; ++k) triples.push_back({i, j, k});
      }
    }
  } else {
    std::mt19937 random(1);
    while (triples.size() < kDrawnTriples) {
      const std::array<std::size_t, 3> triple = {random() % count, random() % count, random() % count};
      if (triple[0] != triple[1] && triple[0] != triple[2] && triple[1] != triple[2]) triples.push_back(triple);
    }
  }
  Consensus best;
  double best_sum = 0.0;
  const auto judge = [&](const Pose& a_from_b) {
    Consensus now;
    now.a_from_b = a_from_b;
    double sum = 0.0;
    for (const AlignmentPair& pair : pairs) {
      now.agrees.push_back(within(pair, a_from_b, tolerance_mm));
      if (!now.agrees.back()) continue;
      ++now.agreeing;
      sum += (pair.a_mm - a_from_b * pair.b_mm).squaredNorm();
    }
    return std::pair(std::move(now), sum);
  };
  for (const auto& triple : triples) {
    const std::array<AlignmentPair, 3> three = {pairs[triple[0]], pairs[triple[1]], pairs[triple[2]]};
    const auto fit = math::align(three, {.with_scale = false, .weighted = false});
    if (!fit) continue;
    auto [now, sum] = judge(fit->a_from_b);
    if (now.agreeing < kLeastCommon || now.agreeing < best.agreeing || (now.agreeing == best.agreeing && sum >= best_sum))
      continue;
    best = std::move(now);
    best_sum = sum;
  }
  if (best.agreeing < kLeastCommon) return {};
  for (int round = 0; round < kRefinements; ++round) {
    std::vector<AlignmentPair> good;
    for (std::size_t i = 0; i < count; ++i) {
      if (best.agrees[i]) good.push_back(pairs[i]);
    }
    const auto fit = math::align(good);
    if (!fit) return {};
    auto [now, sum] = judge(fit->a_from_b);
    if (now.agreeing < best.agreeing) return {};
    const bool same = now.agrees == best.agrees;
    best = std::move(now);
    best.cov = fit->covariance.topLeftCorner<6, 6>();
    if (same) break;
  }
  return best;
}

Result<Start> find_start(const StitchInput& input, const StitchOptions& options) {
  const std::vector<Node> nodes = nodes_of(input);
  const auto edges = edges_of(input, nodes, options.marker_tolerance_mm);
  if (!edges) return tl::unexpected(edges.error());
  auto known = known_poses(input);
  if (!known) return tl::unexpected(known.error());
  std::vector<std::optional<Pose>> poses = *std::move(known);
  const std::size_t stations = input.stations.size();
  const bool any = std::any_of(poses.begin(), poses.end(), [](const auto& pose) { return pose.has_value(); });
  Start start;
  if (input.reference) {
    // A list in a frame of its own is placed by the stations where these have places; else it is the frame.
    poses.emplace_back();
    if (!input.reference->own_frame || !any) poses.back() = Pose{};
  } else if (!any) {
    poses.front() = Pose{};
  }
  grow(*edges, poses);
  if (auto joined = check_joined(input, nodes, poses); !joined) return fail(std::move(joined));
  if (input.reference && !poses.back()) {
    return fail(ErrorCode::kNoUniqueSolution,
                "the list of reference coordinates shares fewer than three markers with every station");
  }

  for (std::size_t k = 0; k < stations; ++k) start.machine_from_rig.push_back(*poses[k]);
  const bool on_axis = input.commissioned && std::any_of(input.stations.begin(), input.stations.end(),
                                                         [](const auto& s) { return s.axis_mm.has_value(); });
  if (input.reference && input.reference->own_frame && on_axis) start.machine_from_part = *poses.back();
  start.datum_is_first = !input.reference && !on_axis;
  for (const Edge& edge : *edges) {
    if (!edge.consensus) continue;
    // Of the second's markers as the first places them.
    double square = 0.0;
    for (std::size_t i = 0; i < edge.ids.size(); ++i) {
      const Vector3d at = edge.consensus->a_from_b * nodes[edge.b].place[nodes[edge.b].at.at(edge.ids[i])];
      Eigen::Matrix<double, 3, 6> by_pose;
      by_pose << -base::skew(at), Eigen::Matrix3d::Identity();
      square = std::max(square, (by_pose * edge.consensus->cov * by_pose.transpose()).trace());
    }
    start.sigma_mm = std::max(start.sigma_mm, std::sqrt(square));
  }

  const Judge judge(input, nodes, *edges, poses, options.marker_tolerance_mm);
  const auto odd = judge.odd_ones();
  for (const StationScan& station : input.stations) start.active.emplace_back(station.markers.size(), true);
  if (input.reference) start.listed.assign(input.reference->points.ids.size(), true);
  for (const auto& [id, nodes_of_id] : odd) {
    for (const std::size_t node : nodes_of_id) {
      start.rejected.push_back(judge.rejected(node, id, odd));
      (node < stations ? start.active[node] : start.listed)[nodes[node].at.at(id)] = false;
    }
  }
  return start;
}

}  // namespace crosstie::registration::detail
