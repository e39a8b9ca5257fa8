#pragma once

#include <span>
#include <vector>

#include <Eigen/Core>

#include "base/result.h"
#include "math/parameters.h"
#include "math/whitened_rows.h"

namespace crosstie::math {

/// The factor by which the stated variances of a group of observations are to be multiplied.
struct VarianceFactor {
  double factor = 1.0;  ///< of the variance, without unit; 1 where it is not estimated
  double sigma = 0.0;   ///< of `factor`
  int observations = 0;
  double redundancy = 0.0;  ///< sum of the group's redundancy numbers at the estimated weights
  /// Of the chi-square variable that `factor` is like: factor * dof / true factor. Never more than the redundancy; less where the group is
  /// hardly told from others.
  double dof = 0.0;
  bool estimated = false;  ///< false: its redundancy is below VarianceComponentOptions::least_redundancy

  /// Bounds of the true factor, of probability p below and above.
  [[nodiscard]] double low(double p = 0.025) const;
  [[nodiscard]] double high(double p = 0.025) const;
  /// Probability of a factor at least as far from 1, to either side, if the true one is 1.
  [[nodiscard]] double probability_if_one() const;
};

struct VarianceComponentOptions {
  /// A group with less takes part as stated: one observation's worth of control cannot tell its sigma. So does one that falls below it
  /// as its factor goes to 0: the residuals then say no more than that its sigmas are small beside what the others can tell. Default: 1.
  double least_redundancy = 1.0;
  int max_iterations = 100;
  double tolerance = 1e-5;  ///< largest relative change of a factor at which the iteration ends
  /// Random directions for the traces of large groups; their relative error is far below that of any factor.
  int probes = 48;
};

/// Variance components of a linearised adjustment: Sigma = sum_i factor_i Sigma_i with independent groups i. The restricted maximum
/// likelihood (REML) estimate, where for every group
///     v_i' P_i v_i = r_i ,      r_i = tr of the residual cofactors of the group's whitened rows,
/// which is the fixed point of Foerstner's factor_i <- factor_i v_i'P_i v_i / r_i (ZfV 104, 1979). It is reached by Helmert's equations
///     sum_j S_ij x_j = v_i'P_i v_i ,   S_ij = tr(M_ij M_ji) ,   M = I - J Q J'
/// (Helmert 1924; Koch, Parameter Estimation and Hypothesis Testing, sect. 3.6), solved for the logarithms of x so that factors stay positive,
/// after Foerstner's steps where it is far off; 2 S^-1 is the covariance of the relative factors. S is exact for groups of up to 100 rows; of larger ones its
/// off-diagonal traces are those of random signs (Hutchinson 1990, seeded), its row sums are r_i exactly.
///
/// `rows` are whitened with the stated sigmas, at the minimum; `component` gives the index of each group of rows, 0 to count - 1, -1 for
/// those whose sigmas are not in question. The model is taken as linear between the stated weights and the estimated ones.
///
/// Errors: those of NormalEquations::make; kNoUniqueSolution where the iteration does not end.
base::Result<std::vector<VarianceFactor>> variance_components(const Parameters& parameters, const WhitenedRows& rows,
                                                              const Eigen::MatrixXd& null_space, std::span<const int> component,
                                                              int count, const VarianceComponentOptions& options = {});

}  // namespace crosstie::math
