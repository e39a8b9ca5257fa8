// crosstie report: where the reports of a job or a result are, and all of them as one PDF

#include <algorithm>
#include <filesystem>

#include <fmt/core.h>

#include "app/browser.h"
#include "app/verb.h"
#include "base/file.h"
#include "report/bound_report.h"

namespace crosstie::app {
namespace {

namespace fs = std::filesystem;
using base::ErrorCode;
using base::Result;

bool is_file(const fs::path& path) {
  std::error_code none;
  return fs::is_regular_file(path, none);
}

/// The page that is meant: of a job its overview, of a result its report.
Result<fs::path> page_of(const fs::path& path) {
  if (is_file(path) && path.extension() == ".html") return path;
  const fs::path folder = is_file(path) ? path.parent_path() : path;  // job.toml, result.json
  for (const char* name : {"results/index.html", "index.html", "report.html"}) {
    if (is_file(folder / name)) return folder / name;
  }
  std::error_code none;
  if (!fs::exists(path, none)) return base::fail(ErrorCode::kFileSystem, fmt::format("{}: not there", base::shown(path)));
  return base::fail(ErrorCode::kBadInput,
                    fmt::format("{}: no report there; crosstie run makes those of a job", base::shown(path)));
}

/// The reports that an overview leads to, in its order: addresses like "scan/x0500/report.html".
std::vector<std::string> reports_of(const std::string& overview) {
  constexpr std::string_view kFrom = " href=\"";
  std::vector<std::string> found;
  for (std::size_t at = overview.find(kFrom); at != std::string::npos; at = overview.find(kFrom, at + 1)) {
    const std::size_t from = at + kFrom.size();
    const std::string address = overview.substr(from, overview.find('"', from) - from);
    const bool known = std::find(found.begin(), found.end(), address) != found.end();
    if (address.ends_with("/report.html") && !address.starts_with("..") && !known) found.push_back(address);
  }
  return found;
}

Result<> add_page(const fs::path& file, const std::string& from_top, std::vector<report::BoundPage>& pages) {
  auto html = base::read_file(file);
  if (!html) return base::fail(std::move(html));
  std::error_code none;
  pages.push_back({*std::move(html), fs::absolute(file, none).parent_path().lexically_normal().string(), from_top});
  return {};
}

Result<Outcome> report_pages(const Arguments& arguments, Session& session) {
  const auto page = page_of(*arguments.get("PATH"));
  if (!page) return tl::unexpected(page.error());
  std::vector<report::BoundPage> pages;
  if (auto added = add_page(*page, "", pages); !added) return base::fail(std::move(added));
  const std::vector<std::string> more =
      page->filename() == "index.html" ? reports_of(pages.front().html) : std::vector<std::string>{};
  const auto pdf = arguments.get("--pdf");
  if (!pdf) {
    if (arguments.has("--browser")) return base::fail(ErrorCode::kUsage, "--browser prints: it needs --pdf");
    session.print(page->string());
    for (const std::string& one : more) session.print((page->parent_path() / one).string());
    return Outcome::kOk;
  }
  const auto browser = find_browser(arguments.get("--browser"));
  if (!browser) return tl::unexpected(browser.error());
  for (const std::string& one : more) {
    if (auto added = add_page(page->parent_path() / one, one, pages); !added) return base::fail(std::move(added));
  }
  const std::string html = report::bound_report(pages);
  if (html.empty()) {
    return base::fail(ErrorCode::kBadInput,
                      fmt::format("{}: it, or a report that it leads to, is no page of crosstie", base::shown(*page)));
  }
  if (auto printed = print_as_pdf(html, *pdf, *browser, session.progress()); !printed) return base::fail(std::move(printed));
  session.say(
      fmt::format("{} report{} printed by {}", pages.size(), pages.size() == 1 ? "" : "s", browser->filename().string()));
  session.print(*pdf);
  return Outcome::kOk;
}

}  // namespace

Verb report_verb() {
  return {
      "report",
      "say where the reports of a job or a result are, or print all of them as one PDF",
      "  $ crosstie report door --pdf door.pdf\n"
      "  12 reports printed by chromium\n"
      "  door.pdf",
      {{"PATH", "PATH", "job folder, folder of a result, or a report's .html file", true, false},
       {"--pdf", "FILE",
        "print with Chromium, Chrome or Edge into this file: of a job its overview and every report that it leads to (default: "
        "print their paths)",
        false, false},
       {"--browser", "FILE", "the browser that prints; default: the first of chromium, google-chrome, microsoft-edge on PATH",
        false, false}},
      report_pages};
}

}  // namespace crosstie::app
