#include "calib/detail/rig_start.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <fmt/format.h>

#include "calib/detail/turned.h"

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

/// The pair with which most others agree, and how many.
struct Choice {
  const Pair* best = nullptr;
  int count = 0;
};

Choice choose(const std::vector<Pair>& pairs, bool turnable, double tolerance) {
  Choice choice;
  double best_sum = 0.0;
  for (const Pair& candidate : pairs) {
    int count = 0;
    double sum = 0.0;
    for (const Pair& other : pairs) {
      double far = apart(candidate.left_from_right, other.left_from_right, other.distance_mm);
      if (turnable) far = std::min(far, apart(candidate.left_from_right, other.turned, other.distance_mm));
      if (far > tolerance) continue;
      ++count;
      sum += far;
    }
    if (count > choice.count || (count == choice.count && sum < best_sum)) {
      choice = {&candidate, count};
      best_sum = sum;
    }
  }
  return choice;
}

}  // namespace

base::Result<> start_rig(Problem& problem, State& state) {
  // Of the distance. A pose from one view is good to less, unless the views hardly tell the focal length; pairs of different moments
  // are far worse.
  constexpr std::array<double, 2> kAgree = {0.05, 0.2};
  const std::vector<Pair> pairs = find_pairs(problem, state);
  if (pairs.empty()) return {};
  const bool turnable = may_be_turned(problem.board.pattern);
  const auto most = [&](const Choice& choice) {
    return pairs.size() == 1 || 2 * choice.count > static_cast<int>(pairs.size());
  };
  double agree = kAgree[0];
  Choice choice = choose(pairs, turnable, agree);
  if (!most(choice)) {
    agree = kAgree[1];
    choice = choose(pairs, turnable, agree);
  }
  if (!most(choice)) {
    return base::fail(
        base::ErrorCode::kBadInput,
        fmt::format("the pairs contradict each other: only {} of {} agree on where the right camera sits. Do images "
                    "of the same number belong to the same moment, and to the same camera throughout?",
                    choice.count, pairs.size()));
  }
  for (const Pair& pair : pairs) {
    Station& station = problem.stations[static_cast<std::size_t>(pair.station)];
    if (apart(choice.best->left_from_right, pair.left_from_right, pair.distance_mm) <= agree) continue;
    const std::string& image = problem.views[static_cast<std::size_t>(station.view[1])].image;
    if (turnable && apart(choice.best->left_from_right, pair.turned, pair.distance_mm) <= agree) {
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
  state.left_from_right = choice.best->left_from_right;
  return {};
}

}  // namespace crosstie::calib::detail
