#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

#include "base/edge_curve.h"
#include "edge/detail/nominal_problem.h"
#include "edge/nominal_fit.h"

namespace crosstie::edge::detail {

/// The form of a rim, estimated from how it deviates from the nominal that fits it: for u and v each a stationary process along the rim of variance
/// tau^2 whose correlation falls as exp(-d / length) or as Matern's of order 5/2 (FormComponent). Variance and length maximise the restricted likelihood (Patterson and Thompson, Biometrika 58,
/// 1971), which knows how much of a form the fit itself has taken up,
///     -2 log L = log|V| + log|A'V^-1 A| + r'V^-1 (r - A x),   V = D + S S' + tau^2 K,
/// D each point's own covariance, S what they share, A the derivatives by the unknowns. Forms of all lengths, rough and smooth, are averaged by their restricted
/// likelihoods. Without `contradicts` (v'Pv beyond its limit), a form whose likelihood ratio chance reaches once in a hundred rims without one (chi-square with
/// two degrees of freedom) is none. `rim` is the one that the problem was made of.
[[nodiscard]] RimForm form_of(const base::EdgeCurve& rim, const NominalProblem& problem, const NominalState& state,
                              bool contradicts);

/// The rim with the form's variances added to the covariance of each point alone.
[[nodiscard]] base::EdgeCurve with_form(const base::EdgeCurve& rim, const RimForm& form);

/// Covariance of the free unknowns of a fit to with_form(rim): the weights know how large the form is, and take each point's as its own; here
/// neighbours deviate together. With G the unknowns by the deviations, it is N^-1 + G tau^2 (K - 1) G' for a piece of a rim, whose rest might
/// deviate otherwise. What fits a whole, closed rim best is a property of that rim, whatever its form: there it is N^-1 - G tau^2 G', noise alone.
/// `cofactor` is N^-1 over the free unknowns and the shared causes.
[[nodiscard]] std::optional<Eigen::MatrixXd> covariance_with_form(const base::EdgeCurve& rim_with_form,
                                                                  const NominalProblem& problem, const NominalState& state,
                                                                  const RimForm& form, const Eigen::MatrixXd& cofactor);

}  // namespace crosstie::edge::detail
