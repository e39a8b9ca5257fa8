#include "report/detail/charts.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>

#include <fmt/format.h>

#include "report/detail/number.h"
#include "report/detail/plot.h"

namespace crosstie::report::detail {
namespace {

constexpr std::size_t kMaxDots = 1500;  // of a quantile plot: more only make the page heavy
constexpr std::size_t kMaxClasses = 12;
constexpr std::size_t kClassSize = 20;

std::vector<double> finite(std::span<const double> values) {
  std::vector<double> result(values.begin(), values.end());
  std::erase_if(result, [](double value) { return !std::isfinite(value); });
  return result;
}

std::string counted_values(std::size_t count) { return fmt::format("{} values", count); }

}  // namespace

double normal_quantile(double p) {
  // Bisection on the distribution function; 60 halvings of [-9, 9] reach rounding.
  double low = -9.0;
  double high = 9.0;
  for (int i = 0; i < 60; ++i) {
    const double middle = 0.5 * (low + high);
    (0.5 * std::erfc(-middle / std::numbers::sqrt2) < p ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

std::string histogram(std::span<const double> values, std::string_view title, std::string_view x_label,
                      const std::vector<NormalCurve>& curves) {
  const std::vector<double> kept = finite(values);
  double reach = 0.0;
  double square_sum = 0.0;
  for (const double value : kept) {
    reach = std::max(reach, std::abs(value));
    square_sum += value * value;
  }
  const double rms = kept.empty() ? 1.0 : std::sqrt(square_sum / static_cast<double>(kept.size()));
  // Single wild values do not squeeze the rest: the axis ends at 6 robust sigmas (1.4826 times the median amount).
  std::vector<double> amounts;
  for (const double value : kept) amounts.push_back(std::abs(value));
  const double robust = 1.4826 * median(amounts);
  if (robust > 0.0) reach = std::min(reach, 6.0 * robust);
  for (const NormalCurve& curve : curves) reach = std::max(reach, 3.0 * std::min(curve.sigma, 2.0 * rms));
  if (!(reach > 0.0)) reach = 1.0;
  const Axis x = make_axis(-reach, reach, 8);
  const int bars = std::clamp(static_cast<int>(std::sqrt(static_cast<double>(kept.size()))), 9, 41) | 1;
  const double width = (x.high - x.low) / bars;
  std::vector<int> count(static_cast<std::size_t>(bars), 0);
  int beyond = 0;
  for (const double value : kept) {
    if (value < x.low || value > x.high) ++beyond;
    const int bar = std::clamp(static_cast<int>(std::floor((value - x.low) / width)), 0, bars - 1);
    ++count[static_cast<std::size_t>(bar)];
  }
  double highest = *std::max_element(count.begin(), count.end());
  const double area = static_cast<double>(kept.size()) * width;
  const auto density = [&](double at, double sigma) {
    return area / (sigma * std::sqrt(2.0 * std::numbers::pi)) * std::exp(-0.5 * at * at / (sigma * sigma));
  };
  for (const NormalCurve& curve : curves) {
    if (curve.sigma > 0.0) highest = std::max(highest, std::min(density(0.0, curve.sigma), 1.6 * highest));
  }
  Plot plot(title, fmt::format("Histogram of {}, root mean square {}", counted_values(kept.size()), significant(rms)), x,
            make_axis(0.0, std::max(1.0, highest), 5), x_label, "count");
  for (int bar = 0; bar < bars; ++bar) {
    const int n = count[static_cast<std::size_t>(bar)];
    if (n == 0) continue;
    const double from = x.low + bar * width;
    plot.svg().rect(plot.x_px(from) + 0.5, plot.y_px(n), plot.x_px(from + width) - plot.x_px(from) - 1.0,
                    plot.bottom() - plot.y_px(n), "bar", "",
                    fmt::format("{} to {}: {}", significant(from), significant(from + width), n));
  }
  for (std::size_t i = 0; i < curves.size(); ++i) {
    if (!(curves[i].sigma > 0.0)) continue;
    std::vector<double> at;
    std::vector<double> y;
    for (int k = 0; k <= 160; ++k) {
      at.push_back(x.low + (x.high - x.low) * k / 160.0);
      y.push_back(density(at.back(), curves[i].sigma));
    }
    const std::string css = fmt::format("curve c{}", i + 2);
    plot.curve(at, y, css);
    plot.legend(css, curves[i].name);
  }
  if (beyond > 0) {
    plot.svg().text(plot.right(), 17.0, fmt::format("{} beyond the axis, in the outermost bars", beyond), "end", "tick");
  }
  return plot.str();
}

std::string count_bars(std::span<const int> values, std::string_view title, std::string_view x_label,
                       std::string_view y_label) {
  std::map<int, int> counts;
  for (const int value : values) ++counts[value];
  int most = 1;
  for (const auto& [value, count] : counts) most = std::max(most, count);
  const int low = counts.empty() ? 0 : counts.begin()->first;
  const int high = counts.empty() ? 1 : counts.rbegin()->first;
  const int per_bar = std::max(1, (high - low + 1) / 40 + ((high - low + 1) % 40 != 0 && high - low + 1 > 40 ? 1 : 0));
  std::map<int, int> bars;
  for (const auto& [value, count] : counts) bars[low + (value - low) / per_bar * per_bar] += count;
  for (const auto& [value, count] : bars) most = std::max(most, count);
  Axis x = make_axis(low - 0.5, high + per_bar - 0.5, 8, false);
  std::erase_if(x.ticks, [](double tick) { return tick != std::round(tick); });
  x.decimals = 0;
  Plot plot(title, fmt::format("{}, from {} to {}", counted_values(values.size()), low, high), x, make_axis(0.0, most, 5),
            x_label, y_label);
  for (const auto& [value, count] : bars) {
    const std::string range = per_bar == 1 ? std::to_string(value) : fmt::format("{} to {}", value, value + per_bar - 1);
    plot.svg().rect(plot.x_px(value - 0.5) + 1.0, plot.y_px(count),
                    plot.x_px(value + per_bar - 0.5) - plot.x_px(value - 0.5) - 2.0, plot.bottom() - plot.y_px(count), "bar",
                    "", fmt::format("{}: {}", range, count));
  }
  return plot.str();
}

std::string normal_quantile_plot(std::span<const double> values, std::string_view title, std::string_view y_label) {
  std::vector<double> sorted = finite(values);
  std::sort(sorted.begin(), sorted.end());
  const auto count = sorted.size();
  const double reach_x = count > 0 ? normal_quantile((static_cast<double>(count) - 0.5) / static_cast<double>(count)) : 3.0;
  double reach_y = reach_x;
  for (const double value : sorted) reach_y = std::max(reach_y, std::abs(value));
  Plot plot(title,
            fmt::format("Sorted {} over the quantiles of the normal distribution; the line has slope 1", counted_values(count)),
            make_axis(-reach_x, reach_x), make_axis(-reach_y, reach_y), "quantile of the normal distribution", y_label);
  const std::vector<double> ends = {-reach_x, reach_x};
  plot.curve(ends, ends, "curve c2");
  plot.legend("curve c2", "as predicted");
  const std::size_t stride = count / kMaxDots + 1;
  for (std::size_t i = 0; i < count; ++i) {
    const bool in_tail = i < 50 || i + 50 >= count;
    if (i % stride != 0 && !in_tail) continue;
    plot.point(normal_quantile((static_cast<double>(i) + 0.5) / static_cast<double>(count)), sorted[i], "dot", "", "", 1.8);
  }
  return plot.str();
}

std::string rms_along(std::span<const double> at, std::span<const double> values, double expected, std::string_view title,
                      std::string_view x_label, std::string_view y_label) {
  std::vector<std::pair<double, double>> sorted;
  for (std::size_t i = 0; i < std::min(at.size(), values.size()); ++i) {
    if (std::isfinite(at[i]) && std::isfinite(values[i])) sorted.emplace_back(at[i], values[i]);
  }
  std::sort(sorted.begin(), sorted.end());
  const std::size_t classes = std::clamp(sorted.size() / kClassSize, std::size_t{1}, kMaxClasses);
  struct Class {
    double at, rms, half_width;
  };
  std::vector<Class> list;
  double highest = expected;
  for (std::size_t c = 0; c < classes && !sorted.empty(); ++c) {
    const std::size_t from = c * sorted.size() / classes;
    const std::size_t to = (c + 1) * sorted.size() / classes;
    if (to == from) continue;
    double square_sum = 0.0;
    for (std::size_t i = from; i < to; ++i) square_sum += sorted[i].second * sorted[i].second;
    const double n = static_cast<double>(to - from);
    const double rms = std::sqrt(square_sum / n);
    list.push_back({sorted[(from + to) / 2].first, rms, 1.96 * rms / std::sqrt(2.0 * n)});
    highest = std::max(highest, rms + list.back().half_width);
  }
  const double low = sorted.empty() ? 0.0 : sorted.front().first;
  const double high = sorted.empty() ? 1.0 : sorted.back().first;
  Plot plot(title, fmt::format("Root mean square of {} in {} classes", counted_values(sorted.size()), list.size()),
            make_axis(std::min(0.0, low), high), make_axis(0.0, highest, 5), x_label, y_label);
  const std::vector<double> ends = {std::min(0.0, low), high};
  const std::vector<double> level = {expected, expected};
  plot.curve(ends, level, "curve c2");
  plot.legend("curve c2", "as predicted");
  std::vector<double> x;
  std::vector<double> y;
  for (const Class& one : list) {
    plot.whisker(one.at, one.rms - one.half_width, one.rms + one.half_width);
    x.push_back(one.at);
    y.push_back(one.rms);
  }
  plot.curve(x, y, "curve c1");
  for (const Class& one : list) {
    plot.point(one.at, one.rms, "dot", "", fmt::format("at {}: {}", significant(one.at), significant(one.rms)), 3.5);
  }
  return plot.str();
}

}  // namespace crosstie::report::detail
