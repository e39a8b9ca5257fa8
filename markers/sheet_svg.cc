#include <cmath>
#include <numbers>

#include <fmt/format.h>

#include "markers/sheet.h"

namespace crosstie::markers {
namespace {

using Eigen::Vector2d;

/// Millimetres to 1e-5, without trailing zeros.
std::string mm(double value) {
  std::string text = fmt::format("{:.5f}", value);
  text.erase(text.find_last_not_of('0') + 1);
  if (text.ends_with('.')) text.pop_back();
  return text == "-0" ? "0" : text;
}

std::string point(const Vector2d& p) { return mm(p.x()) + ' ' + mm(p.y()); }
const char* colour(Ink ink) { return ink == Ink::kBlack ? "#000" : "#fff"; }

std::string escaped(const std::string& text) {
  std::string result;
  for (const char c : text) result += c == '&' ? "&amp;" : c == '<' ? "&lt;" : std::string(1, c);
  return result;
}

std::string svg(const SheetDisc& disc) {
  return fmt::format("<circle cx=\"{}\" cy=\"{}\" r=\"{}\" fill=\"{}\"/>\n", mm(disc.centre_mm.x()), mm(disc.centre_mm.y()),
                     mm(disc.radius_mm), colour(disc.ink));
}

std::string svg(const SheetSector& sector) {
  const auto at = [&](double radius, double angle) {
    return point(sector.centre_mm + radius * Vector2d(std::cos(angle), std::sin(angle)));
  };
  const double to = sector.from_rad + sector.sweep_rad;
  const int large = sector.sweep_rad > std::numbers::pi ? 1 : 0;
  const std::string outer = mm(sector.outer_radius_mm);
  const std::string inner = mm(sector.inner_radius_mm);
  return fmt::format("<path d=\"M{}A{} {} 0 {} 1 {}L{}A{} {} 0 {} 0 {}Z\" fill=\"{}\"/>\n",
                     at(sector.outer_radius_mm, sector.from_rad), outer, outer, large, at(sector.outer_radius_mm, to),
                     at(sector.inner_radius_mm, to), inner, inner, large, at(sector.inner_radius_mm, sector.from_rad),
                     colour(sector.ink));
}

std::string svg(const SheetRectangle& r) {
  return fmt::format("<rect x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\" fill=\"{}\"/>\n", mm(r.corner_mm.x()),
                     mm(r.corner_mm.y()), mm(r.size_mm.x()), mm(r.size_mm.y()), colour(r.ink));
}

std::string svg(const SheetText& text) {
  return fmt::format("<text x=\"{}\" y=\"{}\" font-size=\"{}\"{}>{}</text>\n", mm(text.baseline_mm.x()),
                     mm(text.baseline_mm.y()), mm(text.size_mm), text.centred ? " text-anchor=\"middle\"" : "",
                     escaped(text.text));
}

}  // namespace

std::string sheet_svg(const Sheet& sheet) {
  const std::string width = mm(sheet.width_mm);
  const std::string height = mm(sheet.height_mm);
  std::string text = fmt::format(
      "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{}mm\" height=\"{}mm\" viewBox=\"0 0 {} {}\" "
      "font-family=\"Helvetica, Arial, sans-serif\">\n<rect width=\"{}\" height=\"{}\" fill=\"#fff\"/>\n",
      width, height, width, height, width, height);
  for (const SheetShape& shape : sheet.shapes) {
    text += std::visit([](const auto& s) { return svg(s); }, shape);
  }
  return text + "</svg>\n";
}

}  // namespace crosstie::markers
