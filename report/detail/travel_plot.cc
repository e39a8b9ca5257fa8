#include "report/detail/travel_plot.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "report/detail/number.h"
#include "report/detail/plot.h"

namespace crosstie::report::detail {

std::string travel_plot(const TravelCurve& curve, std::string_view title, std::string_view y_label,
                        const std::vector<TravelMark>& marks, bool faint) {
  const std::size_t count = std::min({curve.at_mm.size(), curve.value.size(), curve.sigma.size()});
  std::vector<double> low(count);
  std::vector<double> high(count);
  double least = 0.0;
  double most = 0.0;
  const auto widen = [&](double value) {
    if (!std::isfinite(value)) return;
    least = std::min(least, value);
    most = std::max(most, value);
  };
  for (std::size_t i = 0; i < count; ++i) {
    low[i] = curve.value[i] - 2.0 * curve.sigma[i];
    high[i] = curve.value[i] + 2.0 * curve.sigma[i];
    widen(low[i]);
    widen(high[i]);
  }
  for (const TravelMark& mark : marks) widen(mark.value);
  const double from_mm = count > 0 ? curve.at_mm.front() : 0.0;
  const double to_mm = count > 0 ? curve.at_mm[count - 1] : 1.0;
  Plot plot(title,
            fmt::format("along the travel from {} to {} mm, between {} and {} {} with its uncertainty", plain(from_mm),
                        plain(to_mm), significant(least), significant(most), curve.unit),
            make_axis(from_mm, to_mm, 6, false), make_axis(least, most, 5), "axis reading [mm]", y_label,
            {.width_px = 460.0, .height_px = 230.0});
  plot.band(curve.at_mm, low, high, "band");
  plot.svg().line(plot.left(), plot.y_px(0.0), plot.right(), plot.y_px(0.0), "zero");
  plot.curve(curve.at_mm, curve.value, faint ? "curve faint" : "curve c1");
  for (const TravelMark& mark : marks) plot.point(mark.at_mm, mark.value, "dot", "", mark.name, 2.6);
  plot.svg().text(plot.left(), 17.0, title, "start", "label");
  return plot.str();
}

}  // namespace crosstie::report::detail
