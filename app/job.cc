#include "app/job.h"

#include <algorithm>
#include <string_view>

#include <fmt/core.h>

#include "app/job_sections.h"
#include "base/file.h"

namespace crosstie::app {
namespace {

using base::ErrorCode;
using base::Result;

constexpr std::size_t kMaxJobBytes = 16U << 20U;
constexpr std::string_view kFormat = "crosstie-job/1";

void read_format(const JobTable& root) {
  std::string format;
  root.text("format", format);
  if (format == kFormat) return;
  root.complain("format", fmt::format("a job starts with format = \"{}\"{}", kFormat,
                                      format.empty() ? "" : fmt::format(", not \"{}\"", format)));
}

void read_ids(const JobTable& table, const char* key, IdRanges& ids) {
  std::vector<std::string> words;
  table.words(key, words);
  auto parsed = parse_id_ranges(words);
  if (!parsed) return table.complain(key, fmt::format("{}: {}", key, parsed.error().message));
  ids = std::move(*parsed);
}

void read_markers(const JobTable& root, Job& job) {
  const auto table = root.table("markers");
  if (!table) return;
  table->check_keys("markers", {"family", "dot_diameter_mm", "thickness_mm", "ids", "exclude_ids"});
  table->text("family", job.family);
  table->number("dot_diameter_mm", job.dot_diameter_mm);
  table->number("thickness_mm", job.marker_thickness_mm, Domain::kNotNegative);
  read_ids(*table, "ids", job.ids);
  read_ids(*table, "exclude_ids", job.exclude_ids);
}

void read_reference(const JobTable& root, Job& job) {
  const auto table = root.table("reference");
  if (!table) return;
  table->check_keys("reference", {"points", "surface", "surface_frame", "surface_best_fit", "unit"});
  table->path("points", job.reference_points);
  table->path("surface", job.reference_surface);
  table->word("surface_frame", {"machine", "part"}, job.surface_frame);
  table->flag("surface_best_fit", job.surface_best_fit);
  table->text("unit", job.reference_unit);
}

/// What must be so between sections.
void check_sections(const JobTable& root, const Job& job) {
  const auto at = [&root](const char* section) { return root.table(section).value_or(root); };
  if (job.network && job.family.empty()) root.complain("", "[markers] needs a family, such as \"ring10\"");
  if (job.network && job.network->scale_from && !job.reference_points) {
    root.complain("", "[network] scale_from takes a distance of the reference, but there is no [reference] points");
  }
  if (job.network && job.network->scale_is_free &&
      (job.network->scale_bars || job.network->scale_from || job.network->control)) {
    root.complain("", "[network] scale = \"free\" contradicts scale_bars, scale_from and control");
  }
  for (const std::string& camera : job.rig ? job.rig->cameras : std::vector<std::string>{}) {
    if (!job.cameras.contains(camera))
      at("rig").complain("cameras", fmt::format("[rig] names the camera {}, which the job does not have", camera));
  }
  const std::vector<std::string> calibrated = job.board_cameras();
  if (!calibrated.empty() && !job.board) {
    at("camera").complain("", fmt::format("[camera.{}] has board_images, but there is no [board]", calibrated.front()));
  }
  if (job.board && calibrated.empty()) {
    at("board").complain("", "[board] calibrates cameras with board_images = \"pattern\" in their tables, and there is none");
  }
  if (calibrated.size() > 2) {
    at("board").complain("", "[board] calibrates one camera or a pair; more than two have board_images");
  }
  if (calibrated.size() == 2 && !job.rig) {
    at("board").complain("", fmt::format("{} and {} are calibrated together: [rig] cameras = [\"LEFT\", \"RIGHT\"] must say "
                                         "which is the left one",
                                         calibrated[0], calibrated[1]));
  }
  if (job.cross && !job.cross->points && !job.network) {
    at("cross").complain("points",
                         "points = \"adjust\" takes the cross from the job's own adjustment, but there is no [network]");
  }
}

}  // namespace

std::vector<std::string> Job::board_cameras() const {
  std::vector<std::string> names;
  for (const auto& [word, camera] : cameras) {
    if (camera.board_images) names.push_back(word);
  }
  if (!rig) return names;
  const auto rank = [this](const std::string& word) {
    return std::find(rig->cameras.begin(), rig->cameras.end(), word) - rig->cameras.begin();
  };
  std::stable_sort(names.begin(), names.end(), [&](const auto& a, const auto& b) { return rank(a) < rank(b); });
  return names;
}

std::filesystem::path Job::resolve(const std::filesystem::path& relative) const {
  return (folder / relative).lexically_normal();
}

Result<Job> read_job(const std::filesystem::path& folder_or_file) {
  std::error_code ignored;
  Job job;
  job.file = std::filesystem::is_directory(folder_or_file, ignored) ? folder_or_file / "job.toml" : folder_or_file;
  job.folder = job.file.has_parent_path() ? job.file.parent_path() : std::filesystem::path(".");
  auto text = base::read_file(job.file, kMaxJobBytes);
  if (!text) return base::fail(std::move(text));
  const auto root = JobTable::parse(job.file, *text);
  if (!root) return tl::unexpected(root.error());
  root->check_keys("", {"format", "name", "date", "markers", "board", "camera", "rig", "network", "cross", "machine", "station",
                        "hole", "part", "path", "reference", "limits"});
  read_format(*root);
  root->text("name", job.name);
  root->date("date", job.date);
  read_markers(*root, job);
  read_cameras(*root, job);
  read_rig(*root, job);
  read_board(*root, job);
  read_network(*root, job);
  read_cross(*root, job);
  read_machine(*root, job);
  read_stations(*root, job);
  read_reference(*root, job);
  read_limits(*root, job);
  read_hole(*root, job);
  read_part(*root, job);
  read_path(*root, job);
  check_sections(*root, job);
  if (root->error()) return tl::unexpected(*root->error());
  return job;
}

}  // namespace crosstie::app
