#pragma once

#include <cstdint>
#include <vector>

namespace crosstie::study {

/// e' C^-1 e of one seed, with the rank of C.
struct Square {
  double square = 0.0;
  double dof = 0.0;
};

/// An interval round a mean.
struct Interval {
  double low = 0.0;
  double high = 0.0;

  [[nodiscard]] bool holds(double value) const { return low <= value && value <= high; }
};

/// Sum of the squares over the sum of their degrees of freedom, with the interval in which it lies with the probability `level`
/// if every covariance is true, the errors are normal and the seeds are independent: a sum of chi-square variables is one.
struct MeanSquare {
  double mean = 0.0;
  Interval expected;
  double dof = 0.0;  ///< of all seeds together
};
[[nodiscard]] MeanSquare mean_square(const std::vector<Square>& seeds, double level);

/// The value below which the share p of the values lies, linear between them.
[[nodiscard]] double quantile(std::vector<double> values, double p);

/// Where the mean over seeds lies with the probability `level`, by drawing as many seeds with replacement: nothing is assumed of what a
/// seed's points have in common. Two seeds at least, else the interval is the value itself.
[[nodiscard]] Interval bootstrap_mean(const std::vector<double>& seeds, double level, std::uint64_t random_seed = 1);

}  // namespace crosstie::study
