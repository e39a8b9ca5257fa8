#include "app/verb.h"

#include <fmt/core.h>

#include "base/text.h"

namespace crosstie::app {

using base::ErrorCode;
using base::Result;

std::optional<std::string> Arguments::get(const std::string& name) const {
  const auto found = values_.find(name);
  if (found == values_.end()) return std::nullopt;
  return found->second.back();
}

std::vector<std::string> Arguments::all(const std::string& name) const {
  const auto found = values_.find(name);
  return found == values_.end() ? std::vector<std::string>{} : found->second;
}

Result<std::optional<double>> Arguments::number(const std::string& name) const {
  const auto text = get(name);
  if (!text) return std::nullopt;
  const auto value = base::parse_double(*text);
  if (!value) return base::fail(ErrorCode::kUsage, fmt::format("{} takes a number, not '{}'", name, *text));
  return value;
}

Result<std::optional<long>> Arguments::integer(const std::string& name) const {
  const auto text = get(name);
  if (!text) return std::nullopt;
  const auto value = base::parse_int(*text);
  if (!value) return base::fail(ErrorCode::kUsage, fmt::format("{} takes a whole number, not '{}'", name, *text));
  return static_cast<long>(*value);
}

const std::vector<Verb>& verbs() {
  static const std::vector<Verb> table = {
      init_verb(),     targets_verb(), patterns_verb(), calibrate_verb(), detect_verb(),  adjust_verb(), commission_verb(),
      scan_verb(),     edge_verb(),    stitch_verb(),   verify_verb(),    run_verb(),     report_verb(), live_verb(),
      simulate_verb(), plan_verb(),    compare_verb(),  fit_verb(),       convert_verb(),
  };
  return table;
}

const std::vector<Option>& common_options() {
  static const std::vector<Option> options = {
      {"--quiet", "", "say nothing on stderr but errors"},
      {"--threads", "N", "worker threads; 0 = all cores (default); results do not depend on it"},
      {"--help", "", "show the options and an example, and exit"},
  };
  return options;
}

}  // namespace crosstie::app
