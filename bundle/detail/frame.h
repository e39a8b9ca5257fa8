#pragma once

#include <string>

#include "base/pose.h"
#include "base/result.h"
#include "bundle/detail/estimate.h"
#include "bundle/detail/state.h"

namespace crosstie::bundle::detail {

/// The frame of a result without a datum of its own: origin in the points' centroid, x along their longest principal axis so
/// that ids grow along it, z along the shortest, towards the cameras.
base::Pose principal_frame_from_network(const Survey& survey, const State& state);

/// The factor that brings the network to size: from the median ratio of its used bars, from the bar that defines the scale
/// (exactly), from the control points where there are no bars, or to a mean distance of 1 of the points from their centroid where
/// the scale is free. Error kNoUniqueSolution where the ends of all of these bars were lost.
base::Result<double> scale_factor(const Survey& survey, const State& state);

/// Moves the network onto its datum points: first all their coordinates with equal weights, then by Gauss-Newton only those that
/// count. The size is fitted, too, where `with_scale`. Errors kNoUniqueSolution where they are too few or leave a direction free;
/// kBadInput where they are the mirror image of the network.
base::Result<> move_onto_datum(const Survey& survey, State& state, bool with_scale);

/// Inner constraints over all points, one for each column of `null_space`.
Eigen::MatrixXd inner_conditions(const NetworkModel& network, const Eigen::MatrixXd& null_space);

/// Conditions of the result's datum, as many as `null_space` has columns: inner constraints over the counting coordinates of the
/// datum points or over all points, and for the scale the defining bar.
Eigen::MatrixXd datum_conditions(const Survey& survey, const NetworkModel& network, const Eigen::MatrixXd& null_space);

/// The datum in words.
std::string datum_name(const Survey& survey, const State& state, int conditions);

}  // namespace crosstie::bundle::detail
