#pragma once

#include <Eigen/Core>

namespace crosstie::math {

/// A root of a covariance matrix and its pseudo-inverse.
struct CovarianceRoot {
  Eigen::MatrixXd root;     ///< cov = root root'; a column for each independent cause, fewer than rows where cov is singular
  Eigen::MatrixXd inverse;  ///< of cov in the directions that vary
};

/// Both through the correlations' eigenvalues, so that units (rad beside mm beside px) do not decide what is small: directions below 1e-12
/// of the largest count as exact. Parameters without variance are exact; an empty matrix has an empty root.
[[nodiscard]] CovarianceRoot covariance_root(const Eigen::MatrixXd& cov);

}  // namespace crosstie::math
