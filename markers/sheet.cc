#include "markers/sheet.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <set>

#include <fmt/format.h>

namespace crosstie::markers {
namespace {

using base::ErrorCode;
using base::Result;
using Eigen::Vector2d;

constexpr double kMarginMm = 12.0;  // printers leave some 5 mm blank; the vertical ruler stands in the rest
constexpr double kFooterMm = 15.0;  // horizontal ruler and title
constexpr double kGapMm = 3.0;      // between the borders of neighbours, so that they can be cut apart
constexpr double kLabelMm = 3.0;    // size of the ids' font
constexpr double kTitleMm = 3.0;
constexpr int kRulerMm = 100;
constexpr double kRulerLineMm = 0.15;

Vector2d page_size_mm(SheetPage page) {
  switch (page) {
    case SheetPage::kA3:
      return {297.0, 420.0};
    case SheetPage::kLetter:
      return {215.9, 279.4};
    case SheetPage::kA4:
      break;
  }
  return {210.0, 297.0};
}

/// Ink of the dot, and of its ground.
struct Tones {
  Ink one = Ink::kBlack;
  Ink zero = Ink::kWhite;
};

Tones tones_of(const MarkerFamily& family, SheetPolarity polarity) {
  const bool white_dots = polarity == SheetPolarity::kWhiteOnBlack ||
                          (polarity == SheetPolarity::kOfFamily && family.border_outer > family.disc_outer);
  return white_dots ? Tones{Ink::kWhite, Ink::kBlack} : Tones{Ink::kBlack, Ink::kWhite};
}

/// Neighbouring segments of tone 1 are one sector: no seams between them.
void add_ring(Sheet& sheet, const MarkerFamily& family, std::uint64_t code, const Vector2d& centre_mm, double dot_radius_mm,
              Ink ink) {
  const int bits = family.bits;
  const auto is_set = [&](int segment) { return ((code >> (bits - 1 - (segment % bits))) & 1U) != 0; };
  const double segment_rad = 2.0 * std::numbers::pi / bits;
  for (int first = 0; first < bits; ++first) {
    if (!is_set(first) || is_set(first + bits - 1)) continue;
    int length = 1;
    while (is_set(first + length)) ++length;
    sheet.shapes.emplace_back(SheetSector{centre_mm, family.ring_inner * dot_radius_mm, family.ring_outer * dot_radius_mm,
                                          first * segment_rad, length * segment_rad, ink});
  }
}

void add_marker(Sheet& sheet, const MarkerFamily& family, const MarkerCode& code, const Vector2d& centre_mm,
                double dot_radius_mm, const Tones& tones) {
  if (family.border_outer > family.disc_outer) {
    sheet.shapes.emplace_back(SheetDisc{centre_mm, family.border_outer * dot_radius_mm, tones.one});
  }
  sheet.shapes.emplace_back(SheetDisc{centre_mm, family.disc_outer * dot_radius_mm, tones.zero});
  add_ring(sheet, family, code.code, centre_mm, dot_radius_mm, tones.one);
  sheet.shapes.emplace_back(SheetDisc{centre_mm, dot_radius_mm, tones.one});
  const double label_y = centre_mm.y() + family.border_outer * dot_radius_mm + kLabelMm;
  sheet.shapes.emplace_back(SheetText{{centre_mm.x(), label_y}, kLabelMm, true, fmt::format("#{}", code.id)});
}

/// A rectangle given by its corner and extent, along x or with both axes exchanged.
SheetRectangle bar(const Vector2d& origin_mm, bool vertical, double along_mm, double across_mm, double length_mm,
                   double width_mm) {
  // The vertical ruler runs upwards from its origin, its ticks to the left; the horizontal one to the right, ticks upwards.
  if (vertical) {
    return {{origin_mm.x() - across_mm - width_mm, origin_mm.y() - along_mm - length_mm}, {width_mm, length_mm}, Ink::kBlack};
  }
  return {{origin_mm.x() + along_mm, origin_mm.y() - across_mm - width_mm}, {length_mm, width_mm}, Ink::kBlack};
}

/// Tick lines are centred on whole millimetres, so that the distance of the outermost ticks' middles is 100 mm.
void add_ruler(Sheet& sheet, const Vector2d& origin_mm, bool vertical) {
  sheet.shapes.emplace_back(bar(origin_mm, vertical, -kRulerLineMm / 2, 0.0, kRulerMm + kRulerLineMm, kRulerLineMm));
  for (int mm = 0; mm <= kRulerMm; ++mm) {
    const double tick_mm = mm % 10 == 0 ? 3.0 : mm % 5 == 0 ? 2.0 : 1.2;
    sheet.shapes.emplace_back(bar(origin_mm, vertical, mm - kRulerLineMm / 2, 0.0, kRulerLineMm, tick_mm));
  }
  for (const int mm : {0, kRulerMm / 2, kRulerMm}) {
    if (vertical && mm != kRulerMm) continue;
    const Vector2d at =
        vertical ? Vector2d(origin_mm.x() - 1.5, origin_mm.y() - mm - 0.8) : Vector2d(origin_mm.x() + mm, origin_mm.y() - 3.5);
    sheet.shapes.emplace_back(SheetText{at, 2.5, true, std::to_string(mm)});
  }
}

/// How many markers fit, and where.
struct Grid {
  int columns = 0;
  int rows = 0;
  Vector2d cell_mm = Vector2d::Zero();
  Vector2d first_mm = Vector2d::Zero();  ///< centre of the first marker

