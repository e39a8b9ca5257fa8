// [cross], [machine] and [[station]]: the head in the machine's frame

#include <algorithm>
#include <cmath>
#include <set>

#include <fmt/core.h>

#include "app/job_sections.h"

namespace crosstie::app {
namespace {

/// Metals expand by 1e-5 per K; a number this large was meant in ppm.
constexpr double kMostExpansion_per_k = 1e-3;

void read_temperature(const JobTable& table, double& temperature_c, double& sigma_c) {
  table.number("temperature_c", temperature_c, Domain::kAny);
  table.number("temperature_sigma_c", sigma_c, Domain::kNotNegative);
  constexpr double kLeast_c = -50.0;
  constexpr double kMost_c = 100.0;
  if (!(temperature_c > kLeast_c && temperature_c < kMost_c)) {
    table.complain("temperature_c",
                   fmt::format("{} degrees C; between {} and {} is possible", temperature_c, kLeast_c, kMost_c));
  }
}

JobScan read_scan(const JobTable& table) {
  table.check_keys("station.scan", {"left", "right", "manifest"});
  JobScan scan;
  for (const auto& [key, path] :
       {std::pair{"left", &scan.left}, std::pair{"right", &scan.right}, std::pair{"manifest", &scan.manifest}}) {
    std::optional<std::filesystem::path> given;
    table.path(key, given);
    if (!given) table.complain("", fmt::format("scan = {{ ... }} needs {}", key));
    *path = given.value_or("");
  }
  return scan;
}

JobStation read_station(const JobTable& table) {
  table.check_keys("station", {"name", "axis_mm", "cross", "scan"});
  JobStation station;
  table.text("name", station.name);
  if (station.name.empty()) table.complain("", "[[station]] needs a name");
  if (station.name.find('/') != std::string::npos || station.name == "." || station.name == "..") {
    table.complain("name",
                   fmt::format("a station's results stand in a folder of its name, which '{}' cannot be", station.name));
  }
  if (!table.has("axis_mm")) table.complain("", "[[station]] needs axis_mm, the reading of the X axis");
  table.number("axis_mm", station.axis_mm, Domain::kAny);
  if (const auto cross = table.table("cross")) {
    for (const std::string& camera : cross->keys()) {
      std::string image;
      cross->text(camera, image);
      station.cross.emplace_back(camera, image);
    }
  }
  if (const auto scan = table.table("scan")) station.scan = read_scan(*scan);
  return station;
}

}  // namespace

void read_cross(const JobTable& root, Job& job) {
  const auto table = root.table("cross");
  if (!table) return;
  table->check_keys("cross", {"points", "spheres", "points_temperature_c", "temperature_c", "temperature_sigma_c", "cte_per_k",
                              "cte_sigma_per_k", "certificate", "certificate_date", "certificate_expires"});
  JobCross cross;
  table->path("points", cross.points);
  if (!cross.points) table->complain("", "[cross] needs points, a list of its markers, or points = \"adjust\"");
  if (cross.points == "adjust") cross.points.reset();
  table->path("spheres", cross.spheres);
  table->number("points_temperature_c", cross.points_temperature_c, Domain::kAny);
  read_temperature(*table, cross.thermal.temperature_c, cross.thermal.temperature_sigma_c);
  table->number("cte_per_k", cross.thermal.cte_per_k, Domain::kAny);
  table->number("cte_sigma_per_k", cross.thermal.cte_sigma_per_k, Domain::kNotNegative);
  if (!(std::abs(cross.thermal.cte_per_k) < kMostExpansion_per_k)) {
    table->complain("cte_per_k", fmt::format("an expansion of {} per K; steel has 11.5e-6", cross.thermal.cte_per_k));
  }
  table->certificate("certificate", cross.certificate);
  job.cross = std::move(cross);
}

void read_machine(const JobTable& root, Job& job) {
  const auto table = root.table("machine");
  if (!table) return;
  table->check_keys("machine",
                    {"probed_spheres", "probe_hits", "stylus_diameter_mm", "probe_sigma_mm", "axis_sigma_mm", "temperature_c",
                     "temperature_sigma_c", "certificate", "certificate_date", "certificate_expires"});
  JobMachine machine;
  table->path("probed_spheres", machine.probed_spheres);
  table->path("probe_hits", machine.probe_hits);
  if (machine.probed_spheres && machine.probe_hits) {
    table->complain("probe_hits", "give probed_spheres (centres) or probe_hits, not both");
  }
  table->number("stylus_diameter_mm", machine.stylus_diameter_mm);
  if (machine.probe_hits && !machine.stylus_diameter_mm) {
    table->complain("probe_hits", "probe_hits are centres of the stylus tip: they need stylus_diameter_mm");
  }
  table->number("probe_sigma_mm", machine.probe_sigma_mm);
  table->number("axis_sigma_mm", machine.axis_sigma_mm, Domain::kNotNegative);
  read_temperature(*table, machine.temperature_c, machine.temperature_sigma_c);
  table->certificate("certificate", machine.certificate);
  job.machine = std::move(machine);
}

void read_stations(const JobTable& root, Job& job) {
  std::set<std::string> names;
  for (const JobTable& table : root.tables("station")) {
    JobStation station = read_station(table);
    if (!names.insert(station.name).second) {
      table.complain("name", fmt::format("two stations are called '{}'", station.name));
    }
    for (const auto& [camera, image] : station.cross) job.cameras.try_emplace(camera);
    job.stations.push_back(std::move(station));
  }
  std::stable_sort(job.stations.begin(), job.stations.end(),
                   [](const JobStation& a, const JobStation& b) { return a.axis_mm < b.axis_mm; });
}

}  // namespace crosstie::app
