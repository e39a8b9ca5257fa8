#pragma once

#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace crosstie::report::detail {

/// A drawing that is written into the page. Coordinates are px of the drawing, y downwards. Colours come from classes of the
/// page's style sheet, so that the drawing follows light and dark; a `fill` of one's own is written as an attribute. Whatever
/// is not finite is left out.
class Svg {
 public:
  /// `title` names the drawing and `description` tells its content to those who cannot see it.
  Svg(double width, double height, std::string_view title, std::string_view description);

  void line(double x1, double y1, double x2, double y2, std::string_view css_class);
  void polyline(const std::vector<std::pair<double, double>>& points, std::string_view css_class);
  void polygon(const std::vector<std::pair<double, double>>& points, std::string_view css_class);
  void rect(double x, double y, double width, double height, std::string_view css_class, std::string_view fill = "",
            std::string_view tooltip = "");
  void circle(double x, double y, double radius, std::string_view css_class, std::string_view fill = "",
              std::string_view tooltip = "");
  void ellipse(double x, double y, double semi_x, double semi_y, double turn_rad, std::string_view css_class,
               std::string_view tooltip = "");
  /// `anchor` is start, middle or end.
  void text(double x, double y, std::string_view text, std::string_view anchor = "start", std::string_view css_class = "",
            double turn_deg = 0.0);
  /// A line with an arrow head of its own size; nothing where it is shorter than 0.2 px.
  void arrow(double x1, double y1, double x2, double y2, std::string_view css_class);

  [[nodiscard]] double width() const { return width_; }
  [[nodiscard]] double height() const { return height_; }
  [[nodiscard]] std::string str() const;

 private:
  double width_;
  double height_;
  std::string head_;
  std::string body_;
};

}  // namespace crosstie::report::detail
