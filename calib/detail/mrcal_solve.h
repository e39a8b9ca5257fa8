#pragma once

#include <vector>

#include <Eigen/Core>

#include "base/camera.h"
#include "base/pose.h"
#include "base/progress.h"
#include "base/result.h"

namespace crosstie::calib::detail {

/// A calibration as mrcal sees it; values are start values, then the answer. Lengths in mm.
struct MrcalProblem {
  base::LensModel lens;
  bool bent = false;
  bool reject_outliers = false;
  int columns = 0;
  int rows = 0;
  double pitch_mm = 0.0;

  struct Camera {
    int width_px = 0;
    int height_px = 0;
    Eigen::VectorXd parameters;
  };
  std::vector<Camera> cameras;              ///< one or two; the first is the reference frame
  base::Pose right_from_left;               ///< of two cameras
  std::vector<base::Pose> left_from_board;  ///< of each moment; the board's first corner is its origin, x along a row

  struct View {
    int camera = 0;
    int moment = 0;  ///< index into left_from_board; views of one moment stand together
    /// Of each point of the board: x, y [px] and weight (1: as good as any; negative: not seen).
    Eigen::Matrix3Xd corners;
  };
  std::vector<View> views;
};

struct MrcalAnswer {
  int rejected = 0;     ///< corners, beyond those that were not seen
  double rms_px = 0.0;  ///< sqrt(sum |e|^2 / points) of the corners that took part
  Eigen::Vector2d bends_mm = Eigen::Vector2d::Zero();
};

/// Runs mrcal_optimize. The values of `problem` become the answer's.
base::Result<MrcalAnswer> solve(MrcalProblem& problem, const base::Progress& progress);

}  // namespace crosstie::calib::detail
