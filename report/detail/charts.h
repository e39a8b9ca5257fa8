#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace crosstie::report::detail {

/// Normal curve drawn over a histogram.
struct NormalCurve {
  double sigma = 1.0;
  std::string name;
};

/// Histogram with normal curves of mean 0 scaled to the number of values.
std::string histogram(std::span<const double> values, std::string_view title, std::string_view x_label,
                      const std::vector<NormalCurve>& curves);

/// Bars over whole numbers: how many points have how many rays.
std::string count_bars(std::span<const int> values, std::string_view title, std::string_view x_label, std::string_view y_label);

/// Sorted values over the quantiles of the standard normal distribution, with the line of slope 1.
std::string normal_quantile_plot(std::span<const double> values, std::string_view title, std::string_view y_label);

/// Root mean square of `values` in classes of equal count along `at`, with a line at `expected`; drawn with 95 % bounds of each
/// class under the assumption that values are independent and normal.
std::string rms_along(std::span<const double> at, std::span<const double> values, double expected, std::string_view title,
                      std::string_view x_label, std::string_view y_label);

/// The value below which a standard normal variable falls with probability p, 0 < p < 1.
double normal_quantile(double p);

}  // namespace crosstie::report::detail
