#include "report/detail/svg.h"

#include <cmath>
#include <initializer_list>
#include <numbers>

#include <fmt/format.h>

#include "report/detail/html.h"
#include "report/detail/number.h"

namespace crosstie::report::detail {
namespace {

constexpr double kFarOff_px = 1e6;  // far outside any drawing: viewers lose their way

bool drawable(std::initializer_list<double> values) {
  for (const double value : values) {
    if (!std::isfinite(value) || std::abs(value) > kFarOff_px) return false;
  }
  return true;
}

/// Two decimals without trailing zeros.
std::string px(double value) {
  std::string text = fixed(value, 2);
  text.erase(text.find_last_not_of('0') + 1);
  if (text.back() == '.') text.pop_back();
  return text;
}

std::string attributes(std::string_view css_class, std::string_view fill) {
  std::string text;
  if (!css_class.empty()) text += fmt::format(" class=\"{}\"", escape(css_class));
  if (!fill.empty()) text += fmt::format(" fill=\"{}\"", escape(fill));
  return text;
}

std::string point_list(const std::vector<std::pair<double, double>>& points) {
  std::string list;
  for (const auto& [x, y] : points) {
    if (drawable({x, y})) list += fmt::format("{}{},{}", list.empty() ? "" : " ", px(x), px(y));
  }
  return list;
}

std::string closing(std::string_view tag, std::string_view tooltip) {
  return tooltip.empty() ? "/>\n" : fmt::format("><title>{}</title></{}>\n", escape(tooltip), tag);
}

}  // namespace

Svg::Svg(double width, double height, std::string_view title, std::string_view description) : width_(width), height_(height) {
  head_ = fmt::format(
      "<svg viewBox=\"0 0 {0} {1}\" width=\"{0}\" height=\"{1}\" role=\"img\" aria-label=\"{2}\"><title>{3}</title>\n",
      px(width), px(height), escape(fmt::format("{}. {}", title, description)), escape(title));
}

void Svg::line(double x1, double y1, double x2, double y2, std::string_view css_class) {
  if (!drawable({x1, y1, x2, y2})) return;
  body_ += fmt::format("<line x1=\"{}\" y1=\"{}\" x2=\"{}\" y2=\"{}\"{}/>\n", px(x1), px(y1), px(x2), px(y2),
                       attributes(css_class, ""));
}

void Svg::polyline(const std::vector<std::pair<double, double>>& points, std::string_view css_class) {
  const std::string list = point_list(points);
  if (!list.empty()) body_ += fmt::format("<polyline points=\"{}\"{}/>\n", list, attributes(css_class, ""));
}

void Svg::polygon(const std::vector<std::pair<double, double>>& points, std::string_view css_class) {
  const std::string list = point_list(points);
  if (!list.empty()) body_ += fmt::format("<polygon points=\"{}\"{}/>\n", list, attributes(css_class, ""));
}

void Svg::rect(double x, double y, double width, double height, std::string_view css_class, std::string_view fill,
               std::string_view tooltip) {
  if (!drawable({x, y, width, height}) || width < 0.0 || height < 0.0) return;
  body_ += fmt::format("<rect x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\"{}{}", px(x), px(y), px(width), px(height),
                       attributes(css_class, fill), closing("rect", tooltip));
}

void Svg::circle(double x, double y, double radius, std::string_view css_class, std::string_view fill,
                 std::string_view tooltip) {
  if (!drawable({x, y, radius}) || radius < 0.0) return;
  body_ += fmt::format("<circle cx=\"{}\" cy=\"{}\" r=\"{}\"{}{}", px(x), px(y), px(radius), attributes(css_class, fill),
                       closing("circle", tooltip));
}

void Svg::ellipse(double x, double y, double semi_x, double semi_y, double turn_rad, std::string_view css_class,
                  std::string_view tooltip) {
  if (!drawable({x, y, semi_x, semi_y, turn_rad}) || semi_x < 0.0 || semi_y < 0.0) return;
  body_ +=
      fmt::format("<ellipse rx=\"{}\" ry=\"{}\" transform=\"translate({} {}) rotate({})\"{}{}", px(semi_x), px(semi_y), px(x),
                  px(y), px(turn_rad * 180.0 / std::numbers::pi), attributes(css_class, ""), closing("ellipse", tooltip));
}

void Svg::text(double x, double y, std::string_view text, std::string_view anchor, std::string_view css_class,
               double turn_deg) {
  if (!drawable({x, y, turn_deg})) return;
  const std::string turn = turn_deg == 0.0 ? "" : fmt::format(" transform=\"rotate({} {} {})\"", px(turn_deg), px(x), px(y));
  body_ += fmt::format("<text x=\"{}\" y=\"{}\"{}{}{}>{}</text>\n", px(x), px(y),
                       anchor == "start" ? "" : fmt::format(" text-anchor=\"{}\"", anchor), attributes(css_class, ""), turn,
                       escape(text));
}

void Svg::arrow(double x1, double y1, double x2, double y2, std::string_view css_class) {
  if (!drawable({x1, y1, x2, y2})) return;
  const double length = std::hypot(x2 - x1, y2 - y1);
  if (length < 0.2) return;
  const double head = std::min(4.0, 0.4 * length);
  const double ux = (x2 - x1) / length;
  const double uy = (y2 - y1) / length;
  body_ += fmt::format("<path d=\"M{} {}L{} {}M{} {}L{} {}L{} {}\"{}/>\n", px(x1), px(y1), px(x2), px(y2),
                       px(x2 - head * (ux + 0.5 * uy)), px(y2 - head * (uy - 0.5 * ux)), px(x2), px(y2),
                       px(x2 - head * (ux - 0.5 * uy)), px(y2 - head * (uy + 0.5 * ux)), attributes(css_class, ""));
}

std::string Svg::str() const { return head_ + body_ + "</svg>"; }

}  // namespace crosstie::report::detail