  Grid(const Vector2d& page_mm, double radius_mm) {
    cell_mm = {2.0 * radius_mm + kGapMm, 2.0 * radius_mm + 1.4 * kLabelMm + kGapMm};
    const Vector2d free_mm = page_mm - Vector2d(2.0 * kMarginMm, 2.0 * kMarginMm + kFooterMm);
    columns = static_cast<int>(std::floor((free_mm.x() + kGapMm) / cell_mm.x()));
    rows = static_cast<int>(std::floor((free_mm.y() + kGapMm) / cell_mm.y()));
    const double used_mm = columns * cell_mm.x() - kGapMm;
    first_mm = {kMarginMm + (free_mm.x() - used_mm) / 2.0 + radius_mm, kMarginMm + radius_mm};
  }

  [[nodiscard]] int markers() const { return std::max(columns, 0) * std::max(rows, 0); }
  [[nodiscard]] Vector2d centre_mm(int place) const {
    return first_mm + Vector2d(place % columns * cell_mm.x(), place / columns * cell_mm.y());
  }
};

Result<std::vector<MarkerCode>> codes_of(const MarkerFamily& family, std::span<const int> ids) {
  if (ids.empty()) return base::fail(ErrorCode::kUsage, "no ids are given for the sheet");
  std::vector<MarkerCode> codes;
  std::set<int> seen;
  for (const int id : ids) {
    const auto found = std::lower_bound(family.codes.begin(), family.codes.end(), id,
                                        [](const MarkerCode& code, int value) { return code.id < value; });
    if (found == family.codes.end() || found->id != id) {
      return base::fail(ErrorCode::kUsage, fmt::format("{} has no id {}", family.name, id));
    }
    if (!seen.insert(id).second) return base::fail(ErrorCode::kUsage, fmt::format("id {} is given twice", id));
    codes.push_back(*found);
  }
  return codes;
}

}  // namespace

Result<> SheetOptions::validate() const {
  if (!(dot_diameter_mm > 0.0) || !std::isfinite(dot_diameter_mm)) {
    return base::fail(ErrorCode::kUsage, fmt::format("dot_diameter_mm must be positive, not {}", dot_diameter_mm));
  }
  return {};
}

Result<std::vector<Sheet>> marker_sheets(const MarkerFamily& family, std::span<const int> ids, const SheetOptions& options) {
  if (auto valid = options.validate(); !valid) return base::fail(std::move(valid));
  auto codes = codes_of(family, ids);
  if (!codes) return base::fail(std::move(codes));
  const Vector2d page_mm = page_size_mm(options.page);
  const double dot_radius_mm = options.dot_diameter_mm / 2.0;
  const Grid grid(page_mm, family.border_outer * dot_radius_mm);
  if (grid.markers() == 0) {
    return base::fail(ErrorCode::kUsage,
                      fmt::format("a marker with a dot of {} mm is {:.1f} mm wide and does not fit on the page",
                                  options.dot_diameter_mm, 2.0 * family.border_outer * dot_radius_mm));
  }
  const Tones tones = tones_of(family, options.polarity);
  const std::size_t per_page = static_cast<std::size_t>(grid.markers());
  const std::size_t pages = (codes->size() + per_page - 1) / per_page;
  std::vector<Sheet> sheets;
  for (std::size_t page = 0; page < pages; ++page) {
    Sheet sheet{page_mm.x(), page_mm.y(), {}};
    const std::size_t end = std::min(codes->size(), (page + 1) * per_page);
    for (std::size_t i = page * per_page; i < end; ++i) {
      add_marker(sheet, family, (*codes)[i], grid.centre_mm(static_cast<int>(i - page * per_page)), dot_radius_mm, tones);
    }
    const double bottom_mm = page_mm.y() - kMarginMm;
    add_ruler(sheet, {kMarginMm, bottom_mm - 5.0}, false);
    add_ruler(sheet, {kMarginMm - 1.0, bottom_mm - kFooterMm}, true);
    sheet.shapes.emplace_back(
        SheetText{{kMarginMm, bottom_mm},
                  kTitleMm,
                  false,
                  fmt::format("{}, dot {} mm, page {} of {}. Print at 100 %: both rulers must measure {} mm.", family.name,
                              options.dot_diameter_mm, page + 1, pages, kRulerMm)});
    sheets.push_back(std::move(sheet));
  }
  return sheets;
}

}  // namespace crosstie::markers
