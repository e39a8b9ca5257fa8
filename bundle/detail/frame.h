#pragma once

#include "base/pose.h"
#include "base/result.h"
#include "bundle/detail/estimate.h"
#include "bundle/detail/state.h"

namespace crosstie::bundle::detail {

/// The frame of a result without a datum of its own: origin in the points' centroid, x along their longest principal axis so
/// that ids grow along it, z along the shortest, towards the cameras.
base::Pose principal_frame_from_network(const Survey& survey, const State& state);

/// The factor that brings the network to size: from the median ratio of its used bars, from the bar that defines the scale
/// (exactly), or to a mean distance of 1 of the points from their centroid where the scale is free. Error kNoUniqueSolution
/// where the ends of all of these bars were lost.
base::Result<double> scale_factor(const Survey& survey, const State& state);

/// Conditions of the result's datum: inner constraints over all points, and for the scale the defining bar (or, where it is
/// free, a seventh inner constraint).
Eigen::MatrixXd datum_conditions(const Survey& survey, const NetworkModel& network);

}  // namespace crosstie::bundle::detail
