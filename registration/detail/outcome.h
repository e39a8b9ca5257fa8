#pragma once

#include "base/result.h"
#include "base/stitching.h"
#include "math/normal_equations.h"
#include "registration/detail/stitch_model.h"

namespace crosstie::registration::detail {

/// The adjustment at its minimum.
struct StitchSolution {
  StitchModel model;
  math::WhitenedRows rows;
  math::NormalEquations equations;
};

/// sqrt(v' Q^+ v / rank) of whitened residuals and their cofactors: 1 is expected where the sigmas are true; without the directions that
/// nothing controls.
double standardised(const Eigen::VectorXd& whitened, const Eigen::MatrixXd& cofactor);
/// The same of a residual with its covariance; `prior`: the covariance that it would have if nothing else told of it.
double standardised(const Eigen::VectorXd& residual, const Eigen::MatrixXd& cov, const Eigen::MatrixXd& prior);

/// Everything that is said of it: covariances, directions and their sources, overlaps, drift.
base::Result<base::Stitching> outcome(const StitchWork& work, StitchSolution& solution,
                                      std::vector<base::StitchIteration> iterations);

}  // namespace crosstie::registration::detail
