#include "markers/sheet.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "markers/detect.h"
#include "markers/family.h"
#include "markers/tags.h"

namespace crosstie::markers {
namespace {

using Eigen::Vector2d;
using testing::HasSubstr;

/// Whether a shape covers a point of the page, said in other words than those in which files are written.
bool covers(const SheetDisc& disc, const Vector2d& p) { return (p - disc.centre_mm).norm() <= disc.radius_mm; }
bool covers(const SheetSector& sector, const Vector2d& p) {
  const Vector2d d = p - sector.centre_mm;
  if (d.norm() < sector.inner_radius_mm || d.norm() > sector.outer_radius_mm) return false;
  const double turn = 2.0 * std::numbers::pi;
  return std::fmod(std::atan2(d.y(), d.x()) - sector.from_rad + 2.0 * turn, turn) <= sector.sweep_rad;
}
bool covers(const SheetRectangle& r, const Vector2d& p) {
  return (p - r.corner_mm).minCoeff() >= 0.0 && (r.corner_mm + r.size_mm - p).minCoeff() >= 0.0;
}

struct Box {
  Vector2d low, high;
};
Box box_of(const SheetDisc& disc) { return {disc.centre_mm.array() - disc.radius_mm, disc.centre_mm.array() + disc.radius_mm}; }
Box box_of(const SheetSector& s) { return {s.centre_mm.array() - s.outer_radius_mm, s.centre_mm.array() + s.outer_radius_mm}; }
Box box_of(const SheetRectangle& r) { return {r.corner_mm, r.corner_mm + r.size_mm}; }

constexpr int kPixelsPerMm = 4;
constexpr int kSamples = 4;  // per pixel and axis
constexpr int kFine = kPixelsPerMm * kSamples;

/// The sheet as a scanner without any blur would see it; texts are left out.
base::Image rasterised(const Sheet& sheet) {
  const int width = static_cast<int>(sheet.width_mm * kPixelsPerMm);
  const int height = static_cast<int>(sheet.height_mm * kPixelsPerMm);
  const int fine_width = width * kSamples;
  const int fine_height = height * kSamples;
  std::vector<std::uint8_t> fine(static_cast<std::size_t>(fine_width) * static_cast<std::size_t>(fine_height), 1);
  const auto paint = [&](const auto& shape) {
    const Box box = box_of(shape);
    const auto clamped = [](double mm, int last) { return std::clamp(static_cast<int>(std::floor(mm * kFine)), 0, last); };
    for (int y = clamped(box.low.y(), fine_height - 1); y <= clamped(box.high.y(), fine_height - 1); ++y) {
      for (int x = clamped(box.low.x(), fine_width - 1); x <= clamped(box.high.x(), fine_width - 1); ++x) {
        if (!covers(shape, Vector2d((x + 0.5) / kFine, (y + 0.5) / kFine))) continue;
        fine[static_cast<std::size_t>(y) * static_cast<std::size_t>(fine_width) + static_cast<std::size_t>(x)] =
            shape.ink == Ink::kWhite ? 1 : 0;
      }
    }
  };
  for (const SheetShape& shape : sheet.shapes) {
    if (const auto* disc = std::get_if<SheetDisc>(&shape)) paint(*disc);
    if (const auto* sector = std::get_if<SheetSector>(&shape)) paint(*sector);
    if (const auto* rectangle = std::get_if<SheetRectangle>(&shape)) paint(*rectangle);
  }
  base::Image image(width, height, 8);
  for (int y = 0; y < height; ++y) {
    auto* row = image.row<std::uint8_t>(y);
    for (int x = 0; x < width; ++x) {
      int white = 0;
      for (int dy = 0; dy < kSamples; ++dy) {
        const std::size_t first = static_cast<std::size_t>(y * kSamples + dy) * static_cast<std::size_t>(fine_width) +
                                  static_cast<std::size_t>(x * kSamples);
        for (int dx = 0; dx < kSamples; ++dx) white += fine[first + static_cast<std::size_t>(dx)];
      }
      row[x] = static_cast<std::uint8_t>(25 + 200 * white / (kSamples * kSamples));
    }
  }
  return image;
}

/// Where the sheet's labels say that each id's marker is: the dot above the label, the last disc before it.
std::map<int, Vector2d> centres_mm(const Sheet& sheet) {
  std::map<int, Vector2d> centres;
  Vector2d last = Vector2d::Zero();
  for (const SheetShape& shape : sheet.shapes) {
    if (const auto* disc = std::get_if<SheetDisc>(&shape)) last = disc->centre_mm;
    const auto* text = std::get_if<SheetText>(&shape);
    if (text != nullptr && text->text.starts_with('#')) centres.emplace(std::stoi(text->text.substr(1)), last);
  }
  return centres;
}

std::vector<int> first_ids(const MarkerFamily& family, std::size_t count) {
  std::vector<int> ids;
  for (std::size_t i = 0; i < std::min(count, family.codes.size()); ++i) ids.push_back(family.codes[i].id);
  return ids;
}

/// The same for tags: the middle of what was painted since the label before.
std::map<int, Vector2d> tag_centres_mm(const Sheet& sheet, double reach_mm) {
  std::map<int, Vector2d> centres;
  for (const SheetShape& shape : sheet.shapes) {
    const auto* text = std::get_if<SheetText>(&shape);
    if (text == nullptr || !text->text.starts_with('#')) continue;
    centres.emplace(std::stoi(text->text.substr(1)), text->baseline_mm - Vector2d(0.0, text->size_mm + reach_mm));
  }
  return centres;
}

void expect_every_id_is_read(const std::string& name, SheetPolarity polarity, double dot_diameter_mm, std::size_t count) {
  SCOPED_TRACE(name);
  const auto family = marker_family(name);
  ASSERT_TRUE(family);
  const std::vector<int> ids = first_ids(*family, count);
  constexpr double kCellMm = 2.0;
  const auto sheets =
      marker_sheets(*family, ids, {.dot_diameter_mm = dot_diameter_mm, .cell_mm = kCellMm, .polarity = polarity});
  ASSERT_TRUE(sheets) << sheets.error().message;
  std::vector<int> read;
  for (const Sheet& sheet : *sheets) {
    const base::Image image = rasterised(sheet);
    const auto found = detect(image.view(), *family);
    ASSERT_TRUE(found) << found.error().message;
    const auto centres =
        family->tag ? tag_centres_mm(sheet, (0.5 * family->tag->total_cells + 1.0) * kCellMm) : centres_mm(sheet);
    for (const base::Observation& o : found->observations) {
      if (o.status != base::ObservationStatus::kCoded) continue;
      read.push_back(o.id);
      ASSERT_TRUE(centres.contains(o.id)) << o.id;
      const Vector2d expected_px = centres.at(o.id).array() * kPixelsPerMm - 0.5;
      // Straight edges along the pixels snap to the samples of the rasteriser, half of one at most; circles average over it.
      EXPECT_LT((o.centre_px - expected_px).norm(), family->tag ? std::numbers::sqrt2 * 0.5 / kSamples : 0.05) << o.id;
      EXPECT_NEAR(o.semi_major_px, family->tag ? 0.0 : dot_diameter_mm / 2.0 * kPixelsPerMm, 0.1) << o.id;
    }
  }
  std::sort(read.begin(), read.end());
  EXPECT_EQ(read, ids);
}

TEST(Sheet, EveryRing10IdIsRead) { expect_every_id_is_read("ring10", SheetPolarity::kOfFamily, 8.0, 54); }

TEST(Sheet, BothPolaritiesOfEveryFamilyAreRead) {
  for (const std::string& name : marker_family_names()) {
    expect_every_id_is_read(name, SheetPolarity::kBlackOnWhite, 6.0, 16);
    expect_every_id_is_read(name, SheetPolarity::kWhiteOnBlack, 6.0, 16);
  }
}

/// A tag's border square is as many cells wide as the layout says, on the page.
TEST(Sheet, TagsAreTrueToScale) {
  const MarkerFamily family = *marker_family("apriltag:tag36h11");
  const auto sheets = marker_sheets(family, std::vector<int>{0}, {.cell_mm = 6.0});
  ASSERT_TRUE(sheets);
  const base::Image image = rasterised(sheets->front());
  const auto tags = detect_tags(image.view(), family);
  ASSERT_TRUE(tags && tags->size() == 1U);
  const auto& corners = tags->front().corners_px;
  EXPECT_NEAR((corners[1] - corners[0]).norm(), 8 * 6.0 * kPixelsPerMm, 0.05);
  EXPECT_NEAR((corners[2] - corners[1]).norm(), 8 * 6.0 * kPixelsPerMm, 0.05);
  EXPECT_LT(corners[0].x(), corners[1].x());
  EXPECT_LT(corners[0].y(), corners[3].y());
}

TEST(Sheet, TheTonesAreThoseAskedFor) {
  const auto ink_of_first_disc = [](const char* name, SheetPolarity polarity) {
    const auto family = marker_family(name);
    const auto sheets = marker_sheets(*family, std::vector<int>{family->codes[0].id}, {.polarity = polarity});
    Ink dot = Ink::kBlack;
    for (const SheetShape& shape : sheets->front().shapes) {
      if (const auto* disc = std::get_if<SheetDisc>(&shape)) dot = disc->ink;  // the dot is the last one
    }
    return dot;
  };
  EXPECT_EQ(ink_of_first_disc("ring10", SheetPolarity::kOfFamily), Ink::kWhite);
  EXPECT_EQ(ink_of_first_disc("aicon14", SheetPolarity::kOfFamily), Ink::kBlack);
  EXPECT_EQ(ink_of_first_disc("aicon14", SheetPolarity::kWhiteOnBlack), Ink::kWhite);
}

TEST(Sheet, RulersMeasureAHundredMillimetres) {
  const auto family = marker_family("ring10");
  for (const SheetPage page : {SheetPage::kA4, SheetPage::kA3, SheetPage::kLetter}) {
    const auto sheets = marker_sheets(*family, first_ids(*family, 54), {.page = page});
    ASSERT_TRUE(sheets);
    for (const Sheet& sheet : *sheets) {
      std::vector<double> along_x, along_y;  // middles of the long ticks
      for (const SheetShape& shape : sheet.shapes) {
        const auto* r = std::get_if<SheetRectangle>(&shape);
        if (r == nullptr) continue;
        EXPECT_GE(r->corner_mm.minCoeff(), 5.0) << "inside of what printers can print";
        EXPECT_LE(r->corner_mm.x() + r->size_mm.x(), sheet.width_mm - 5.0);
        EXPECT_LE(r->corner_mm.y() + r->size_mm.y(), sheet.height_mm - 5.0);
        if (r->size_mm.y() == 3.0) along_x.push_back(r->corner_mm.x() + r->size_mm.x() / 2.0);
        if (r->size_mm.x() == 3.0) along_y.push_back(r->corner_mm.y() + r->size_mm.y() / 2.0);
      }
      ASSERT_EQ(along_x.size(), 11U);
      ASSERT_EQ(along_y.size(), 11U);
      EXPECT_NEAR(along_x.back() - along_x.front(), 100.0, 1e-9);
      EXPECT_NEAR(along_y.front() - along_y.back(), 100.0, 1e-9);
    }
  }
}

TEST(Sheet, MarkersKeepApartFromEachOtherAndFromLabels) {
  const auto family = marker_family("aicon20");
  const SheetOptions options{.dot_diameter_mm = 5.0};
  const auto sheets = marker_sheets(*family, first_ids(*family, 100), options);
  ASSERT_TRUE(sheets);
  const double outer_mm = family->border_outer * options.dot_diameter_mm / 2.0;
  std::size_t markers = 0;
  for (const Sheet& sheet : *sheets) {
    const auto centres = centres_mm(sheet);
    markers += centres.size();
    for (const auto& [id, centre] : centres) {
      EXPECT_GE(centre.x() - outer_mm, 10.0);
      EXPECT_LE(centre.x() + outer_mm, sheet.width_mm - 10.0);
      for (const auto& [other, there] : centres) {
        if (id >= other) continue;
        EXPECT_GE((centre - there).norm(), 2.0 * outer_mm + 2.9);
      }
      for (const SheetShape& shape : sheet.shapes) {
        const auto* text = std::get_if<SheetText>(&shape);
        if (text == nullptr) continue;
        const Vector2d top = text->baseline_mm - Vector2d(0.0, 0.75 * text->size_mm);
        EXPECT_GE(std::min((top - centre).norm(), (text->baseline_mm - centre).norm()), outer_mm) << text->text;
      }
    }
  }
  EXPECT_EQ(markers, 100U);
}

TEST(Sheet, PdfIsWellFormed) {
  const auto family = marker_family("aicon14");
  const auto sheets = marker_sheets(*family, first_ids(*family, 60));
  ASSERT_TRUE(sheets);
  ASSERT_GT(sheets->size(), 1U);
  const std::string pdf = sheets_pdf(*sheets);
  EXPECT_EQ(pdf, sheets_pdf(*sheets));
  EXPECT_TRUE(pdf.starts_with("%PDF-"));
  EXPECT_TRUE(pdf.ends_with("%%EOF\n"));
  EXPECT_THAT(pdf, HasSubstr("/MediaBox [ 0 0 595.275591 841.889764 ]"));
  // The last number is where the table stands; the table says where each object stands.
  const std::size_t start = pdf.rfind("startxref\n") + 10;
  const std::size_t table = std::stoul(pdf.substr(start));
  ASSERT_EQ(pdf.substr(table, 5), "xref\n");
  const std::size_t count = std::stoul(pdf.substr(table + 7));
  ASSERT_EQ(count, 4 + 2 * sheets->size());
  const std::size_t entries = pdf.find('\n', table + 7) + 1;
  for (std::size_t i = 1; i < count; ++i) {
    const std::string entry = pdf.substr(entries + 20 * i, 20);
    EXPECT_EQ(entry.substr(10), " 00000 n \n");
    const std::string object = std::to_string(i) + " 0 obj\n";
    EXPECT_EQ(pdf.substr(std::stoul(entry), object.size()), object);
  }
  // Each stream is as long as it says.
  for (std::size_t at = pdf.find("/Length "); at != std::string::npos; at = pdf.find("/Length ", at + 1)) {
    const std::size_t length = std::stoul(pdf.substr(at + 8));
    const std::size_t begin = pdf.find("stream\n", at) + 7;
    EXPECT_EQ(pdf.substr(begin + length, 9), "endstream");
  }
}

TEST(Sheet, SvgStatesMillimetres) {
  const auto family = marker_family("ring10");
  const auto sheets = marker_sheets(*family, first_ids(*family, 3), {.page = SheetPage::kLetter});
  ASSERT_TRUE(sheets);
  const std::string svg = sheet_svg(sheets->front());
  EXPECT_THAT(svg, HasSubstr("width=\"215.9mm\" height=\"279.4mm\" viewBox=\"0 0 215.9 279.4\""));
  for (const int id : first_ids(*family, 3)) EXPECT_THAT(svg, HasSubstr(">#" + std::to_string(id) + "<"));
  EXPECT_THAT(svg, HasSubstr("r=\"6\" fill=\"#fff\""));
}

TEST(Sheet, RefusesWhatCannotBePrinted) {
  const auto family = marker_family("ring10");
  const int id = family->codes[0].id;
  const auto message = [&](std::vector<int> ids, const SheetOptions& options) {
    const auto sheets = marker_sheets(*family, ids, options);
    return sheets ? std::string() : sheets.error().message;
  };
  EXPECT_THAT(message({id}, {.dot_diameter_mm = 60.0}), HasSubstr("does not fit"));
  EXPECT_THAT(message({id}, {.dot_diameter_mm = -1.0}), HasSubstr("dot_diameter_mm"));
  EXPECT_THAT(message({id}, {.dot_diameter_mm = std::nan("")}), HasSubstr("dot_diameter_mm"));
  EXPECT_THAT(message({id}, {.cell_mm = 0.0}), HasSubstr("cell_mm"));
  const auto too_large = marker_sheets(*marker_family("apriltag:tag36h11"), std::vector<int>{1}, {.cell_mm = 18.0});
  EXPECT_THAT(too_large.error().message, HasSubstr("does not fit"));
  EXPECT_THAT(message({}, {}), HasSubstr("no ids"));
  EXPECT_THAT(message({9999}, {}), HasSubstr("no id 9999"));
  EXPECT_THAT(message({id, id}, {}), HasSubstr("twice"));
}

}  // namespace
}  // namespace crosstie::markers
