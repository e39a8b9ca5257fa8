#pragma once

#include <span>
#include <vector>

#include <Eigen/Core>

#include "base/pose.h"
#include "base/result.h"

namespace crosstie::math {

/// One point in two frames, with its covariance in each; a zero covariance means that none is known.
struct AlignmentPair {
  Eigen::Vector3d a_mm = Eigen::Vector3d::Zero();
  Eigen::Vector3d b_mm = Eigen::Vector3d::Zero();
  Eigen::Matrix3d cov_a_mm2 = Eigen::Matrix3d::Zero();
  Eigen::Matrix3d cov_b_mm2 = Eigen::Matrix3d::Zero();
};

struct AlignmentOptions {
  bool with_scale = false;  ///< true: 7 parameters, false: 6 and scale = 1
  /// true: weights from the covariances of both sides (equal weights where no pair has any); false: equal weights.
  bool weighted = true;
};

/// The motion (and scale) that brings one set of points onto another.
struct Alignment {
  base::Pose a_from_b;  ///< of the model a = scale * R b + t
  double scale = 1.0;
  /// Of [rotation rad, translation mm, scale], the pose perturbed on the left as base::Pose has it; row and column of the
  /// scale are zero where it was not estimated. Weighted: as the given covariances say; equal weights: times sigma0^2.
  Eigen::Matrix<double, 7, 7> covariance = Eigen::Matrix<double, 7, 7>::Zero();
  std::vector<Eigen::Vector3d> residuals_mm;  ///< a - (scale * R b + t), in the order of the pairs
  bool weighted = false;                      ///< whether covariances were used
  double sigma0 = 0.0;  ///< sqrt(v'Pv / redundancy): without unit if weighted, else in mm; 0 where redundancy is 0
  int redundancy = 0;   ///< 3 n - 6 or 3 n - 7
};

/// Best fit of two sets of points by least squares.
///
/// Starts from the closed solution (Umeyama, IEEE PAMI 13(4), 1991, without its reflection) and, where weights differ, iterates
/// Gauss-Newton with the covariance cov_a + scale^2 R cov_b R^T of each pair; pairs are taken as independent of each other.
///
/// Errors: kNoUniqueSolution for fewer than 3 pairs and for points on one line (exactly, or as far as their sigmas can tell);
/// kBadInput for values that are not finite, for a covariance that is not positive definite while others are known, and for
/// sets that match only as mirror images of each other: those are reported, never reflected.
base::Result<Alignment> align(std::span<const AlignmentPair> pairs, const AlignmentOptions& options = {});

}  // namespace crosstie::math
