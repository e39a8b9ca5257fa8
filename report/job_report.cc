#include "report/job_report.h"

#include <algorithm>
#include <array>
#include <string_view>

#include <fmt/format.h>

#include "report/detail/html.h"
#include "report/detail/page.h"
#include "report/verdict_words.h"

namespace crosstie::report {
namespace {

using base::VerdictLevel;
using detail::text_cell;

/// What a verb's result is, in the words of its user.
std::string_view about(std::string_view verb) {
  using Entry = std::pair<std::string_view, std::string_view>;
  constexpr std::array<Entry, 8> kAbout = {{{"calibrate", "lenses and rig of the scanning head, from the board"},
                                            {"detect", "markers in the photographs"},
                                            {"adjust", "coordinates of the markers, from photographs"},
                                            {"commission", "the head and its axis in the machine's frame"},
                                            {"scan", "the surface as one station saw it"},
                                            {"stitch", "one cloud of all stations"},
                                            {"edge", "the hole's edge, the part and the torch's path"},
                                            {"verify", "results against references"}}};
  const auto found = std::find_if(kAbout.begin(), kAbout.end(), [&](const Entry& entry) { return entry.first == verb; });
  return found == kAbout.end() ? std::string_view() : found->second;
}

detail::Cell level_cell(const std::vector<base::Verdict>& verdicts) {
  if (verdicts.empty()) return text_cell("not judged", "muted");
  VerdictLevel worst = VerdictLevel::kOk;
  for (const base::Verdict& verdict : verdicts) worst = std::max(worst, verdict.level);
  return text_cell(std::string(base::verdict_level_name(worst)), detail::level_class(worst));
}

std::string steps_table(const JobOverview& overview) {
  detail::HtmlTable table("Each step in the order of the work, with the worst of its verdicts.",
                          {{"Step", "", "its report", false},
                           {"Verdict", "", "", false},
                           {"What it gives", "", "", false},
                           {"Frame", "", "of its coordinates", false},
                           {"Checks"},
                           {"Warnings"}});
  table.as_cards();
  for (const JobResult& result : overview.results) {
    detail::Cell name = text_cell(result.name);
    name.href = result.page;
    const auto checks = result.envelope.verdicts.size();
    const auto warnings = result.envelope.warnings.size();
    table.add_row({name, level_cell(result.envelope.verdicts), text_cell(std::string(about(result.envelope.verb)), "prose"),
                   text_cell(result.envelope.frame), detail::number_cell(std::to_string(checks), static_cast<double>(checks)),
                   detail::number_cell(std::to_string(warnings), static_cast<double>(warnings))});
  }
  for (const std::string& step : overview.not_done)
    table.add_row({text_cell(step), text_cell("\u2013", "muted"), text_cell("not done yet", "muted"), text_cell(""),
                   text_cell(""), text_cell("")});
  return table.html();
}

}  // namespace

std::string job_report(const JobOverview& overview) {
  ReportContext context{.title = "Job overview", .job = overview.job, .envelope = {}, .options_json = {}, .overview = {}};
  context.envelope.verb = "run";
  context.envelope.frame = "as each step says";
  int failed = 0;
  for (const JobResult& result : overview.results) {
    for (base::Verdict verdict : result.envelope.verdicts) {
      verdict.name = fmt::format("{}: {}", result.name, verdict_words(verdict.name));
      failed += verdict.level == VerdictLevel::kFail ? 1 : 0;
      context.envelope.verdicts.push_back(std::move(verdict));
    }
    for (base::Warning warning : result.envelope.warnings) {
      warning.subject = warning.subject.empty() ? result.name : fmt::format("{}: {}", result.name, warning.subject);
      context.envelope.warnings.push_back(std::move(warning));
    }
  }
  detail::Page page(context);
  const std::size_t done = overview.results.size();
  std::vector<detail::KeyFigure> figures = {{"Results", std::to_string(done),
                                             overview.not_done.empty() ? std::string("all that the job asks for")
                                                                       : fmt::format("{} missing", overview.not_done.size()),
                                             overview.not_done.empty() ? "" : "warning"},
                                            {"Checks that FAIL", std::to_string(failed),
                                             fmt::format("of {}", context.envelope.verdicts.size()), failed > 0 ? "fail" : ""}};
  if (!overview.date.empty()) figures.push_back({"Date of the measurement", overview.date, "as the job says", ""});
  page.key_figures(figures);
  page.first_section("steps", "Steps", steps_table(overview));
  return page.html();
}

}  // namespace crosstie::report
