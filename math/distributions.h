#pragma once

namespace crosstie::math {

/// Distribution functions and their inverses (quantiles) of statistical tests, to about 1e-10 relative.
/// Probabilities lie in (0, 1), degrees of freedom are positive (fractions are allowed); else the result is not a number.

[[nodiscard]] double normal_cdf(double x);
[[nodiscard]] double normal_quantile(double p);

[[nodiscard]] double chi_square_cdf(double x, double dof);
[[nodiscard]] double chi_square_quantile(double p, double dof);

[[nodiscard]] double student_cdf(double x, double dof);
[[nodiscard]] double student_quantile(double p, double dof);

/// Fisher's F with dof_1 of the numerator and dof_2 of the denominator.
[[nodiscard]] double f_cdf(double x, double dof_1, double dof_2);
[[nodiscard]] double f_quantile(double p, double dof_1, double dof_2);

/// Critical value of sqrt(v' Qvv^-1 v / (m sigma0^2)) of m residuals with the sigma0 a posteriori of the same adjustment, of
/// `redundancy` > m (Pope, NOAA TR NOS 65 NGS 1, 1976; for m = 1 his tau): F is the quantile with m and redundancy - m degrees,
///     tau^2 = redundancy F / (redundancy - m + m F).
[[nodiscard]] double tau_quantile(double p, double m, double redundancy);

/// Probability of a value at least as far from the distribution's middle as x, to either side.
[[nodiscard]] double chi_square_two_sided(double x, double dof);
/// Probability of a value of Student's t at least as far from 0 as t, to either side; small ones keep their digits.
[[nodiscard]] double student_two_sided(double t, double dof);

}  // namespace crosstie::math
