// crosstie plan: a scene -> sigmas to expect

#include <algorithm>
#include <cmath>

#include <fmt/core.h>
#include <fmt/ranges.h>
#include <nlohmann/json.hpp>

#include "app/commissioning_view.h"
#include "app/current.h"
#include "app/result_folder.h"
#include "app/scene_plan.h"
#include "app/scene_variants.h"
#include "app/verb.h"
#include "base/result_document.h"
#include "base/text.h"
#include "fixtures/scene.h"
#include "report/plan_report.h"

namespace crosstie::app {
namespace {

namespace fs = std::filesystem;
using base::ErrorCode;
using base::fail;
using base::Result;
using nlohmann::ordered_json;

constexpr int kMostStations = 101;
constexpr int kMostRehearsals = 10'000;

Result<Eigen::Vector3d> read_point(const std::string& text) {
  const auto parts = base::split(text, ',');
  Eigen::Vector3d point;
  for (std::size_t i = 0; i < 3 && parts.size() == 3; ++i) {
    const auto value = base::parse_double(base::trim(parts[i]));
    if (!value) break;
    point(static_cast<Eigen::Index>(i)) = *value;
    if (i == 2) return point;
  }
  return fail(ErrorCode::kUsage, fmt::format("--point takes three coordinates in mm such as 850,300,-250, not '{}'", text));
}

Result<int> read_count(const Arguments& arguments, const char* name, int least, int most, int otherwise) {
  const auto count = arguments.integer(name);
  if (!count) return tl::unexpected(count.error());
  if (!*count) return otherwise;
  if (**count < least || **count > most) return fail(ErrorCode::kUsage, fmt::format("{} is {} to {}", name, least, most));
  return static_cast<int>(**count);
}

Result<ScenePlanOptions> read_options(const Arguments& arguments) {
  ScenePlanOptions options;
  for (const auto& [name, value] : {std::pair{"--image-sigma-px", &options.survey.image_sigma_px},
                                    {"--corner-sigma-px", &options.survey.corner_sigma_px}}) {
    const auto number = arguments.number(name);
    if (!number) return tl::unexpected(number.error());
    if (!*number) continue;
    if (!(**number > 0.0)) return fail(ErrorCode::kUsage, fmt::format("{} must be positive", name));
    *value = **number;
  }
  for (const std::string& text : arguments.all("--point")) {
    const auto point = read_point(text);
    if (!point) return tl::unexpected(point.error());
    options.points_mm.push_back(*point);
  }
  const auto rehearsals = read_count(arguments, "--rehearse", 1, kMostRehearsals, 0);
  if (!rehearsals) return tl::unexpected(rehearsals.error());
  options.rehearsals = *rehearsals;
  options.variants = !arguments.has("--no-variants");
  return options;
}

Result<fixtures::Scene> read_scene(const Arguments& arguments) {
  auto scene = fixtures::find_scene(*arguments.get("SCENE"));
  if (!scene) return scene;
  const auto stations = read_count(arguments, "--stations", 2, kMostStations, 0);
  if (!stations) return tl::unexpected(stations.error());
  if (*stations == 0) return scene;
  if (!scene->machine || scene->machine->stations.size() < 2) {
    return fail(ErrorCode::kUsage,
                fmt::format("--stations: the scene {} has no machine with two stations or more", scene->name));
  }
  return with_stations(*std::move(scene), *stations);
}

ordered_json effective_options(const Arguments& arguments, const ScenePlanOptions& options) {
  ordered_json json = {{"scene", *arguments.get("SCENE")},
                       {"image_sigma_px", options.survey.image_sigma_px},
                       {"corner_sigma_px", options.survey.corner_sigma_px},
                       {"power", options.power},
                       {"variants", options.variants},
                       {"rehearsals", options.rehearsals},
                       {"points_mm", ordered_json::array()}};
  const auto stations = arguments.get("--stations");
  json["stations"] = stations ? ordered_json(std::stol(*stations)) : ordered_json();
  for (const Eigen::Vector3d& point : options.points_mm) json["points_mm"].push_back({point.x(), point.y(), point.z()});
  return json;
}

Result<> write(const fs::path& out, const Arguments& arguments, const ScenePlanOptions& options, const base::ScenePlan& plan) {
  base::ResultEnvelope envelope{"plan", plan.machine ? "machine" : "network", {}, {}, {}};
  const fs::path scene = *arguments.get("SCENE");
  std::error_code ignored;
  if (fs::is_regular_file(scene, ignored)) {
    auto input = hashed_input(scene, fs::current_path());
    if (!input) return fail(std::move(input));
    envelope.inputs.push_back(*std::move(input));
  }
  auto folder = ResultFolder::begin(out);
  if (!folder) return fail(std::move(folder));
  const ordered_json json = effective_options(arguments, options);
  const std::string html =
      report::plan_report(plan, plan.machine ? volume_maps(plan.machine->expected) : std::vector<report::VolumeMap>(),
                          {"Plan of a survey", plan.scene, envelope, json.dump(2)});
  return publish(*folder, html, base::result_json(envelope, json, base::plan_json(plan)));
}

void print_machine(const base::CommissionPlan& machine, Session& session) {
  session.print(fmt::format("axis        direction {:.1f} urad, scale {:.1f} ppm (from {:.0f} ppm on found)",
                            1e6 * machine.direction_sigma_rad, machine.expected.frame.axis.scale_sigma_ppm,
                            machine.scale_smallest_ppm));
  for (const base::HeadPose& pose : machine.expected.checked_at) {
    const Eigen::Vector3d sigma =
        base::position_covariance(pose.machine_from_rig, pose.cov).diagonal().cwiseMax(0.0).cwiseSqrt();
    const Eigen::Vector3d turn = 1e6 * pose.cov.diagonal().head<3>().cwiseMax(0.0).cwiseSqrt();
    session.print(fmt::format("head at     {:9.1f} mm: {:.4f} {:.4f} {:.4f} mm, {:.1f} {:.1f} {:.1f} urad", pose.axis_mm,
                              sigma.x(), sigma.y(), sigma.z(), turn.x(), turn.y(), turn.z()));
  }
  for (const base::PlannedMotion& motion : machine.motions) {
    const double unit = motion.angle ? 1e6 : 1e3;
    session.print(fmt::format("motion      {}{}: sigma {:.2f} {}, from {:.1f} {} peak to valley on found with {:.0f} %",
                              motion.name, motion.order, unit * motion.sigma, motion.angle ? "urad" : "um",
                              unit * motion.range_factor * motion.smallest, motion.angle ? "urad" : "um",
                              100.0 * machine.power));
  }
}

void print(const base::ScenePlan& plan, Session& session) {
  if (plan.calibration && plan.calibration->rig)
    session.print(fmt::format("board       baseline {:.4f} mm", plan.calibration->rig->baseline_sigma_mm));
  if (plan.network) {
    session.print(fmt::format("network     {} points, sigma {:.4f} mm (median), {:.4f} mm (largest)",
                              plan.network->expected.points.size(), plan.network->median_mm, plan.network->max_mm));
  }
  if (plan.machine) print_machine(*plan.machine, session);
  for (const base::PlannedPoint& point : plan.points) {
    session.print(fmt::format("point       {:.1f}, {:.1f}, {:.1f}: frame {:.4f} mm, measured {}", point.p_in_machine_mm.x(),
                              point.p_in_machine_mm.y(), point.p_in_machine_mm.z(), base::worst_sigma(point.frame_cov_mm2),
                              point.cov_mm2 ? fmt::format("{:.4f} mm", base::worst_sigma(*point.cov_mm2))
                                            : std::string("- (not seen by both cameras)")));
  }
  for (const base::PlanVariant& variant : plan.variants) {
    std::string line = fmt::format("what if     {:<20} {:<10}", variant.what, variant.value);
    if (!variant.failure.empty()) {
      session.print(line + " " + variant.failure);
      continue;
    }
    for (const double sigma : variant.points_mm) line += fmt::format(" {:8.4f}", sigma);
    if (plan.machine) line += fmt::format(" mm, direction {:5.1f} urad", 1e6 * variant.direction_sigma_rad);
    if (plan.calibration) line += fmt::format(", baseline {:.4f} mm", variant.baseline_sigma_mm);
    if (plan.network) line += fmt::format(", points {:.4f} mm", variant.network_median_mm);
    session.print(line);
  }
  if (!plan.rehearsal) return;
  for (const base::RehearsedQuantity& one : plan.rehearsal->quantities) {
    session.print(fmt::format("rehearsed   {:<32} {:8.2f} of {} ({:.2f} to {:.2f}){}", one.name, one.square, one.dof, one.low,
                              one.high, one.holds() ? "" : "  BEYOND ITS BOUNDS"));
  }
  if (plan.rehearsal->failed > 0) {
    session.print(fmt::format("rehearsed   {} of {} draws gave no result; the first: {}", plan.rehearsal->failed,
                              plan.rehearsal->draws, plan.rehearsal->first_failure));
  }
}

Result<Outcome> run(const Arguments& arguments, Session& session) {
  const auto options = read_options(arguments);
  if (!options) return tl::unexpected(options.error());
  const auto scene = read_scene(arguments);
  if (!scene) return tl::unexpected(scene.error());
  const auto plan = plan_scene(*scene, *options, session);
  if (!plan) return tl::unexpected(plan.error());
  if (const auto out = arguments.get("--out")) {
    if (auto written = write(*out, arguments, *options, *plan); !written) return fail(std::move(written));
    session.say((fs::path(*out) / "result.json").string());
  }
  print(*plan, session);
  return Outcome::kOk;
}

}  // namespace

Verb plan_verb() {
  return {
      "plan",
      "say which sigmas a survey will give before anything is photographed, and what other numbers of stations, photographs or "
      "markers would give",
      "  $ crosstie plan machine --stations 7 --image-sigma-px 0.05 --out plan",
      {{"SCENE", "SCENE",
        fmt::format("a built-in scene ({}) or a scene description, FILE.toml", fmt::join(fixtures::scene_names(), ", ")), true,
        false, 1, fixtures::scene_names()},
       {"--stations", "N", "so many stations over the scene's travel (default: those of the scene)", false, false},
       {"--image-sigma-px", "PX", "standard deviation of a marker's image coordinate (default 0.03)", false, false},
       {"--corner-sigma-px", "PX", "standard deviation of a board corner's image coordinate (default 0.06)", false, false},
       {"--point", "X,Y,Z",
        "place in machine [mm] whose sigma is wanted (default: the middle of the working volume and its least certain place)",
        false, true},
       {"--no-variants", "", "only the scene as it is, no what if", false, false},
       {"--rehearse", "N", "draw the survey N times with noise: are the predicted sigmas true?", false, false},
       {"--out", "DIR", "folder for result.json and report.html; replaced as a whole", false, false}},
      run};
}

}  // namespace crosstie::app
