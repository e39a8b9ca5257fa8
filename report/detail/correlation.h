#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

namespace crosstie::report::detail {

/// Correlation matrix of a covariance; rows without variance become zero.
Eigen::MatrixXd correlation_matrix(const Eigen::MatrixXd& covariance);

/// The lower triangle as coloured cells; entries beyond `flagged` (absolute) are framed.
std::string correlation_map(const Eigen::MatrixXd& correlation, const std::vector<std::string>& names, const std::string& title,
                            double flagged);

}  // namespace crosstie::report::detail
