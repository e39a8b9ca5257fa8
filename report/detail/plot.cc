#include "report/detail/plot.h"

#include <algorithm>
#include <cmath>

#include "report/detail/number.h"

namespace crosstie::report::detail {
namespace {

constexpr double kLeft_px = 58.0;
constexpr double kRight_px = 14.0;
constexpr double kTop_px = 26.0;
constexpr double kBottom_px = 44.0;
constexpr double kCharacter_px = 6.2;  // mean advance of the label font

double round_step(double span, int wanted) {
  const double raw = span / wanted;
  const double power = std::pow(10.0, std::floor(std::log10(raw)));
  for (const double mantissa : {1.0, 2.0, 5.0}) {
    if (raw <= mantissa * power * (1.0 + 1e-9)) return mantissa * power;
  }
  return 10.0 * power;
}

}  // namespace

std::string Axis::label(double tick) const { return fixed(tick, decimals); }

Axis make_axis(double low, double high, int wanted, bool widen) {
  if (!std::isfinite(low)) low = std::isfinite(high) ? high : 0.0;
  if (!std::isfinite(high)) high = low;
  if (high < low) std::swap(low, high);
  const double size = std::max(std::abs(low), std::abs(high));
  if (!(high - low > 1e-12 * size) || high - low < 1e-300) {
    const double half = size > 0.0 ? 0.5 * std::max(1e-6 * size, std::min(1.0, size)) : 0.5;
    low -= half;
    high += half;
  }
  const double step = round_step(high - low, wanted);
  Axis axis;
  axis.low = widen ? std::floor(low / step + 1e-9) * step : low;
  axis.high = widen ? std::ceil(high / step - 1e-9) * step : high;
  axis.decimals = std::max(0, -static_cast<int>(std::floor(std::log10(step) + 1e-9)));
  const double first = std::ceil(axis.low / step - 1e-9);
  for (int i = 0; i < 4 * wanted && (first + i) * step <= axis.high + 1e-9 * step; ++i)
    axis.ticks.push_back((first + i) * step);
  return axis;
}

double Plot::fitted_height(const Axis& x, const Axis& y, const PlotOptions& options) {
  if (!options.equal_scale) return options.height_px;
  const double scale = (options.width_px - kLeft_px - kRight_px - options.room_right_px) / (x.high - x.low);
  return std::clamp(scale * (y.high - y.low), 60.0, 2.0 * options.width_px) + kTop_px + kBottom_px;
}

Plot::Plot(std::string_view title, std::string_view description, Axis x, Axis y, std::string_view x_label,
           std::string_view y_label, const PlotOptions& options)
    : x_(std::move(x)),
      y_(std::move(y)),
      y_down_(options.y_down),
      left_(kLeft_px),
      right_(options.width_px - kRight_px - options.room_right_px),
      top_(kTop_px),
      bottom_(fitted_height(x_, y_, options) - kBottom_px),
      legend_x_(kLeft_px),
      svg_(options.width_px, bottom_ + kBottom_px, title, description) {
  if (options.equal_scale) {  // where the height was clamped, the wider scale gives way
    const double scale = std::min((right_ - left_) / (x_.high - x_.low), (bottom_ - top_) / (y_.high - y_.low));
    const double spare_x = (right_ - left_) / scale - (x_.high - x_.low);
    const double spare_y = (bottom_ - top_) / scale - (y_.high - y_.low);
    x_.low -= 0.5 * spare_x;
    x_.high += 0.5 * spare_x;
    y_.low -= 0.5 * spare_y;
    y_.high += 0.5 * spare_y;
  }
  draw_frame(x_label, y_label, options.grid);
}

double Plot::x_px(double x) const { return left_ + (x - x_.low) / (x_.high - x_.low) * (right_ - left_); }

double Plot::y_px(double y) const {
  const double fraction = (y - y_.low) / (y_.high - y_.low);
  return y_down_ ? top_ + fraction * (bottom_ - top_) : bottom_ - fraction * (bottom_ - top_);
}

double Plot::scale_x() const { return (right_ - left_) / (x_.high - x_.low); }

void Plot::draw_frame(std::string_view x_label, std::string_view y_label, bool grid) {
  for (const double tick : x_.ticks) {
    if (grid) svg_.line(x_px(tick), top_, x_px(tick), bottom_, "grid");
    svg_.text(x_px(tick), bottom_ + 15.0, x_.label(tick), "middle", "tick");
  }
  for (const double tick : y_.ticks) {
    if (grid) svg_.line(left_, y_px(tick), right_, y_px(tick), "grid");
    svg_.text(left_ - 6.0, y_px(tick) + 4.0, y_.label(tick), "end", "tick");
  }
  svg_.rect(left_, top_, right_ - left_, bottom_ - top_, "frame");
  svg_.text(0.5 * (left_ + right_), bottom_ + 34.0, x_label, "middle", "label");
  svg_.text(12.0, 0.5 * (top_ + bottom_), y_label, "middle", "label", -90.0);
}

void Plot::curve(std::span<const double> x, std::span<const double> y, std::string_view css_class) {
  std::vector<std::pair<double, double>> points;
  for (std::size_t i = 0; i < std::min(x.size(), y.size()); ++i) {
    if (!std::isfinite(x[i]) || !std::isfinite(y[i])) continue;
    points.emplace_back(std::clamp(x_px(x[i]), left_, right_), std::clamp(y_px(y[i]), top_, bottom_));
  }
  svg_.polyline(points, css_class);
}

void Plot::band(std::span<const double> x, std::span<const double> low, std::span<const double> high,
                std::string_view css_class) {
  const std::size_t count = std::min({x.size(), low.size(), high.size()});
  std::vector<std::pair<double, double>> outline;
  const auto add = [&](double at, double value) {
    if (!std::isfinite(at) || !std::isfinite(value)) return;
    outline.emplace_back(std::clamp(x_px(at), left_, right_), std::clamp(y_px(value), top_, bottom_));
  };
  for (std::size_t i = 0; i < count; ++i) add(x[i], high[i]);
  for (std::size_t i = count; i-- > 0;) add(x[i], low[i]);
  svg_.polygon(outline, css_class);
}

void Plot::whisker(double x, double low, double high) {
  const double from = std::clamp(y_px(low), top_, bottom_);
  const double to = std::clamp(y_px(high), top_, bottom_);
  if (from != to) svg_.line(x_px(x), from, x_px(x), to, "whisker");
}

void Plot::point(double x, double y, std::string_view css_class, std::string_view fill, std::string_view tooltip,
                 double radius_px) {
  svg_.circle(x_px(x), y_px(y), radius_px, css_class, fill, tooltip);
}

void Plot::legend(std::string_view css_class, std::string_view text) {
  if (css_class.starts_with("band")) {
    svg_.rect(legend_x_, 8.0, 18.0, 10.0, css_class);
  } else if (css_class.starts_with("dot")) {
    svg_.circle(legend_x_ + 9.0, 13.0, 3.0, css_class);
  } else {
    svg_.line(legend_x_, 13.0, legend_x_ + 18.0, 13.0, css_class);
  }
  svg_.text(legend_x_ + 23.0, 17.0, text, "start", "tick");
  legend_x_ += 41.0 + kCharacter_px * static_cast<double>(text.size());
}

}  // namespace crosstie::report::detail
