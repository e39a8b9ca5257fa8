#pragma once

#include <span>
#include <string>
#include <variant>
#include <vector>

#include <Eigen/Core>

#include "base/result.h"
#include "markers/family.h"

namespace crosstie::markers {

// Printable sheets as geometry. Page frame: origin in the upper left corner, x to the right, y down, mm; angles from x towards
// y, that is clockwise as seen. Shapes are painted one over the other, in their order, on white paper.

enum class Ink { kBlack, kWhite };

struct SheetDisc {
  Eigen::Vector2d centre_mm = Eigen::Vector2d::Zero();
  double radius_mm = 0.0;
  Ink ink = Ink::kBlack;
};

/// A part of a ring; the sweep is less than a full turn.
struct SheetSector {
  Eigen::Vector2d centre_mm = Eigen::Vector2d::Zero();
  double inner_radius_mm = 0.0;
  double outer_radius_mm = 0.0;
  double from_rad = 0.0;
  double sweep_rad = 0.0;
  Ink ink = Ink::kBlack;
};

struct SheetRectangle {
  Eigen::Vector2d corner_mm = Eigen::Vector2d::Zero();  ///< upper left
  Eigen::Vector2d size_mm = Eigen::Vector2d::Zero();
  Ink ink = Ink::kBlack;
};

/// One line of ASCII in black Helvetica.
struct SheetText {
  Eigen::Vector2d baseline_mm = Eigen::Vector2d::Zero();  ///< its left end, or its middle where centred
  double size_mm = 3.0;                                   ///< of the font
  bool centred = false;                                   ///< only for texts of digits and '#', which are equally wide
  std::string text;
};

using SheetShape = std::variant<SheetDisc, SheetSector, SheetRectangle, SheetText>;

struct Sheet {
  double width_mm = 0.0;
  double height_mm = 0.0;
  std::vector<SheetShape> shapes;
};

enum class SheetPage { kA4, kA3, kLetter };

/// Which tone the dots have. kOfFamily: white dots on black where the family demands a border of the dot's tone (ring10), else
/// black dots on white paper. Tags: as they are published, and so with kBlackOnWhite; kWhiteOnBlack exchanges black and white.
enum class SheetPolarity { kOfFamily, kWhiteOnBlack, kBlackOnWhite };

struct SheetOptions {
  /// [mm] Diameter of the dots. Default: the size of usual stick-on targets; 2 m away, a lens of 3000 px focal length shows it
  /// 18 px wide.
  double dot_diameter_mm = 12.0;

  /// [mm] Side of a tag's cells. Default: 2 m away, the same lens shows them 7.5 px wide, twice what is needed for reading.
  double cell_mm = 5.0;

  SheetPage page = SheetPage::kA4;
  SheetPolarity polarity = SheetPolarity::kOfFamily;

  /// An Error (kUsage) that names the field which is out of its domain.
  [[nodiscard]] base::Result<> validate() const;
};

/// Lays markers out on as many pages as they need, in the order of `ids`, true to scale. Every marker keeps its quiet zone and
/// its border (a tag one cell of paper more on each side); `#<id>` stands below, outside of both. Each page has a horizontal and a vertical ruler of 100 mm, so that the
/// printer's scale is checked in both directions, and a line that says what it is. The first segment of a code begins at 3
/// o'clock and they follow each other clockwise; tags stand upright.
///
/// Errors (kUsage): an id that the family does not have or that is given twice, no ids, a marker that is larger than the page.
[[nodiscard]] base::Result<std::vector<Sheet>> marker_sheets(const MarkerFamily& family, std::span<const int> ids,
                                                             const SheetOptions& options = {});

/// One page as SVG 1.1, in mm.
[[nodiscard]] std::string sheet_svg(const Sheet& sheet);

/// All pages as one PDF without compression: vector paths, Helvetica, a wish to viewers not to scale when printing, no date.
/// Circles are Bezier curves true to 5e-6 of their radius.
[[nodiscard]] std::string sheets_pdf(std::span<const Sheet> sheets);

}  // namespace crosstie::markers
