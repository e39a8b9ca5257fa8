#pragma once

#include <array>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "base/board.h"
#include "base/calibration.h"
#include "base/result.h"
#include "calib/calibrate.h"

namespace crosstie::calib::detail {

struct Corner {
  int view = 0;
  int point = 0;
  Eigen::Vector2d px = Eigen::Vector2d::Zero();
  double relative_sigma = 1.0;  ///< its sigma over the common one
};

struct View {
  std::string image;
  int camera = 0;
  int station = 0;
  std::vector<int> corners;
};

struct Station {
  std::string name;
  std::array<int, 2> view = {-1, -1};  ///< of each camera; -1: it did not see the board

  bool apart = false;  ///< its views contradict the rig: each has a pose of its own

  [[nodiscard]] bool paired() const { return view[0] >= 0 && view[1] >= 0 && !apart; }
};

/// The input as the solver sees it: names are indices, what cannot be used has left with a reason.
struct Problem {
  base::Board board;
  Eigen::Matrix3Xd nominal;
  std::vector<base::BoardMode> modes;  ///< none for a board that is taken as nominal
  std::vector<std::string> cameras;
  std::vector<Eigen::Vector2i> size_px;  ///< of each camera's images
  std::vector<View> views;
  std::vector<Station> stations;
  std::vector<Corner> corners;
  std::vector<base::RejectedCorner> refused;
  std::vector<base::Warning> warnings;

  [[nodiscard]] const View& view_of(const Corner& corner) const { return views[static_cast<std::size_t>(corner.view)]; }
};

/// Checks and sorts the input. Errors: see calibrate().
base::Result<Problem> make_problem(const BoardViews& input);

}  // namespace crosstie::calib::detail
