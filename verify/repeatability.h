#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "base/edge_curve.h"
#include "base/point_list.h"
#include "base/repeatability.h"
#include "base/result.h"

namespace crosstie::verify {

/// Statistics of quantities that were measured in the same runs, two or more: mean, standard deviation s with its interval
/// (n - 1) s^2 / sigma^2 ~ chi-square (n - 1), and the test of s against the predicted sigma.
///
/// Together: z = (value - mean) / sigma. ratio^2 = sum z^2 / ((n - 1) q) has expectation 1 where the sigmas are true, whatever the
/// correlation of the q quantities. It is like a chi-square variable with dof = (n - 1) (tr R)^2 / tr R^2 degrees of freedom (Box 1954), R
/// the quantities' covariance over their variances: that of `predicted_cov` where it is given (of the quantities in their order). Else tr R^2 is
/// estimated from the runs (Bai & Saranadasa, Statistica Sinica 6, 1996) and half of the dof is taken, n - 1 at least and of fewer than five
/// runs: the estimate goes with the very scatter that it judges; by sampling a test of 5 % then refuses 1 to 7 % of true sigmas.
/// With `sigma_dof` degrees of freedom of the predicted sigmas themselves (a posteriori ones) the test is Fisher's F; 0: they are known.
///
/// What all runs have in common (a calibration, a frame) does not vary between them: sigmas that include it are larger than the scatter, and a
/// ratio below 1 proves nothing against them. A ratio above 1 does.
///
/// Errors: kBadInput for fewer than two runs or lists of different lengths.
base::Result<base::RepeatedGroup> repeat_group(std::string name, std::vector<base::RepeatedQuantity> quantities,
                                               double sigma_dof = 0.0, const Eigen::MatrixXd& predicted_cov = {});

/// Points of one run.
struct RepeatedPoints {
  std::string run;
  base::PointList points;
  Eigen::MatrixXd cov_mm2 = {};  ///< of all coordinates in their order, or empty: the points' own blocks
};

/// Coordinates of the points that all runs have. `align`: each run has a frame of its own (a free network) and is first laid onto the mean of
/// all by six parameters, whose part is taken out of the predicted sigmas: M S M' with M = I - J (J'J)^-1 J'. Points are compared by their ids;
/// uncoded ones take no part.
/// Errors: kBadInput; kNoUniqueSolution for fewer than three common points or points on a line.
base::Result<base::RepeatedGroup> repeat_points(const std::vector<RepeatedPoints>& runs, bool align);

/// A rim of one run, its points in order along it.
struct RepeatedRim {
  std::string run;
  std::vector<base::EdgePoint> points;
};

/// Rims of the same hole in one frame, by the angle about their common centre in their common plane: `radial` in it and `normal` along its
/// normal, at `places` equal steps of angle, between the two neighbouring points of each run. Steps that one of the runs does not have
/// (neighbours more than `max_gap_mm` apart) are left out. The radial sigma is that across the rim over the cosine of the angle between the two.
/// Errors: kBadInput for runs without points; kNoUniqueSolution where less than eight steps are common.
base::Result<std::vector<base::RepeatedGroup>> repeat_rims(const std::vector<RepeatedRim>& runs, int places = 72,
                                                           double max_gap_mm = 20.0);

}  // namespace crosstie::verify
