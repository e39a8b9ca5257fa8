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
constexpr double kTagQuietCells = 1.0;  // beyond the layout, which has a white ring of its own only in some families
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

/// Half the side of a tag with its quiet zone.
double tag_reach_mm(const TagLayout& layout, double cell_mm) { return (0.5 * layout.total_cells + kTagQuietCells) * cell_mm; }

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

/// The cells of the tone that the ground does not have, as runs along the rows and, over them, along the columns: viewers show
/// seams between rectangles that only touch.
void add_tag(Sheet& sheet, const MarkerFamily& family, const MarkerCode& code, const Vector2d& centre_mm, double cell_mm,
             bool inverted) {
  const TagLayout& layout = *family.tag;
  const int cells = layout.total_cells;
  const Vector2d corner_mm = centre_mm - Vector2d::Constant(0.5 * cells * cell_mm);
  if (inverted) {
    const double side_mm = 2.0 * tag_reach_mm(layout, cell_mm);
    sheet.shapes.emplace_back(SheetRectangle{centre_mm - Vector2d::Constant(0.5 * side_mm), {side_mm, side_mm}, Ink::kBlack});
  }
  // Published tags are black on paper; inverted ones have white where those are black.
  const auto is_drawn = [&](int x, int y) {
    const int cell = layout.at(x, y);
    return cell >= 0 ? ((code.code >> (family.bits - 1 - cell)) & 1U) == 0 : cell == TagLayout::kBlack;
  };
  for (const bool down : {false, true}) {
    for (int line = 0; line < cells; ++line) {
      const auto drawn = [&](int at) { return at < cells && (down ? is_drawn(line, at) : is_drawn(at, line)); };
      for (int first = 0; first < cells; ++first) {
        int length = 0;
        while (drawn(first + length)) ++length;
        if (length > (down ? 1 : 0)) {
          const Vector2d place = down ? Vector2d(line, first) : Vector2d(first, line);
          const Vector2d size = down ? Vector2d(1.0, length) : Vector2d(length, 1.0);
          sheet.shapes.emplace_back(
              SheetRectangle{corner_mm + cell_mm * place, cell_mm * size, inverted ? Ink::kWhite : Ink::kBlack});
        }
        first += length;
      }
    }
  }
  const double label_y = centre_mm.y() + tag_reach_mm(layout, cell_mm) + kLabelMm;
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
    const auto code = family.code_of(id);
    if (!code) return base::fail(ErrorCode::kUsage, fmt::format("{} has no id {}", family.name, id));
    if (!seen.insert(id).second) return base::fail(ErrorCode::kUsage, fmt::format("id {} is given twice", id));
    codes.push_back({id, *code});
  }
  return codes;
}

}  // namespace

Result<> SheetOptions::validate() const {
  if (!(dot_diameter_mm > 0.0) || !std::isfinite(dot_diameter_mm)) {
    return base::fail(ErrorCode::kUsage, fmt::format("dot_diameter_mm must be positive, not {}", dot_diameter_mm));
  }
  if (!(cell_mm > 0.0) || !std::isfinite(cell_mm)) {
    return base::fail(ErrorCode::kUsage, fmt::format("cell_mm must be positive, not {}", cell_mm));
  }
  return {};
}

Result<std::vector<Sheet>> marker_sheets(const MarkerFamily& family, std::span<const int> ids, const SheetOptions& options) {
  if (auto valid = options.validate(); !valid) return base::fail(std::move(valid));
  auto codes = codes_of(family, ids);
  if (!codes) return base::fail(std::move(codes));
  const Vector2d page_mm = page_size_mm(options.page);
  const double dot_radius_mm = options.dot_diameter_mm / 2.0;
  const double reach_mm = family.tag ? tag_reach_mm(*family.tag, options.cell_mm) : family.border_outer * dot_radius_mm;
  const std::string size = family.tag ? fmt::format("cells of {} mm (border square {} mm)", options.cell_mm,
                                                    family.tag->border_cells * options.cell_mm)
                                      : fmt::format("dot {} mm", options.dot_diameter_mm);
  const Grid grid(page_mm, reach_mm);
  if (grid.markers() == 0) {
    return base::fail(ErrorCode::kUsage, fmt::format("a marker of {}, {}, is {:.1f} mm wide and does not fit on the page",
                                                     family.name, size, 2.0 * reach_mm));
  }
  const Tones tones = tones_of(family, options.polarity);
  const std::size_t per_page = static_cast<std::size_t>(grid.markers());
  const std::size_t pages = (codes->size() + per_page - 1) / per_page;
  std::vector<Sheet> sheets;
  for (std::size_t page = 0; page < pages; ++page) {
    Sheet sheet{page_mm.x(), page_mm.y(), {}};
    const std::size_t end = std::min(codes->size(), (page + 1) * per_page);
    for (std::size_t i = page * per_page; i < end; ++i) {
      const Vector2d centre_mm = grid.centre_mm(static_cast<int>(i - page * per_page));
      if (family.tag) {
        add_tag(sheet, family, (*codes)[i], centre_mm, options.cell_mm, options.polarity == SheetPolarity::kWhiteOnBlack);
      } else {
        add_marker(sheet, family, (*codes)[i], centre_mm, dot_radius_mm, tones);
      }
    }
    const double bottom_mm = page_mm.y() - kMarginMm;
    add_ruler(sheet, {kMarginMm, bottom_mm - 5.0}, false);
    add_ruler(sheet, {kMarginMm - 1.0, bottom_mm - kFooterMm}, true);
    sheet.shapes.emplace_back(SheetText{{kMarginMm, bottom_mm},
                                        kTitleMm,
                                        false,
                                        fmt::format("{}, {}, page {} of {}. Print at 100 %: both rulers must measure {} mm.",
                                                    family.name, size, page + 1, pages, kRulerMm)});
    sheets.push_back(std::move(sheet));
  }
  return sheets;
}

}  // namespace crosstie::markers
