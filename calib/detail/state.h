#pragma once

#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "base/camera.h"
#include "base/pose.h"
#include "calib/detail/pose_fit.h"
#include "calib/detail/problem.h"

namespace crosstie::calib::detail {

/// [px] No corner is taken to be better than this. Computed ones without any noise would otherwise outweigh the board's prior until
/// the datum, which it alone fixes, is lost in rounding.
inline constexpr double kLeastSigma_px = 5e-4;

/// Values of all unknowns, and what takes part.
struct State {
  base::LensModel lens_model = base::LensModel::kOpenCv5;
  std::vector<Eigen::VectorXd> lenses;                       ///< of each camera
  std::vector<std::optional<base::Pose>> board_from_camera;  ///< of each view that takes part
  /// Of a splined model the mean of its control points' prior, as lenses; empty otherwise.
  std::vector<Eigen::VectorXd> lens_means;
  std::optional<base::Pose> left_from_right;  ///< the mount of the right camera
  Eigen::Matrix3Xd points;                    ///< [mm] of the board
  Eigen::VectorXd modes;                      ///< amplitudes of Problem::modes
  std::vector<char> active;                   ///< of each corner
  std::vector<std::string> view_reasons;      ///< why a view has left; empty where it has not
  double sigma_px = 1.0;                      ///< common sigma of the corners
  int iterations = 0;

  [[nodiscard]] bool takes_part(int view) const { return board_from_camera[static_cast<std::size_t>(view)].has_value(); }
};

/// Whether a station's views share one pose.
[[nodiscard]] bool is_joint(const State& state, const Station& station);

/// Active corners of a view with the board's points as they are now.
[[nodiscard]] PoseData pose_data(const Problem& problem, const State& state, int view);

}  // namespace crosstie::calib::detail
