#include "report/detail/heat_map.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "report/detail/colour.h"
#include "report/detail/number.h"

namespace crosstie::report::detail {
namespace {

constexpr double kScaleRoom_px = 74.0;  // at the right, for the colours' scale
constexpr double kLabelRoom_px = 46.0;  // a written value needs a cell, or cells, of this width

struct Range {
  double low = 0.0;
  double high = 1.0;

  [[nodiscard]] double fraction(double value) const { return (value - low) / (high - low); }
};

Range range_of(const HeatGrid& grid, const HeatOptions& options) {
  if (options.high > options.low) return {options.low, options.high};
  double high = 0.0;
  for (const double value : grid.values.reshaped()) {
    if (std::isfinite(value)) high = std::max(high, value);
  }
  return {0.0, high > 0.0 ? high : 1.0};
}

void draw_scale(Plot& plot, const Range& range, const std::string& unit) {
  constexpr int kSteps = 40;
  const double left = plot.right() + 12.0;
  const double height = plot.bottom() - plot.top();
  for (int i = 0; i < kSteps; ++i) {
    plot.svg().rect(left, plot.bottom() - (i + 1) * height / kSteps, 12.0, height / kSteps + 0.4, "",
                    sequential_colour((i + 0.5) / kSteps));
  }
  const Axis ticks = make_axis(range.low, range.high, 5, false);
  for (const double tick : ticks.ticks) {
    plot.svg().text(left + 16.0, plot.bottom() - height * range.fraction(tick) + 4.0, ticks.label(tick), "start", "tick");
  }
  plot.svg().text(left, plot.top() - 9.0, unit, "start", "tick");
}

}  // namespace

std::string heat_map(const HeatGrid& grid, std::string_view title, std::string_view x_label, std::string_view y_label,
                     const std::vector<HeatMark>& marks, const HeatOptions& options) {
  const Eigen::Index rows = grid.values.rows();
  const Eigen::Index columns = grid.values.cols();
  const Range range = range_of(grid, options);
  Plot plot(title,
            fmt::format("{} in {} by {} cells, colours from {} to {} {}", grid.value_name, columns, rows,
                        significant(range.low, 3), significant(range.high, 3), grid.unit),
            grid.x, grid.y, x_label, y_label,
            {.width_px = options.width_px,
             .equal_scale = true,
             .y_down = options.y_down,
             .grid = false,
             .room_right_px = kScaleRoom_px});
  const double step_x = (grid.x.high - grid.x.low) / static_cast<double>(std::max<Eigen::Index>(1, columns));
  const double step_y = (grid.y.high - grid.y.low) / static_cast<double>(std::max<Eigen::Index>(1, rows));
  const double cell_px = std::abs(step_x) * plot.scale_x();
  const auto every = static_cast<Eigen::Index>(std::max(1.0, std::ceil(kLabelRoom_px / std::max(1.0, cell_px))));
  for (Eigen::Index row = 0; row < rows; ++row) {
    for (Eigen::Index column = 0; column < columns; ++column) {
      const double value = grid.values(row, column);
      if (!std::isfinite(value)) continue;
      const double x = plot.x_px(grid.x.low + static_cast<double>(column) * step_x);
      const double y0 = plot.y_px(grid.y.low + static_cast<double>(row) * step_y);
      const double y1 = plot.y_px(grid.y.low + static_cast<double>(row + 1) * step_y);
      plot.svg().rect(x, std::min(y0, y1), cell_px + 0.3, std::abs(y1 - y0) + 0.3, "", sequential_colour(range.fraction(value)),
                      fmt::format("{} {} {}", grid.value_name, significant(value, 3), grid.unit));
    }
  }
  for (Eigen::Index row = every / 2; row < rows; row += every) {
    for (Eigen::Index column = every / 2; column < columns; column += every) {
      const double value = grid.values(row, column);
      if (!std::isfinite(value)) continue;
      plot.svg().text(plot.x_px(grid.x.low + (static_cast<double>(column) + 0.5) * step_x),
                      plot.y_px(grid.y.low + (static_cast<double>(row) + 0.5) * step_y) + 3.5, significant(value, 2), "middle",
                      "cell on-colour");
    }
  }
  for (const HeatMark& mark : marks) {
    plot.point(mark.x, mark.y, "mark", "", mark.name, 3.5);
    if (!mark.name.empty()) {
      plot.svg().text(plot.x_px(mark.x) + 6.0, plot.y_px(mark.y) - 5.0, mark.name, "start", "cell on-colour");
    }
  }
  draw_scale(plot, range, grid.unit);
  return plot.str();
}

}  // namespace crosstie::report::detail
