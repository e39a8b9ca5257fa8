#include "app/live/job_facts.h"

#include <algorithm>
#include <cmath>
#include <system_error>

#include <fmt/core.h>
#include <nlohmann/json.hpp>

#include "app/job_steps.h"
#include "base/envelope_reader.h"
#include "base/json_file.h"

namespace crosstie::app {
namespace {

namespace fs = std::filesystem;
using base::Verdict;
using base::VerdictLevel;
using nlohmann::ordered_json;

/// A number at a path of keys; not a number where there is none.
double number_at(const ordered_json& json, std::initializer_list<const char*> keys) {
  const ordered_json* at = &json;
  for (const char* key : keys) {
    if (!at->is_object() || !at->contains(key)) return std::nan("");
    at = &(*at)[key];
  }
  return at->is_number() ? at->get<double>() : std::nan("");
}

VerdictLevel worst(const std::vector<Verdict>& verdicts) {
  VerdictLevel level = VerdictLevel::kOk;
  for (const Verdict& one : verdicts) level = std::max(level, one.level);
  return level;
}

std::string in_words(const std::vector<Verdict>& verdicts) {
  if (verdicts.empty()) return "no limit is set";
  const VerdictLevel level = worst(verdicts);
  if (level == VerdictLevel::kOk) return fmt::format("OK: all {} checks", verdicts.size());
  const auto bad = std::count_if(verdicts.begin(), verdicts.end(), [&](const Verdict& one) { return one.level == level; });
  return fmt::format("{}: {} of {} checks", base::verdict_level_name(level), bad, verdicts.size());
}

/// The steps whose results make a stage; the last one carries its report.
std::vector<std::string_view> steps_of_stage(LiveStage stage) {
  switch (stage) {
    case LiveStage::kCalibrate:
      return {"calibrate"};
    case LiveStage::kCommission:
      return {"commission"};
    case LiveStage::kScan:
      break;
  }
  return {"scan", "stitch", "edge", "verify"};
}

/// All results of the stage that the job asks for, or nothing where one is missing.
std::optional<JobFacts::Result> result_of(const Job& job, const fs::path& results, LiveStage stage) {
  JobFacts::Result found;
  for (const std::string_view name : steps_of_stage(stage)) {
    for (const JobStep* step : steps_of(job)) {
      if (step->name != name) continue;
      for (const auto& [result, folder] : results_of(*step, job)) {
        const auto envelope = base::read_envelope(results / folder);
        if (!envelope) return std::nullopt;
        found.verdicts.insert(found.verdicts.end(), envelope->verdicts.begin(), envelope->verdicts.end());
        std::error_code none;
        if (fs::exists(results / folder / "report.html", none))
          found.report = (results.filename() / folder / "report.html").generic_string();
      }
    }
  }
  if (found.report.empty() && found.verdicts.empty()) return std::nullopt;  // the job does not ask for it
  found.summary = in_words(found.verdicts);
  return found;
}

std::optional<GapStatus> gaps_of(const fs::path& results) {
  const auto json = base::read_json(results / "edge" / "result.json");
  const double length_to_last_mm = json ? number_at(*json, {"length_mm"}) : std::nan("");
  if (!(length_to_last_mm > 0.0) || !json->contains("gaps") || !(*json)["gaps"].is_array()) return std::nullopt;
  GapStatus gaps;
  double rim_mm = length_to_last_mm;
  for (const ordered_json& gap : (*json)["gaps"]) {
    const double length_mm = number_at(gap, {"length_mm"});
    if (!(length_mm > 0.0)) continue;
    ++gaps.count;
    gaps.length_mm += length_mm;
    if (number_at(gap, {"from_mm"}) >= length_to_last_mm)
      rim_mm += length_mm;  // the way back to the first point of an open rim
  }
  gaps.coverage = 1.0 - gaps.length_mm / rim_mm;
  return gaps;
}

HealthStatus health_of(const fs::path& results) {
  const auto envelope = base::read_envelope(results / "check");
  if (!envelope) return {};
  const VerdictLevel level = worst(envelope->verdicts);
  const auto failed = std::count_if(envelope->verdicts.begin(), envelope->verdicts.end(),
                                    [](const Verdict& one) { return one.level != VerdictLevel::kOk; });
  return {std::string(base::verdict_level_name(level)),
          failed == 0 ? fmt::format("the head is as it was commissioned, by all {} tests", envelope->verdicts.size())
                      : fmt::format("{} of {} tests say that the head is not as it was commissioned", failed,
                                    envelope->verdicts.size())};
}

}  // namespace

JobFacts read_job_facts(const Job& job, const fs::path& results) {
  JobFacts facts;
  for (const LiveStage stage : {LiveStage::kCalibrate, LiveStage::kCommission, LiveStage::kScan}) {
    if (auto found = result_of(job, results, stage)) facts.results.emplace(stage, *std::move(found));
  }
  for (const JobStation& station : job.stations) {
    if (!station.scan) continue;
    const fs::path folder = results / "scan" / station.name;
    const auto json = base::read_json(folder / "result.json");
    if (!json || !base::read_envelope(folder)) continue;
    facts.scanned[station.name] = {number_at(*json, {"head_test", "off_px"}), number_at(*json, {"head_test", "sigma_px"})};
  }
  facts.gaps = gaps_of(results);
  facts.health = health_of(results);
  return facts;
}

}  // namespace crosstie::app
