#pragma once

#include <vector>

#include "calib/detail/problem.h"
#include "calib/detail/state.h"
#include "math/model.h"

namespace crosstie::calib::detail {

struct ModelPlan {
  bool hold_lenses = false;
  bool hold_board = false;          ///< the points stay where the state has them
  std::vector<char> stations = {};  ///< which take part; empty: all
};

/// The adjustment as math sees it, with the way back to the problem's indices.
struct BoardModel {
  math::Model model;
  std::vector<int> camera_block;
  int mount_block = -1;
  int mode_block = -1;
  std::vector<int> view_block;             ///< the pose of each view: the station's where it is joint; -1: it takes no part
  std::vector<int> point_block;            ///< -1 where the board is held and the point not seen
  std::vector<int> corner_of_measurement;  ///< -1: a prior
};

/// Blocks in this order: cameras, the rig's mount, the board's modes, poses by station, the board's points (eliminated).
BoardModel build_model(const Problem& problem, const State& state, const ModelPlan& plan);

/// The model's values back to the state.
void read_back(const Problem& problem, const BoardModel& network, State& state);

}  // namespace crosstie::calib::detail
