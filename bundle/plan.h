#pragma once

#include <Eigen/Core>

#include "base/network.h"
#include "base/plan.h"
#include "base/progress.h"
#include "base/result.h"
#include "bundle/commission.h"

namespace crosstie::bundle {

struct PlanOptions {
  /// Power with which an error motion is to be found. Default: 0.95.
  double power = 0.95;
  /// As the later commissioning will have them; its image sigmas are taken as stated.
  CommissionOptions commission = {};

  [[nodiscard]] base::Result<> validate() const;
};

/// Sigmas of a commissioning before anything is measured, from observations without noise whose covariances say what the noise will
/// be: the covariance of commission()'s own adjustment, linearised where the observations are true.
///
/// The smallest error motion that is found: a coefficient c is tested at the level a, two-sided, so that it is found with the power P where
///     |c| = (z(1 - a/2) + z(P)) sigma
/// with sigma beside the terms that the scene itself shows (z: quantiles of the normal distribution). Error motions that are
/// smaller than that are in no sigma.
///
/// Errors: those of commission(); kUsage for options.
base::Result<base::CommissionPlan> plan_commission(const CommissionInput& exact, const PlanOptions& options = {},
                                                   const base::Progress& progress = {});

/// What that commissioning gives at a place of the machine: the head stands before it, as far as its travel reaches, so that the place is
/// in the middle of the working volume along the travel. `sigma_px` is that of a coordinate of a target's images.
/// The target is triangulated by least squares in both images, so with q its pixels and A = dq/dX
///     dX = R (A'A)^-1 A' (noise - dq/d(lenses, rig)) + d(frame),
/// all of one joint covariance: what lenses and rig do wrong and the frame, found through them, compensates, is not counted twice.
base::PlannedPoint plan_point(const base::Commissioning& expected, const Eigen::Vector3d& p_in_machine_mm, double sigma_px);

/// Sigmas of a network before anything is measured, from observations without noise: adjust() with all of them, its covariances brought
/// back to the a priori sigma. Errors: those of adjust().
base::Result<base::NetworkPlan> plan_network(const base::Network& exact, const base::Progress& progress = {});

}  // namespace crosstie::bundle
