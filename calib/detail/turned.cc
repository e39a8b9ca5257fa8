#include "calib/detail/turned.h"

#include <optional>

#include <fmt/format.h>

#include "calib/detail/pose_fit.h"

namespace crosstie::calib::detail {
namespace {

base::Pose half_turn() { return {Eigen::Quaterniond(0.0, 0.0, 0.0, 1.0), Eigen::Vector3d::Zero()}; }

/// v'Pv of a view with the best pose; `turned`: its corners counted from the other end.
std::optional<double> square_sum(const Problem& problem, const State& state, int view, bool turned) {
  const auto v = static_cast<std::size_t>(view);
  PoseData data = pose_data(problem, state, view);
  base::Pose start = *state.board_from_camera[v];
  if (turned) {
    Eigen::Index i = 0;
    for (const int c : problem.views[v].corners) {
      if (!state.active[static_cast<std::size_t>(c)]) continue;
      const int point = problem.corners[static_cast<std::size_t>(c)].point;
      data.points.col(i++) = state.points.col(problem.board.count() - 1 - point);
    }
    start = half_turn() * start;
  }
  const auto camera = static_cast<std::size_t>(problem.views[v].camera);
  const auto fit = fit_pose(state.lens_model, state.lenses[camera], data, start);
  return fit ? std::optional(fit->square_sum) : std::nullopt;
}

}  // namespace

bool may_be_turned(base::BoardPattern pattern) {
  return pattern == base::BoardPattern::kChessboard || pattern == base::BoardPattern::kCircles;
}

void turn_corners(Problem& problem, State& state, int view) {
  for (const int c : problem.views[static_cast<std::size_t>(view)].corners) {
    Corner& corner = problem.corners[static_cast<std::size_t>(c)];
    corner.point = problem.board.count() - 1 - corner.point;
  }
  auto& pose = state.board_from_camera[static_cast<std::size_t>(view)];
  if (pose) pose = half_turn() * *pose;
}

int turn_stations(Problem& problem, State& state) {
  constexpr double kBetter = 30.0;
  if (!problem.board.free || !may_be_turned(problem.board.pattern)) return 0;
  int turned = 0;
  for (const Station& station : problem.stations) {
    double gain = 0.0;
    const auto try_view = [&](int v) {
      if (v < 0 || !state.takes_part(v)) return 0.0;
      const auto as_is = square_sum(problem, state, v, false);
      const auto other = square_sum(problem, state, v, true);
      return as_is && other ? *as_is - *other : 0.0;
    };
    const auto turn = [&](int v) {
      if (v < 0 || !state.takes_part(v)) return;
      turn_corners(problem, state, v);
      const std::string& image = problem.views[static_cast<std::size_t>(v)].image;
      problem.warnings.push_back({"corners_turned", image,
                                  fmt::format("image {}: its corners were counted from the other end of the board than in most "
                                              "images, as the board's shape shows; they were turned round",
                                              image)});
    };
    // The views of a pair share their board; those of others are judged one by one.
    if (is_joint(state, station)) {
      gain = try_view(station.view[0]) + try_view(station.view[1]);
      if (gain < kBetter) continue;
      turn(station.view[0]);
      turn(station.view[1]);
      ++turned;
      continue;
    }
    for (const int v : station.view) {
      if (try_view(v) < kBetter) continue;
      turn(v);
      ++turned;
    }
  }
  return turned;
}

}  // namespace crosstie::calib::detail
