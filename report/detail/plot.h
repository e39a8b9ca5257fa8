#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "report/detail/svg.h"

namespace crosstie::report::detail {

/// A range of values with ticks at round numbers.
struct Axis {
  double low = 0.0;
  double high = 1.0;
  std::vector<double> ticks;
  int decimals = 0;  ///< of the tick labels

  [[nodiscard]] std::string label(double tick) const;
};

/// An axis over [low, high] with about `wanted` ticks at multiples of 1, 2 or 5 x 10^n. With `widen` the ends move out to
/// ticks. Degenerate and infinite ranges become one of width 1 round their value.
Axis make_axis(double low, double high, int wanted = 6, bool widen = true);

struct PlotOptions {
  double width_px = 520.0;
  double height_px = 320.0;
  bool equal_scale = false;  ///< one unit of x as long as one of y; the height then follows from the data
  bool y_down = false;       ///< image coordinates
  bool grid = true;
  double room_right_px = 0.0;  ///< beside the frame, for a scale of colours
};

/// A frame with axes into which data are drawn.
class Plot {
 public:
  Plot(std::string_view title, std::string_view description, Axis x, Axis y, std::string_view x_label, std::string_view y_label,
       const PlotOptions& options = {});

  [[nodiscard]] double x_px(double x) const;
  [[nodiscard]] double y_px(double y) const;
  /// px per unit of x.
  [[nodiscard]] double scale_x() const;
  [[nodiscard]] double left() const { return left_; }
  [[nodiscard]] double right() const { return right_; }
  [[nodiscard]] double top() const { return top_; }
  [[nodiscard]] double bottom() const { return bottom_; }
  Svg& svg() { return svg_; }

  /// A curve through data coordinates; points outside of the frame are clipped to it.
  void curve(std::span<const double> x, std::span<const double> y, std::string_view css_class);
  /// The area between two curves over the same x; clipped as curve() is.
  void band(std::span<const double> x, std::span<const double> low, std::span<const double> high, std::string_view css_class);
  /// An upright bar from low to high, as far as it is in the frame.
  void whisker(double x, double low, double high);
  void point(double x, double y, std::string_view css_class, std::string_view fill = "", std::string_view tooltip = "",
             double radius_px = 3.0);
  /// An entry of the legend, above the frame, looking as the series with that class: a line, a dot or a band.
  void legend(std::string_view css_class, std::string_view text);
  [[nodiscard]] std::string str() const { return svg_.str(); }

 private:
  static double fitted_height(const Axis& x, const Axis& y, const PlotOptions& options);
  void draw_frame(std::string_view x_label, std::string_view y_label, bool grid);

  Axis x_;
  Axis y_;
  bool y_down_;
  double left_;
  double right_;
  double top_;
  double bottom_;
  double legend_x_;
  Svg svg_;
};

}  // namespace crosstie::report::detail
