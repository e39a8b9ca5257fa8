#include "base/envelope_reader.h"

#include <limits>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "base/detail/result_reading.h"

namespace crosstie::base {

using detail::Json;

namespace {

VerdictLevel level_of(const std::string& name) {
  for (const VerdictLevel level : {VerdictLevel::kOk, VerdictLevel::kWarning, VerdictLevel::kFail}) {
    if (verdict_level_name(level) == name) return level;
  }
  throw detail::Unreadable(fmt::format("a verdict is \"{}\"; it must be OK, WARNING or FAIL", name));
}

/// JSON has no numbers that are not finite: they are null there.
double number_of(const Json& json) { return json.is_null() ? std::numeric_limits<double>::quiet_NaN() : json.get<double>(); }

ResultEnvelope envelope_of(const Json& json) {
  ResultEnvelope envelope;
  envelope.verb = json.at("verb");
  envelope.frame = json.at("frame");
  for (const Json& one : json.at("inputs")) envelope.inputs.push_back({one.at("path"), one.at("sha256")});
  for (const Json& one : json.at("verdicts")) {
    envelope.verdicts.push_back({one.at("name"), number_of(one.at("value")), number_of(one.at("limit")), one.at("unit"),
                                 one.at("source"), level_of(one.at("level"))});
  }
  for (const Json& one : json.at("warnings"))
    envelope.warnings.push_back({one.at("code"), one.at("subject"), one.at("message")});
  return envelope;
}

}  // namespace

Result<ResultEnvelope> read_envelope(const std::filesystem::path& folder) { return detail::read_result(folder, envelope_of); }

}  // namespace crosstie::base
