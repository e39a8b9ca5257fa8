#include "app/acceptance_file.h"

#include <algorithm>
#include <numbers>

#include <fmt/format.h>

#include "app/job_table.h"
#include "base/file.h"

namespace crosstie::app {
namespace {

using base::Result;

constexpr double kDegree = std::numbers::pi / 180.0;
constexpr const char* kFormat = "crosstie-acceptance/1";

void read_angle(const JobTable& root, const char* key, std::optional<double>& angle_rad) {
  std::optional<double> degrees;
  root.number(key, degrees);
  if (degrees) angle_rad = *degrees * kDegree;
}

/// Key that must be there.
void required(const JobTable& table, const char* section, const char* key) {
  if (!table.has(key)) table.complain(key, fmt::format("[{}] needs {}", section, key));
}

void read_limits(const JobTable& root, AcceptanceFile& file) {
  const auto table = root.table("limits");
  if (!table) return;
  table->check_keys("limits", {"source", "pf_mm", "ps_mm", "sd_mm", "f_mm", "e_mm"});
  table->text("source", file.limits_source);
  table->number("pf_mm", file.limits.form_mm);
  table->number("ps_mm", file.limits.size_mm);
  table->number("sd_mm", file.limits.spacing_mm);
  table->number("f_mm", file.limits.flatness_mm);
  table->number("e_mm", file.limits.length_mm);
}

/// The artefacts' sections, as every position takes them.
AcceptancePlace read_artefacts(const JobTable& root) {
  AcceptancePlace place;
  if (const auto table = root.table("sphere")) {
    table->check_keys("sphere", {"diameter_mm", "diameter_sigma_mm", "form_mm", "certificate"});
    required(*table, "sphere", "diameter_mm");
    required(*table, "sphere", "diameter_sigma_mm");
    table->number("diameter_mm", place.sphere.diameter_mm);
    table->number("diameter_sigma_mm", place.sphere.diameter_sigma_mm, Domain::kNotNegative);
    table->number("form_mm", place.sphere.form_mm, Domain::kNotNegative);
  }
  if (const auto table = root.table("bar")) {
    table->check_keys("bar", {"diameter_a_mm", "diameter_b_mm", "diameter_sigma_mm", "form_mm", "length_mm", "length_sigma_mm",
                              "temperature_c", "temperature_sigma_c", "cte_per_k", "certificate"});
    for (const char* key : {"diameter_a_mm", "diameter_b_mm", "diameter_sigma_mm", "length_mm", "length_sigma_mm"})
      required(*table, "bar", key);
    verify::BarArtefact& bar = place.bar;
    bar.a.name = std::string(1, 'A');
    bar.b.name = std::string(1, 'B');
    table->number("diameter_a_mm", bar.a.diameter_mm);
    table->number("diameter_b_mm", bar.b.diameter_mm);
    table->number("diameter_sigma_mm", bar.a.diameter_sigma_mm, Domain::kNotNegative);
    table->number("form_mm", bar.a.form_mm, Domain::kNotNegative);
    bar.b.diameter_sigma_mm = bar.a.diameter_sigma_mm;
    bar.b.form_mm = bar.a.form_mm;
    table->number("length_mm", bar.length_mm);
    table->number("length_sigma_mm", bar.length_sigma_mm, Domain::kNotNegative);
    table->number("temperature_c", bar.temperature_c, Domain::kAny);
    table->number("temperature_sigma_c", bar.temperature_sigma_c, Domain::kNotNegative);
    table->number("cte_per_k", bar.cte_per_k, Domain::kNotNegative);
  }
  if (const auto table = root.table("plane")) {
    table->check_keys("plane", {"form_mm", "certificate"});
    required(*table, "plane", "form_mm");
    table->number("form_mm", place.plane.form_mm, Domain::kNotNegative);
  }
  return place;
}

void read_places(const JobTable& root, const std::filesystem::path& folder, AcceptanceFile& file) {
  const AcceptancePlace artefacts = read_artefacts(root);
  for (const JobTable& table : root.tables("position")) {
    table.check_keys("position", {"name", "artefact", "cloud", "near_mm", "near_a_mm", "near_b_mm", "radius_mm"});
    AcceptancePlace place = artefacts;
    table.text("name", place.name);
    required(table, "position", "name");
    required(table, "position", "artefact");
    table.word("artefact", {"sphere", "bar", "plane"}, place.artefact);
    if (!place.artefact.empty() && !root.has(place.artefact))
      table.complain("artefact", fmt::format("position {}: there is no section [{}] that tells what is calibrated of it",
                                             place.name, place.artefact));
    std::optional<std::filesystem::path> cloud;
    table.path("cloud", cloud);
    if (!cloud) table.complain("cloud", fmt::format("position {}: cloud = \"file\" is missing", place.name));
    if (cloud) place.cloud = cloud->is_absolute() ? *cloud : folder / *cloud;
    table.triple("near_mm", place.artefact == "plane" ? place.plane.near_mm : place.sphere.near_mm);
    table.triple("near_a_mm", place.bar.a.near_mm);
    table.triple("near_b_mm", place.bar.b.near_mm);
    table.number("radius_mm", place.plane.radius_mm);
    file.places.push_back(std::move(place));
  }
  if (file.places.empty()) root.complain("", "an acceptance test needs positions: [[position]] with name, artefact and cloud");
  std::stable_sort(file.places.begin(), file.places.end(), [](const auto& a, const auto& b) { return a.name < b.name; });
  for (std::size_t i = 1; i < file.places.size(); ++i) {
    if (file.places[i].name == file.places[i - 1].name)
      root.complain("", fmt::format("position {} is named twice", file.places[i].name));
  }
}

}  // namespace

Result<AcceptanceFile> read_acceptance_file(const std::filesystem::path& path) {
  const auto text = base::read_file(path);
  if (!text) return tl::unexpected(text.error());
  const auto root = JobTable::parse(path, *text);
  if (!root) return tl::unexpected(root.error());
  AcceptanceFile file;
  std::string format;
  root->text("format", format);
  if (format != kFormat) root->complain("format", fmt::format("no acceptance test: format = \"{}\" is missing", kFormat));
  root->check_keys("", {"format", "name", "part", "volume_diagonal_mm", "unit", "discard_share", "cap_deg", "least_cap_deg",
                        "plate_border_mm", "limits", "sphere", "bar", "plane", "position"});
  root->text("name", file.name);
  root->text("unit", file.unit);
  double part = 2.0;
  root->number("part", part);
  if (part != 2.0 && part != 3.0) root->complain("part", "part is 2 (single views) or 3 (several views in one frame)");
  file.options.part = part == 3.0 ? 3 : 2;
  root->number("volume_diagonal_mm", file.volume_diagonal_mm);
  root->number("discard_share", file.options.discard_share, Domain::kNotNegative);
  root->number("plate_border_mm", file.options.plate_border_mm, Domain::kNotNegative);
  read_angle(*root, "cap_deg", file.options.cap_rad);
  read_angle(*root, "least_cap_deg", file.options.least_cap_rad);
  read_limits(*root, file);
  read_places(*root, path.parent_path(), file);
  if (root->error()) return tl::unexpected(*root->error());
  return file;
}

}  // namespace crosstie::app
