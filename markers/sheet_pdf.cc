// PDF as in ISO 32000-1: objects, a table of their offsets, a trailer.
#include <cmath>
#include <numbers>

#include <fmt/format.h>

#include "markers/sheet.h"

namespace crosstie::markers {
namespace {

using Eigen::Vector2d;

constexpr double kPointsPerMm = 72.0 / 25.4;
constexpr double kDigitWidth = 0.556;                        // of digits and '#' in Helvetica, in font sizes
constexpr double kMaxArcRad = std::numbers::pi / 4 + 1e-12;  // of one Bezier curve: true to 4.2e-6 of the radius

std::string number(double value) {
  std::string text = fmt::format("{:.6f}", value);
  text.erase(text.find_last_not_of('0') + 1);
  if (text.ends_with('.')) text.pop_back();
  return text == "-0" ? "0" : text;
}

std::string point(const Vector2d& p) { return number(p.x()) + ' ' + number(p.y()) + ' '; }

Vector2d on_circle(const Vector2d& centre, double radius, double angle) {
  return centre + radius * Vector2d(std::cos(angle), std::sin(angle));
}

/// Curves along a circle; the current point is at `from`. The control points lie 4/3 tan(sweep / 4) radii along the tangents.
std::string arc(const Vector2d& centre, double radius, double from, double sweep) {
  const int pieces = static_cast<int>(std::ceil(std::abs(sweep) / kMaxArcRad));
  const double step = sweep / pieces;
  const double reach = 4.0 / 3.0 * std::tan(step / 4.0) * radius;
  std::string path;
  for (int i = 0; i < pieces; ++i) {
    const double a = from + i * step;
    const double b = from + (i + 1) * step;
    path += point(on_circle(centre, radius, a) + reach * Vector2d(-std::sin(a), std::cos(a)));
    path += point(on_circle(centre, radius, b) - reach * Vector2d(-std::sin(b), std::cos(b)));
    path += point(on_circle(centre, radius, b)) + "c\n";
  }
  return path;
}

std::string grey(Ink ink) { return ink == Ink::kBlack ? "0 g\n" : "1 g\n"; }

std::string drawn(const SheetDisc& disc) {
  return grey(disc.ink) + point(on_circle(disc.centre_mm, disc.radius_mm, 0.0)) + "m\n" +
         arc(disc.centre_mm, disc.radius_mm, 0.0, 2.0 * std::numbers::pi) + "h f\n";
}

std::string drawn(const SheetSector& s) {
  const double to = s.from_rad + s.sweep_rad;
  return grey(s.ink) + point(on_circle(s.centre_mm, s.outer_radius_mm, s.from_rad)) + "m\n" +
         arc(s.centre_mm, s.outer_radius_mm, s.from_rad, s.sweep_rad) + point(on_circle(s.centre_mm, s.inner_radius_mm, to)) +
         "l\n" + arc(s.centre_mm, s.inner_radius_mm, to, -s.sweep_rad) + "h f\n";
}

std::string drawn(const SheetRectangle& r) { return grey(r.ink) + point(r.corner_mm) + point(r.size_mm) + "re f\n"; }

std::string drawn(const SheetText& text) {
  std::string escaped;
  for (const char c : text.text) {
    if (c == '(' || c == ')' || c == '\\') escaped += '\\';
    escaped += c;
  }
  const double width_mm = kDigitWidth * text.size_mm * static_cast<double>(text.text.size());
  const Vector2d at = text.baseline_mm - Vector2d(text.centred ? width_mm / 2.0 : 0.0, 0.0);
  // The page's y runs down, so letters are mirrored back.
  return fmt::format("0 g BT /F1 {} Tf 1 0 0 -1 {}Tm ({}) Tj ET\n", number(text.size_mm), point(at), escaped);
}

/// Collects objects, numbered from 1, and remembers where each begins.
class PdfFile {
 public:
  void add(const std::string& object) {
    offsets_.push_back(bytes_.size());
    bytes_ += fmt::format("{} 0 obj\n{}\nendobj\n", offsets_.size(), object);
  }

  [[nodiscard]] std::string finished() const {
    std::string bytes = bytes_ + fmt::format("xref\n0 {}\n0000000000 65535 f \n", offsets_.size() + 1);
    for (const std::size_t offset : offsets_) bytes += fmt::format("{:010} 00000 n \n", offset);
    return bytes +
           fmt::format("trailer\n<< /Size {} /Root 1 0 R >>\nstartxref\n{}\n%%EOF\n", offsets_.size() + 1, bytes_.size());
  }

 private:
  std::string bytes_ = "%PDF-1.6\n";  // 1.6: the first with PrintScaling
  std::vector<std::size_t> offsets_;
};

constexpr std::size_t kFirstPage = 4;  // after catalogue, list of pages and font; each page is followed by its contents

}  // namespace

std::string sheets_pdf(std::span<const Sheet> sheets) {
  PdfFile file;
  file.add("<< /Type /Catalog /Pages 2 0 R /ViewerPreferences << /PrintScaling /None >> >>");
  std::string kids;
  for (std::size_t i = 0; i < sheets.size(); ++i) kids += fmt::format("{} 0 R ", kFirstPage + 2 * i);
  file.add(fmt::format("<< /Type /Pages /Kids [ {}] /Count {} >>", kids, sheets.size()));
  file.add("<< /Type /Font /Subtype /Type1 /BaseFont /Helvetica >>");
  for (std::size_t i = 0; i < sheets.size(); ++i) {
    const Sheet& sheet = sheets[i];
    file.add(
        fmt::format("<< /Type /Page /Parent 2 0 R /MediaBox [ 0 0 {} {} ] /Resources << /Font << /F1 3 0 R >> >> "
                    "/Contents {} 0 R >>",
                    number(sheet.width_mm * kPointsPerMm), number(sheet.height_mm * kPointsPerMm), kFirstPage + 2 * i + 1));
    const std::string scale = number(kPointsPerMm);
    std::string contents = fmt::format("{} 0 0 -{} 0 {} cm\n", scale, scale, number(sheet.height_mm * kPointsPerMm));
    for (const SheetShape& shape : sheet.shapes) contents += std::visit([](const auto& s) { return drawn(s); }, shape);
    file.add(fmt::format("<< /Length {} >>\nstream\n{}endstream", contents.size(), contents));
  }
  return file.finished();
}

}  // namespace crosstie::markers
