#include "app/steps_acceptance.h"

#include <algorithm>
#include <map>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "app/acceptance_file.h"
#include "app/current.h"
#include "app/point_covariance.h"
#include "app/result_folder.h"
#include "app/surface_task.h"
#include "app/verdicts.h"
#include "base/acceptance_document.h"
#include "base/file.h"
#include "base/json_file.h"
#include "base/measured_points.h"
#include "base/result_document.h"
#include "report/acceptance_report.h"
#include "verify/acceptance.h"
#include "verify/repeatability.h"

namespace crosstie::app {
namespace {

namespace fs = std::filesystem;
using base::ErrorCode;
using base::fail;
using base::Result;
using nlohmann::ordered_json;

ordered_json options_of(const AcceptanceFile& file) {
  const verify::AcceptanceOptions& o = file.options;
  return {{"acceptance",
           {{"part", o.part},
            {"discard_share", o.discard_share},
            {"cap_rad", o.cap()},
            {"least_cap_rad", o.least_cap()},
            {"shell", o.shell},
            {"plate_gate_mm", o.plate_gate_mm},
            {"plate_border_mm", o.plate_border_mm},
            {"least_points", o.least_points},
            {"resamples", o.resamples},
            {"volume_diagonal_mm", file.volume_diagonal_mm}}}};
}

Result<base::AcceptancePosition> measure(const AcceptanceFile& file, const AcceptancePlace& place, std::string& frame) {
  auto points = base::read_measured_points(place.cloud, {.unit = file.unit, .columns = {}});
  if (!points) return fail(std::move(points));
  frame = points->frame;
  base::Cloud cloud;
  cloud.frame = points->frame;
  cloud.points = std::move(points->points_mm);
  cloud.cov_mm2 = std::move(points->cov_mm2);
  const auto named = [&](const base::Error& error) {
    return fail(error.code, fmt::format("position {} ({}): {}", place.name, base::shown(place.cloud), error.message));
  };
  base::AcceptancePosition position;
  if (place.artefact == "bar") {
    auto bar = verify::measure_bar(cloud, place.bar, file.options);
    if (!bar) return named(bar.error());
    position = *std::move(bar);
  } else if (place.artefact == "sphere") {
    auto sphere = verify::measure_sphere(cloud, place.sphere, file.options);
    if (!sphere) return named(sphere.error());
    position.spheres.push_back(*std::move(sphere));
  } else {
    auto plane = verify::measure_plane(cloud, place.plane, file.options);
    if (!plane) return named(plane.error());
    position.plane = *std::move(plane);
  }
  position.name = place.name;
  position.artefact = place.artefact;
  return position;
}

std::vector<base::Verdict> judge(const base::Acceptance& acceptance, const AcceptanceFile& file) {
  static const std::map<std::string, std::string> kNames = {{"PF", "probing_form_mm"},
                                                            {"PS", "probing_size_mm"},
                                                            {"SD", "sphere_spacing_mm"},
                                                            {"F", "flatness_mm"},
                                                            {"E", "length_error_mm"}};
  std::vector<base::Verdict> verdicts;
  for (const base::AcceptanceCharacteristic& of : acceptance.characteristics) {
    if (!of.limit_mm) continue;
    const std::string source =
        file.limits_source.empty() ? "limits of the acceptance test, whose source it does not name" : file.limits_source;
    verdicts.push_back({kNames.at(of.name), std::abs(of.value.value_mm), *of.limit_mm, "mm", source, of.level});
  }
  return verdicts;
}

std::string summary_of(const base::Acceptance& acceptance) {
  std::string text;
  for (const base::AcceptanceCharacteristic& of : acceptance.characteristics) {
    text += fmt::format("{}{} {:.4f} +- {:.4f} mm ({} of {} positions)", text.empty() ? "" : ", ", of.name, of.value.value_mm,
                        of.value.sigma_mm(), of.positions, of.positions_asked);
  }
  return text;
}

/// The path of a run's result.json.
fs::path result_of(const fs::path& run) { return run.extension() == ".json" ? run : run / "result.json"; }

/// A value with its sigma of acceptance results, or nothing.
void add_value(const ordered_json& json, const std::string& name, std::map<std::string, base::RepeatedQuantity>& quantities) {
  if (!json.is_object() || !json.contains("value_mm") || !json["value_mm"].is_number() || !json.contains("noise_sigma_mm") ||
      !json["noise_sigma_mm"].is_number())
    return;
  base::RepeatedQuantity& quantity = quantities[name];
  quantity.name = name;
  quantity.values.push_back(json["value_mm"].get<double>());
  quantity.sigmas.push_back(json["noise_sigma_mm"].get<double>());  // the artefact is the same in every run
}

Result<std::vector<base::RepeatedGroup>> repeat_acceptances(const std::vector<ordered_json>& runs) {
  std::map<std::string, std::map<std::string, base::RepeatedQuantity>> groups;
  for (const ordered_json& run : runs) {
    if (!run.contains("acceptance") || !run["acceptance"].is_object() || !run["acceptance"].contains("positions"))
      return fail(ErrorCode::kBadInput, "of the results of verify those of an acceptance test repeat (verify --acceptance)");
    for (const ordered_json& position : run["acceptance"]["positions"]) {
      const std::string place = position.value("name", "");
      if (position.contains("spheres")) {
        for (const ordered_json& sphere : position["spheres"]) {
          const std::string name = place + (sphere.value("name", "").empty() ? "" : " " + sphere.value("name", ""));
          if (sphere.contains("form")) add_value(sphere["form"], name, groups["PF"]);
          if (sphere.contains("size")) add_value(sphere["size"], name, groups["PS"]);
        }
      }
      if (position.contains("spacing")) add_value(position["spacing"].value("error", ordered_json()), place, groups["SD"]);
      if (position.contains("plane")) add_value(position["plane"].value("flatness", ordered_json()), place, groups["F"]);
    }
  }
  std::vector<base::RepeatedGroup> result;
  for (auto& [name, quantities] : groups) {
    std::vector<base::RepeatedQuantity> common;
    for (auto& [key, quantity] : quantities) {
      if (quantity.values.size() == runs.size()) common.push_back(std::move(quantity));
    }
    if (common.empty()) continue;
    auto group = verify::repeat_group(name, std::move(common));
    if (!group) return fail(std::move(group));
    group->about = "by the names of positions and spheres; predicted is the part of noise, since the artefact is the same";
    result.push_back(*std::move(group));
  }
  if (result.empty()) return fail(ErrorCode::kBadInput, "the acceptance tests have no position in common");
  return result;
}

Result<std::vector<base::RepeatedGroup>> repeat_networks(const std::vector<fs::path>& files,
                                                         const std::vector<ordered_json>& runs) {
  std::vector<verify::RepeatedPoints> points;
  bool align = false;
  for (std::size_t i = 0; i < files.size(); ++i) {
    auto list = base::points_from_network_json(files[i]);
    if (!list) return fail(std::move(list));
    auto covariance = point_covariance(files[i], list->points.size());
    if (!covariance) return fail(std::move(covariance));
    points.push_back({base::shown(files[i]), *std::move(list), *std::move(covariance)});
    align = align || runs[i].value("datum", "") != "control points";
  }
  auto group = verify::repeat_points(points, align);
  if (!group) return fail(std::move(group));
  return std::vector<base::RepeatedGroup>{*std::move(group)};
}

Result<std::vector<base::RepeatedGroup>> repeat_edges(const std::vector<fs::path>& files) {
  std::vector<verify::RepeatedRim> rims;
  for (const fs::path& file : files) {
    auto rim = read_rim_table(file.parent_path() / "edge.csv");
    if (!rim) return fail(std::move(rim));
    rims.push_back({base::shown(file), std::move(rim->points)});
  }
  return verify::repeat_rims(rims);
}

}  // namespace

Result<StepOutcome> acceptance_step(const fs::path& path, const fs::path& out, Session& session) {
  const auto file = read_acceptance_file(path);
  if (!file) return tl::unexpected(file.error());
  if (auto ok = file->options.validate(); !ok) return fail(std::move(ok));
  const ordered_json options = options_of(*file);
  const fs::path base_folder = path.has_parent_path() ? path.parent_path() : fs::current_path();
  std::vector<fs::path> files = {path};
  for (const AcceptancePlace& place : file->places) {
    if (std::find(files.begin(), files.end(), place.cloud) == files.end()) files.push_back(place.cloud);
  }
  auto inputs = hashed_inputs(files, base_folder);
  if (!inputs) return fail(std::move(inputs));
  const ordered_json earlier = earlier_result(out, options);
  if (same_inputs(earlier, *inputs)) return StepOutcome{out, "up to date", true, outcome_of(earlier)};
  auto folder = ResultFolder::begin(out);
  if (!folder) return fail(std::move(folder));
  std::vector<base::AcceptancePosition> positions;
  std::string frame;
  for (const AcceptancePlace& place : file->places) {
    const auto progress = session.progress();
    if (progress.cancelled()) return base::cancelled("the acceptance test");
    progress("acceptance", positions.size(), file->places.size());
    auto measured = measure(*file, place, frame);
    if (!measured) return fail(std::move(measured));
    positions.push_back(*std::move(measured));
  }
  const base::Acceptance acceptance =
      verify::judge_acceptance(std::move(positions), file->limits, file->options.part, file->volume_diagonal_mm);
  const base::ResultEnvelope envelope{"verify", frame, *std::move(inputs), judge(acceptance, *file), acceptance.warnings};
  if (auto written = report::write_acceptance_tables(folder->path(), acceptance); !written) return fail(std::move(written));
  const std::string html = report::acceptance_report(acceptance, {"Acceptance test", file->name, envelope, options.dump(2)});
  if (auto published = publish(*folder, html, base::result_json(envelope, options, base::acceptance_json(acceptance)));
      !published)
    return fail(std::move(published));
  return StepOutcome{out, summary_of(acceptance), false, outcome_of(envelope.verdicts)};
}

Result<StepOutcome> repeat_step(const std::vector<fs::path>& runs, std::optional<double> ratio_limit, const fs::path& out,
                                Session& session) {
  if (runs.size() < 2) return fail(ErrorCode::kUsage, "--repeat takes the results of two runs or more");
  base::Repeatability repeatability;
  std::vector<fs::path> files;
  std::vector<ordered_json> results;
  for (const fs::path& run : runs) {
    files.push_back(result_of(run));
    auto json = base::read_json(files.back());
    if (!json) return fail(std::move(json));
    if (!json->is_object() || !json->contains("verb") || !(*json)["verb"].is_string())
      return fail(ErrorCode::kBadInput, base::shown(files.back()) + ": no result of crosstie");
    const std::string verb = (*json)["verb"].get<std::string>();
    if (!repeatability.verb.empty() && verb != repeatability.verb)
      return fail(ErrorCode::kBadInput, fmt::format("{} is a result of {}, those before are of {}", base::shown(files.back()),
                                                    verb, repeatability.verb));
    repeatability.verb = verb;
    repeatability.runs.push_back(base::shown(run));
    results.push_back(*std::move(json));
  }
  std::vector<fs::path> read = files;
  if (repeatability.verb == "edge") {
    for (const fs::path& file : files) read.push_back(file.parent_path() / "edge.csv");
  }
  auto inputs = hashed_inputs(read, fs::current_path());
  if (!inputs) return fail(std::move(inputs));
  ordered_json options = {{"repeat", repeatability.verb}};
  if (ratio_limit) options["max_ratio"] = *ratio_limit;
  const ordered_json earlier = earlier_result(out, options);
  if (same_inputs(earlier, *inputs)) return StepOutcome{out, "up to date", true, outcome_of(earlier)};
  auto folder = ResultFolder::begin(out);
  if (!folder) return fail(std::move(folder));
  auto groups = repeatability.verb == "adjust" ? repeat_networks(files, results)
                : repeatability.verb == "edge" ? repeat_edges(files)
                : repeatability.verb == "verify"
                    ? repeat_acceptances(results)
                    : Result<std::vector<base::RepeatedGroup>>(
                          fail(ErrorCode::kBadInput,
                               fmt::format("results of {} do not repeat; those of adjust, edge and verify --acceptance do",
                                           repeatability.verb)));
  if (!groups) return fail(std::move(groups));
  repeatability.groups = *std::move(groups);
  session.progress()("verify", 1, 1);
  std::vector<base::Verdict> verdicts;
  std::string summary;
  for (const base::RepeatedGroup& group : repeatability.groups) {
    summary += fmt::format("{}{}: scatter {:.4f} mm, over predicted sigma {:.2f} ({:.2f} to {:.2f})",
                           summary.empty() ? "" : "; ", group.name, group.sd, group.ratio, group.ratio_low, group.ratio_high);
    if (group.ratio > 1.0 && group.p < 0.001) {
      repeatability.warnings.push_back(
          {"sigmas_too_small", group.name,
           fmt::format("{}: the runs scatter {:.2f} times as much as predicted (95 %: {:.2f} to {:.2f}); something that "
                       "varies between them is in no sigma",
                       group.name, group.ratio, group.ratio_low, group.ratio_high)});
    }
    if (ratio_limit && group.ratio > 0.0) {
      // The bounds of the ratio are its U: outside by more is proven.
      const auto level = group.ratio_high <= *ratio_limit  ? base::VerdictLevel::kOk
                         : group.ratio_low <= *ratio_limit ? base::VerdictLevel::kWarning
                                                           : base::VerdictLevel::kFail;
      verdicts.push_back(
          {"repeat_ratio " + group.name, group.ratio, *ratio_limit, "", "--max-ratio; its 95 % interval decides", level});
    }
  }
  const base::ResultEnvelope envelope{"verify", results.front().value("frame", ""), *std::move(inputs), std::move(verdicts),
                                      repeatability.warnings};
  if (auto written = report::write_repeatability_tables(folder->path(), repeatability); !written)
    return fail(std::move(written));
  const std::string html = report::repeatability_report(repeatability, {"Repeatability", "", envelope, options.dump(2)});
  if (auto published = publish(*folder, html, base::result_json(envelope, options, base::repeatability_json(repeatability)));
      !published)
    return fail(std::move(published));
  return StepOutcome{out, summary, false, outcome_of(envelope.verdicts)};
}

}  // namespace crosstie::app
