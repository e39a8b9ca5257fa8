#pragma once

#include <filesystem>

#include "base/network.h"
#include "base/result.h"

namespace crosstie::base {

/// Reads the result of `adjust` back from its folder: cameras, images and points from result.json, and the observations that
/// took part from residuals.csv. Of the other members datum, scale and the figures of the whole network are filled; scale bars,
/// rejected observations, warnings and the full covariance are not.
///
/// Errors: kBadInput with the file where the folder holds no result of `adjust`, a value is missing or of the wrong kind, or
/// a residual belongs to an image or point that the result does not know.
Result<AdjustedNetwork> read_adjusted_network(const std::filesystem::path& folder);

}  // namespace crosstie::base
