#include <algorithm>
#include <map>
#include <set>

#include <fmt/format.h>

#include "report/detail/bundle_sections.h"
#include "report/detail/html.h"
#include "report/detail/number.h"

namespace crosstie::report::detail {
namespace {

using base::AdjustedNetwork;
using base::RejectedObservation;

/// "blunder: image point lies 0.31 px off" is of the kind "blunder".
std::string kind_of(const std::string& reason) {
  const std::size_t end = reason.find_first_of(":;");
  return reason.substr(0, end);
}

struct Group {
  int count = 0;
  std::set<int> ids;
  std::set<std::string> images;
};

template <typename Set>
std::string some_of(const Set& set) {
  constexpr std::size_t kMost = 6;
  std::string text;
  std::size_t k = 0;
  for (const auto& one : set) {
    if (k++ == kMost) break;
    text += fmt::format("{}{}", text.empty() ? "" : ", ", one);
  }
  return set.size() > kMost ? fmt::format("{} and {} more", text, set.size() - kMost) : text;
}

/// What the program left out by itself, in few lines.
std::string summary(const AdjustedNetwork& network) {
  std::map<std::string, Group> groups;
  for (const RejectedObservation& one : network.rejected) {
    Group& group = groups[kind_of(one.reason)];
    ++group.count;
    if (one.id != base::kNoId) group.ids.insert(one.id);
    group.images.insert(one.image);
  }
  HtmlTable table("Left out automatically, by reason.",
                  {{"Reason", "", "", false}, {"Number", ""}, {"Ids", "", "", false}, {"Images", "", "", false}});
  for (const auto& [reason, group] : groups) {
    table.add_row({text_cell(reason), number_cell(std::to_string(group.count), group.count), text_cell(some_of(group.ids)),
                   text_cell(some_of(group.images), "prose")});
  }
  for (const base::Warning& warning : network.warnings) {
    if (warning.code == "bar_not_seen" || warning.code == "control_not_seen" || warning.code == "datum_point_not_seen") {
      table.add_row({text_cell(warning.message), number_cell("1", 1.0), text_cell(warning.subject), text_cell("")});
    }
  }
  return table.empty() ? "" : table.html();
}

std::string uncoded_summary(const base::UncodedDots& uncoded) {
  if (uncoded.found == 0) return "";
  const auto ambiguous = std::count_if(uncoded.left.begin(), uncoded.left.end(), [](const auto& dot) { return dot.ambiguous; });
  return "<h3>Dots without a code</h3>\n" +
         definition_list({{"Found in oriented images", counted(uncoded.found)},
                          {"Belong to a target", counted(uncoded.matched)},
                          {"Targets", counted(uncoded.targets)},
                          {"Fit more than one target", counted(ambiguous)},
                          {"Belong to none", counted(static_cast<long long>(uncoded.left.size()) - ambiguous)}}) +
         (uncoded.left.empty()
              ? std::string()
              : paragraph(fmt::format(
                    "{} dots without a readable code belong to no point: glare, holes, targets that fewer than three images "
                    "show. They stand in unmatched.csv.",
                    counted(static_cast<long long>(uncoded.left.size())))));
}

}  // namespace

std::string bundle_rejected_section(const AdjustedNetwork& network) {
  const std::string rest = uncoded_summary(network.uncoded);
  if (network.rejected.empty()) return paragraph("No observation was rejected.") + summary(network) + rest;
  HtmlTable table(
      "Observations that took no part, with the reason. w is the standardised residual against the network without them.",
      {{"Image", "", "", false}, {"Id", ""}, {"Reason", "", "", false}, {"w", ""}});
  table.limit_rows(1000, "rejected.csv");
  for (const RejectedObservation& one : network.rejected) {
    table.add_row({text_cell(one.image),
                   one.id != base::kNoId ? number_cell(std::to_string(one.id), one.id) : text_cell("\u2013"),
                   text_cell(one.reason), one.w != 0.0 ? number_cell(significant(one.w, 3), one.w) : text_cell("\u2013")});
  }
  return summary(network) + table.html() + rest;
}

}  // namespace crosstie::report::detail
