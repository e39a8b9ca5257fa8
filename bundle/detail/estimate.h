#pragma once

#include <Eigen/Core>

#include "base/progress.h"
#include "base/result.h"
#include "bundle/detail/network_model.h"
#include "bundle/detail/state.h"
#include "math/solution.h"

namespace crosstie::bundle::detail {

/// A network at its minimum with the linear algebra of that place.
struct Estimate : math::Solution {
  NetworkModel network;
};

/// The directions that no observation determines. Image points leave 3 translations, 3 rotations and the scale (in that order, as
/// columns); bars, control points and held coordinates, whose rows are `rows`, determine the scale, some of them, or all.
Eigen::MatrixXd null_space(const NetworkModel& network, const math::WhitenedRows& rows);

/// Minimises (math::solve) and moves `state` to the minimum.
base::Result<Estimate> estimate(const Survey& survey, State& state, const ModelPlan& plan, const math::SolveOptions& options,
                                const base::Progress& progress);

}  // namespace crosstie::bundle::detail
