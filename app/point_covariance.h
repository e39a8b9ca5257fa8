#pragma once

#include <cstddef>
#include <filesystem>

#include <Eigen/Core>

#include "base/result.h"

namespace crosstie::app {

/// The points' own block of an adjustment's full covariance, mm^2; empty where the result has none beside it.
base::Result<Eigen::MatrixXd> point_covariance(const std::filesystem::path& result, std::size_t point_count);

}  // namespace crosstie::app
