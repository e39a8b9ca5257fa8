#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "report/detail/plot.h"

namespace crosstie::report::detail {

/// A value over a plane, in cells of equal size: an uncertainty over an image or over the working volume.
struct HeatGrid {
  Axis x;  ///< from the left border of the first cell to the right one of the last
  Axis y;
  Eigen::MatrixXd values;  ///< rows along y from low to high, columns along x; not a number: the cell stays blank
  std::string value_name;  ///< "U (k = 2)"
  std::string unit;        ///< of the values: "mm"
};

struct HeatOptions {
  double width_px = 520.0;
  bool y_down = false;  ///< image coordinates
  double low = 0.0;     ///< colour range; high <= low: from 0 to the largest value
  double high = 0.0;
};

/// Something to find one's way by, drawn over the cells.
struct HeatMark {
  double x = 0.0;
  double y = 0.0;
  std::string name;  ///< written beside it; may be empty
};

/// Cells coloured by their value on one scale for x and y, with the value as a tooltip, a few of them written out, and the
/// colour scale at the right.
std::string heat_map(const HeatGrid& grid, std::string_view title, std::string_view x_label, std::string_view y_label,
                     const std::vector<HeatMark>& marks = {}, const HeatOptions& options = {});

}  // namespace crosstie::report::detail
