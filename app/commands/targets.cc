// crosstie targets: the codes of a marker family, and sheets to print

#include <algorithm>
#include <filesystem>

#include <fmt/core.h>

#include "app/job.h"
#include "app/verb.h"
#include "base/file.h"
#include "markers/family.h"
#include "markers/id_choice.h"
#include "markers/sheet.h"

namespace crosstie::app {
namespace {

namespace fs = std::filesystem;
using base::ErrorCode;
using base::Result;

/// The ids that --ids names; all of the family without it.
Result<std::vector<int>> named_ids(const Arguments& arguments, const markers::MarkerFamily& family) {
  IdRanges wanted;
  if (arguments.has("--ids")) {
    auto parsed = parse_id_ranges(arguments.all("--ids"));
    if (!parsed) return base::fail(ErrorCode::kUsage, "--ids: " + parsed.error().message);
    wanted = *std::move(parsed);
  }
  std::vector<int> ids;
  for (const auto& code : family.codes) {
    if (wanted.ranges.empty() || wanted.contains(code.id)) ids.push_back(code.id);
  }
  for (const auto& [first, last] : wanted.ranges) {
    const auto next = std::lower_bound(ids.begin(), ids.end(), first);
    if (next != ids.end() && *next <= last) continue;
    return base::fail(ErrorCode::kUsage,
                      fmt::format("--ids: {} has no id {}", family.name,
                                  first == last ? fmt::format("{}", first) : fmt::format("from {} to {}", first, last)));
  }
  return ids;
}

/// The ids of the sheet: those named, or --count of them that lie far apart.
Result<std::vector<int>> chosen_ids(const Arguments& arguments, const markers::MarkerFamily& family, Session& session) {
  auto ids = named_ids(arguments, family);
  if (!ids) return ids;
  const auto count = arguments.integer("--count");
  if (!count) return tl::unexpected(count.error());
  if (!*count) return ids;
  if (**count < 1 || **count > static_cast<long>(ids->size())) {
    return base::fail(ErrorCode::kUsage, fmt::format("--count must be 1 to {}, not {}", ids->size(), **count));
  }
  auto choice = markers::choose_distant_ids(family, *ids, static_cast<int>(**count));
  if (!choice) return base::fail(std::move(choice));
  if (choice->ids.size() > 1) {
    session.say(fmt::format("{} ids; any two differ in at least {} of {} {}", choice->ids.size(), choice->smallest_distance,
                            family.bits, family.tag ? "cells" : "segments"));
  }
  return std::move(choice->ids);
}

Result<markers::SheetOptions> sheet_options(const Arguments& arguments, bool is_tag) {
  markers::SheetOptions options;
  const auto diameter_mm = arguments.number("--dot-diameter-mm");
  if (!diameter_mm) return tl::unexpected(diameter_mm.error());
  options.dot_diameter_mm = diameter_mm->value_or(options.dot_diameter_mm);
  const auto cell_mm = arguments.number("--cell-mm");
  if (!cell_mm) return tl::unexpected(cell_mm.error());
  options.cell_mm = cell_mm->value_or(options.cell_mm);
  if (is_tag ? diameter_mm->has_value() : cell_mm->has_value()) {
    return base::fail(ErrorCode::kUsage, is_tag ? "tags have no dot: their size is --cell-mm"
                                                : "rings have no cells: their size is --dot-diameter-mm");
  }
  const std::string page = arguments.get("--page").value_or("a4");
  if (page == "a3") {
    options.page = markers::SheetPage::kA3;
  } else if (page == "letter") {
    options.page = markers::SheetPage::kLetter;
  } else if (page != "a4") {
    return base::fail(ErrorCode::kUsage, fmt::format("--page is a4, a3 or letter, not '{}'", page));
  }
  const std::string polarity = arguments.get("--polarity").value_or("family");
  if (polarity == "white-on-black") {
    options.polarity = markers::SheetPolarity::kWhiteOnBlack;
  } else if (polarity == "black-on-white") {
    options.polarity = markers::SheetPolarity::kBlackOnWhite;
  } else if (polarity != "family") {
    return base::fail(ErrorCode::kUsage,
                      fmt::format("--polarity is family, white-on-black or black-on-white, not '{}'", polarity));
  }
  if (auto valid = options.validate(); !valid) return base::fail(std::move(valid));
  return options;
}

/// What is written where: one PDF, or an SVG for each page (sheet-1.svg, ... where there are several).
Result<std::vector<std::pair<fs::path, std::string>>> sheet_files(const fs::path& out,
                                                                  const std::vector<markers::Sheet>& sheets) {
  std::vector<std::pair<fs::path, std::string>> files;
  if (out.extension() == ".pdf") {
    files.emplace_back(out, markers::sheets_pdf(sheets));
  } else if (out.extension() == ".svg") {
    for (std::size_t i = 0; i < sheets.size(); ++i) {
      const fs::path numbered = out.parent_path() / fmt::format("{}-{}.svg", out.stem().string(), i + 1);
      files.emplace_back(sheets.size() == 1 ? out : numbered, markers::sheet_svg(sheets[i]));
    }
  } else {
    return base::fail(ErrorCode::kUsage, fmt::format("--out: sheets are .pdf or .svg, not '{}'", out.string()));
  }
  return files;
}

Result<Outcome> run(const Arguments& arguments, Session& session) {
  const auto family = markers::marker_family(*arguments.get("--family"));
  if (!family) return tl::unexpected(family.error());
  const auto out = arguments.get("--out");
  if (out && arguments.has("--list")) return base::fail(ErrorCode::kUsage, "targets: --list and --out are two different tasks");
  if (out && !arguments.has("--ids") && !arguments.has("--count")) {
    return base::fail(ErrorCode::kUsage, fmt::format("targets: say which of the {} ids are to be printed: --ids or --count",
                                                     family->codes.size()));
  }
  if (!out && !arguments.has("--list")) {
    return base::fail(ErrorCode::kUsage, "targets: say what is wanted, --list or --out sheet.pdf");
  }
  const auto options = sheet_options(arguments, family->tag.has_value());
  if (!options) return tl::unexpected(options.error());
  const auto ids = chosen_ids(arguments, *family, session);
  if (!ids) return tl::unexpected(ids.error());

  if (!out) {
    std::string lines;
    for (const auto& code : family->codes) {
      if (std::binary_search(ids->begin(), ids->end(), code.id)) lines += fmt::format("{} {}\n", code.id, code.code);
    }
    if (!lines.empty()) lines.pop_back();
    session.print(lines);
    return Outcome::kOk;
  }
  const auto sheets = markers::marker_sheets(*family, *ids, *options);
  if (!sheets) return tl::unexpected(sheets.error());
  const auto files = sheet_files(*out, *sheets);
  if (!files) return tl::unexpected(files.error());
  for (const auto& [path, contents] : *files) {
    if (auto written = base::write_file_atomically(path, contents); !written) return base::fail(std::move(written));
    session.print(path.string());
  }
  session.say(fmt::format("{} markers on {} page{}; print at 100 % and measure the rulers", ids->size(), sheets->size(),
                          sheets->size() == 1 ? "" : "s"));
  return Outcome::kOk;
}

}  // namespace

Verb targets_verb() {
  return {"targets",
          "list the codes of a marker family, or print markers true to scale",
          "  $ crosstie targets --family aicon14 --list | head -n 2\n"
          "  1 129\n"
          "  2 135\n"
          "  $ crosstie targets --family aicon14 --count 20 --out sheet.pdf\n"
          "  20 ids; any two differ in at least 4 of 14 segments\n"
          "  sheet.pdf\n"
          "  20 markers on 2 pages; print at 100 % and measure the rulers",
          {{"--family", "FAMILY", "ring10, aicon12/14/20, agisoft12/14/16/20, apriltag:tag36h11, ...", true, false, 1,
            markers::marker_family_names()},
           {"--list", "", "one id and its code (decimal; first segment or cell = most significant bit) a line", false, false},
           {"--ids", "IDS", "ids such as 1-20 or 3,7,12 (default: all of the family)", false, true},
           {"--count", "N", "that many of the ids, chosen so that their codes lie far apart", false, false},
           {"--out", "FILE", "sheets to print, .pdf, or .svg with one file a page", false, false},
           {"--dot-diameter-mm", "MM", "diameter of the dots in mm (default 12)", false, false},
           {"--cell-mm", "MM", "side of the cells of AprilTags in mm (default 5)", false, false},
           {"--page", "SIZE", "a4 (default), a3 or letter", false, false, 1, {"a4", "a3", "letter"}},
           {"--polarity",
            "TONE",
            "white-on-black (dots of ring10 and of reflecting film; inverted AprilTags), black-on-white (print), or family "
            "(default): what the family demands, else black-on-white",
            false,
            false,
            1,
            {"family", "white-on-black", "black-on-white"}}},
          run};
}

}  // namespace crosstie::app
