#pragma once

#include <string>
#include <vector>

namespace crosstie::report::detail {

/// A quantity along the travel of an axis with its uncertainty.
struct TravelCurve {
  std::vector<double> at_mm;
  std::vector<double> value;  ///< in `unit`
  std::vector<double> sigma;
  std::string unit;
};

/// What was measured at single places of the travel, in the curve's unit.
struct TravelMark {
  double at_mm = 0.0;
  double value = 0.0;
  std::string name;  ///< tooltip
};

/// The curve with its band of U (k = 2), a line at zero and the marks as dots. A `faint` curve is drawn as one that is not
/// significant.
std::string travel_plot(const TravelCurve& curve, std::string_view title, std::string_view y_label,
                        const std::vector<TravelMark>& marks = {}, bool faint = false);

}  // namespace crosstie::report::detail
