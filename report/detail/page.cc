#include "report/detail/page.h"

#include <algorithm>
#include <array>

#include <fmt/format.h>

#include "base/content_policy.h"
#include "base/version.h"
#include "report/detail/assets.h"
#include "report/detail/html.h"
#include "report/detail/number.h"
#include "report/verdict_words.h"

namespace crosstie::report::detail {
namespace {

using base::Verdict;
using base::VerdictLevel;

const char* level_sign(VerdictLevel level) {
  return level == VerdictLevel::kOk ? "\u2713" : level == VerdictLevel::kWarning ? "!" : "\u2715";
}

/// So that XML parsers take the script as text.
std::string cdata(std::string_view script) { return fmt::format("/*<![CDATA[*/\n{}\n/*]]>*/", script); }

/// A test's: it accuses where p is low.
bool is_probability(const Verdict& verdict) { return verdict.unit == "p"; }

std::string verdict_sentence(const Verdict& verdict) {
  if (is_probability(verdict)) {
    return fmt::format("{}: p {} is {} the level of {}", verdict_words(verdict.name), probability(verdict.value),
                       verdict.level == VerdictLevel::kFail ? "below its share of" : "not below its share of",
                       plain(verdict.limit));
  }
  const std::string unit = verdict.unit.empty() ? "" : "\u00a0" + verdict.unit;
  const char* relation = verdict.level == VerdictLevel::kOk        ? "within the limit of"
                         : verdict.level == VerdictLevel::kWarning ? "too near to the limit of"
                                                                   : "beyond the limit of";
  return fmt::format("{}: {}{} is {} {}{}", verdict_words(verdict.name), plain(verdict.value), unit, relation,
                     plain(verdict.limit), unit);
}

std::string banner(const std::vector<Verdict>& verdicts, std::size_t warnings) {
  VerdictLevel worst = VerdictLevel::kOk;
  for (const Verdict& verdict : verdicts) worst = std::max(worst, verdict.level);
  const bool judged = !verdicts.empty();
  std::string reasons;
  for (const Verdict& verdict : verdicts) {
    if (verdict.level != VerdictLevel::kOk) {
      reasons += fmt::format("<li class=\"{}\">{}</li>\n", level_class(verdict.level), escape(verdict_sentence(verdict)));
    }
  }
  if (!judged) {
    reasons +=
        "<li>No limit was set for this result, so it is not judged. The figures below stand for themselves; [limits] of the "
        "job sets limits.</li>\n";
  } else if (worst == VerdictLevel::kOk) {
    const bool tests = std::all_of(verdicts.begin(), verdicts.end(), is_probability);
    reasons += fmt::format(
        "<li>{} {}.</li>\n",
        verdicts.size() == 1 ? "The check keeps its limit" : fmt::format("All {} checks keep their limits", verdicts.size()),
        tests ? "at the level of the check" : "by more than the uncertainty U (k = 2)");
  }
  if (warnings > 0) {
    reasons += fmt::format("<li><a href=\"#warnings\">{} warning{}</a> to read.</li>\n", warnings, warnings == 1 ? "" : "s");
  }
  return fmt::format(
      "<div class=\"banner {}\" role=\"status\"><div class=\"sign\" "
      "aria-hidden=\"true\">{}</div><div><strong>{}</strong>\n<ul>\n{}"
      "</ul></div></div>\n",
      judged ? level_class(worst) : "neutral", judged ? level_sign(worst) : "\u2013",
      judged ? std::string(base::verdict_level_name(worst)) : "NOT JUDGED", reasons);
}

std::string verdict_table(const std::vector<Verdict>& verdicts) {
  std::string caption =
      "Values held against their limits, after ISO 14253-1: inside by more than U (k = 2) is OK, within U of the limit "
      "WARNING, outside FAIL.";
  if (std::any_of(verdicts.begin(), verdicts.end(), is_probability)) {
    caption +=
        " A p is the probability of a deviation at least this large where nothing has moved; it FAILs where it is below its "
        "share of the level.";
  }
  HtmlTable table(caption, {{"Check", "", "", false},
                            {"Verdict", "", "", false},
                            {"Value", ""},
                            {"Limit", ""},
                            {"Unit", "", "", false},
                            {"Source of the limit", "", "", false}});
  table.as_cards();
  for (const Verdict& verdict : verdicts) {
    table.add_row({text_cell(verdict_words(verdict.name), "prose"),
                   text_cell(std::string(base::verdict_level_name(verdict.level)), level_class(verdict.level)),
                   number_cell(plain(verdict.value), verdict.value),
                   number_cell(fmt::format("{}\u00a0{}", is_probability(verdict) ? "\u2265" : "\u2264", plain(verdict.limit)),
                               verdict.limit),
                   text_cell(verdict.unit), text_cell(verdict.source, "prose")});
  }
  return table.html();
}

std::string warning_list(const std::vector<base::Warning>& warnings) {
  HtmlTable table("What to look at although there is a result.",
                  {{"Code", "", "", false}, {"Subject", "", "", false}, {"Message", "", "", false}});
  table.as_cards();
  for (const base::Warning& warning : warnings) {
    table.add_row({text_cell(warning.code), text_cell(warning.subject), text_cell(warning.message, "prose")});
  }
  return table.html();
}

std::string origin(const ReportContext& context) {
  std::string html = definition_list({{"Software", fmt::format("crosstie {}", base::version())},
                                      {"Operation", context.envelope.verb},
                                      {"Frame of the coordinates", context.envelope.frame}});
  if (!context.envelope.inputs.empty()) {
    HtmlTable table("Files that this result was computed from.", {{"File", "", "", false}, {"SHA-256", "", "", false}});
    for (const base::ResultInput& input : context.envelope.inputs) {
      table.add_row({text_cell(input.path), text_cell(input.sha256, "hash")});
    }
    html += fmt::format("<details><summary>{} input file{}</summary>{}</details>\n", context.envelope.inputs.size(),
                        context.envelope.inputs.size() == 1 ? "" : "s", table.html());
  }
  if (!context.options_json.empty()) {
    html += fmt::format("<details><summary>Effective options</summary><pre tabindex=\"0\">{}</pre></details>\n",
                        escape(context.options_json));
  }
  return html;
}

std::string section_html(const std::string& name, const std::string& heading, const std::string& content) {
  return fmt::format("<section id=\"{0}\" aria-labelledby=\"h-{0}\"><h2 id=\"h-{0}\">{1}</h2>\n{2}</section>\n", escape(name),
                     escape(heading), content);
}

}  // namespace

const char* level_class(VerdictLevel level) {
  return level == VerdictLevel::kOk ? "ok" : level == VerdictLevel::kWarning ? "warning" : "fail";
}

std::string paragraph(const std::string& text, const std::string& css_class) {
  return fmt::format("<p{}>{}</p>\n", css_class.empty() ? "" : fmt::format(" class=\"{}\"", escape(css_class)), escape(text));
}

Page::Page(const ReportContext& context) : context_(context), warnings_(context.envelope.warnings) {}

void Page::key_figures(const std::vector<KeyFigure>& figures) {
  figures_ = "<dl class=\"key\">\n";
  for (const KeyFigure& figure : figures) {
    figures_ += fmt::format("<div{}><dt>{}</dt><dd>{}</dd><dd class=\"detail\">{}</dd></div>\n",
                            figure.css_class.empty() ? "" : fmt::format(" class=\"{}\"", escape(figure.css_class)),
                            escape(figure.name), escape(figure.value), escape(figure.detail));
  }
  figures_ += "</dl>\n";
}

void Page::section(const std::string& name, const std::string& heading, const std::string& content) {
  sections_.push_back({name, heading, content});
}

void Page::first_section(const std::string& name, const std::string& heading, const std::string& content) {
  first_.push_back({name, heading, content});
}

void Page::warnings(const std::vector<base::Warning>& warnings) {
  for (const base::Warning& warning : warnings) {
    const bool known = std::any_of(warnings_.begin(), warnings_.end(), [&](const base::Warning& other) {
      return other.code == warning.code && other.subject == warning.subject && other.message == warning.message;
    });
    if (!known) warnings_.push_back(warning);
  }
}

void Page::scene(const std::string& heading, const std::string& scene_json, const std::string& fallback) {
  section(
      "view", heading,
      fmt::format(
          "<div class=\"viewer\" data-scene=\"scene\">{}</div>\n<script type=\"application/json\" id=\"scene\">{}</script>\n",
          fallback, scene_json));
  has_scene_ = true;
}

std::string Page::html() const {
  std::vector<Section> sections = sections_;
  if (!warnings_.empty()) sections.insert(sections.begin(), {"warnings", "Warnings", warning_list(warnings_)});
  if (!context_.envelope.verdicts.empty()) {
    sections.insert(sections.begin(), {"verdicts", "Verdicts", verdict_table(context_.envelope.verdicts)});
  }
  sections.insert(sections.begin(), first_.begin(), first_.end());
  sections.push_back({"origin", "Where this comes from", origin(context_)});

  const std::string css(page_css());
  const std::string script = cdata(page_js());
  const std::string viewer = has_scene_ ? cdata(viewer_js()) : "";
  std::string policy = fmt::format(
      "default-src 'none'; img-src 'self' file: data:; style-src {}; script-src {}{}{}; base-uri 'none'; form-action 'none'",
      base::csp_hash(css), base::csp_hash(script), has_scene_ ? " " : "", has_scene_ ? base::csp_hash(viewer) : "");
  std::string contents;
  std::string body;
  for (const Section& one : sections) {
    contents += fmt::format("<li><a href=\"#{}\">{}</a></li>\n", escape(one.name), escape(one.heading));
    body += section_html(one.name, one.heading, one.content);
  }
  std::string html = fmt::format(
      "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\"/>\n"
      "<meta http-equiv=\"Content-Security-Policy\" content=\"{}\"/>\n"
      "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\"/>\n<meta name=\"color-scheme\" content=\"light "
      "dark\"/>\n"
      "<meta name=\"generator\" content=\"crosstie {}\"/>\n<title>{}</title>\n<style>{}</style>\n</head>\n<body>\n",
      escape(policy), escape(base::version()),
      escape(context_.job.empty() ? context_.title : fmt::format("{} \u2013 {}", context_.job, context_.title)), css);
  const std::string overview =
      context_.overview.empty() ? ""
                                : fmt::format("<a class=\"overview\" href=\"{}\">Job overview</a>", escape(context_.overview));
  html += fmt::format(
      "<header><p class=\"job\">{}{}</p><h1>{}</h1></header>\n<nav aria-label=\"Contents\"><ul>\n{}</ul></nav>\n<main>\n",
      overview, escape(context_.job), escape(context_.title), contents);
  html += banner(context_.envelope.verdicts, warnings_.size());
  html += figures_ + body;
  html += "</main>\n<script>" + script + "</script>\n";
  if (has_scene_) html += "<script>" + viewer + "</script>\n";
  return html + "</body>\n</html>\n";
}

}  // namespace crosstie::report::detail
