#include "calib/detail/rig_start.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

namespace crosstie::calib::detail {
namespace {

struct Pair {
  int station = 0;
  base::Pose left_from_right;
  base::Pose turned;  ///< the same with the right corners counted from the other end
  double distance_mm = 0.0;
};

/// How far two rigs are apart, as a part of the distance at which they see the board.
double apart(const base::Pose& a, const base::Pose& b, double distance_mm) {
  const double turn = base::rotation_log(a.rotation.conjugate() * b.rotation).norm();
  return std::max(turn, (a.translation_mm - b.translation_mm).norm() / distance_mm);
}

std::vector<Pair> find_pairs(const Problem& problem, const State& state) {
  const base::Pose half_turn{Eigen::Quaterniond(0.0, 0.0, 0.0, 1.0), Eigen::Vector3d::Zero()};  // about the board's middle
  std::vector<Pair> pairs;
  for (std::size_t s = 0; s < problem.stations.size(); ++s) {
    const Station& station = problem.stations[s];
    if (!station.paired() || !state.takes_part(station.view[0]) || !state.takes_part(station.view[1])) continue;
    const base::Pose& board_from_left = *state.board_from_camera[static_cast<std::size_t>(station.view[0])];
    const base::Pose& board_from_right = *state.board_from_camera[static_cast<std::size_t>(station.view[1])];
    pairs.push_back({static_cast<int>(s), board_from_left.inverse() * board_from_right,
                     board_from_left.inverse() * half_turn * board_from_right, board_from_left.translation_mm.norm()});
  }
  return pairs;
}

/// A grid that looks the same after half a turn may have been counted from either end.
bool may_be_turned(base::BoardPattern pattern) {
  return pattern == base::BoardPattern::kChessboard || pattern == base::BoardPattern::kCircles;
}

void turn_corners(Problem& problem, State& state, int view) {
  for (const int c : problem.views[static_cast<std::size_t>(view)].corners) {
    Corner& corner = problem.corners[static_cast<std::size_t>(c)];
    corner.point = problem.board.count() - 1 - corner.point;
  }
  auto& pose = state.board_from_camera[static_cast<std::size_t>(view)];
  pose = base::Pose{Eigen::Quaterniond(0.0, 0.0, 0.0, 1.0), Eigen::Vector3d::Zero()} * *pose;
}

}  // namespace

base::Result<> start_rig(Problem& problem, State& state) {
  constexpr double kAgree = 0.05;  // of the distance; a pose from one view is better, pairs of different moments are far worse
  const std::vector<Pair> pairs = find_pairs(problem, state);
  if (pairs.empty()) return {};
  const bool turnable = may_be_turned(problem.board.pattern);
  const Pair* best = nullptr;
  int best_count = 0;
  double best_sum = 0.0;
  for (const Pair& candidate : pairs) {
    int count = 0;
    double sum = 0.0;
    for (const Pair& other : pairs) {
      double far = apart(candidate.left_from_right, other.left_from_right, other.distance_mm);
      if (turnable) far = std::min(far, apart(candidate.left_from_right, other.turned, other.distance_mm));
      if (far > kAgree) continue;
      ++count;
      sum += far;
    }
    if (count > best_count || (count == best_count && sum < best_sum)) {
      best = &candidate;
      best_count = count;
      best_sum = sum;
    }
  }
  if (pairs.size() > 1 && 2 * best_count <= static_cast<int>(pairs.size())) {
    return base::fail(
        base::ErrorCode::kBadInput,
        fmt::format("the pairs contradict each other: only {} of {} agree on where the right camera sits. Do images "
                    "of the same number belong to the same moment, and to the same camera throughout?",
                    best_count, pairs.size()));
  }
  for (const Pair& pair : pairs) {
    Station& station = problem.stations[static_cast<std::size_t>(pair.station)];
    if (apart(best->left_from_right, pair.left_from_right, pair.distance_mm) <= kAgree) continue;
    const std::string& image = problem.views[static_cast<std::size_t>(station.view[1])].image;
    if (turnable && apart(best->left_from_right, pair.turned, pair.distance_mm) <= kAgree) {
      turn_corners(problem, state, station.view[1]);
      problem.warnings.push_back(
          {"corners_turned", image,
           fmt::format("image {}: its corners were counted from the other end of the board than in the left "
                       "image; they were turned round",
                       image)});
      continue;
    }
    station.apart = true;
    problem.warnings.push_back(
        {"pair_contradicts_rig", image,
         fmt::format("images {} and {} show the board in places that contradict the other pairs: not of one moment, or the rig "
                     "moved. Both take part, but not as a pair",
                     problem.views[static_cast<std::size_t>(station.view[0])].image, image)});
  }
  state.left_from_right = best->left_from_right;
  return {};
}

}  // namespace crosstie::calib::detail
