#pragma once

#include <string>

#include <Eigen/Core>

#include "base/projection_map.h"

namespace crosstie::report::detail {

struct ImageMapOptions {
  std::string unit = "px";
  double high = 0.0;  ///< end of the colour range, which begins at 0; 0: the largest value
};

/// A value over an image, given for each cell; not a number: the cell stays blank.
std::string image_map(const base::ImageGrid& grid, const Eigen::VectorXd& values, const std::string& title,
                      const std::string& value_name, const ImageMapOptions& options = {});

}  // namespace crosstie::report::detail
