#include "app/job.h"

#include <algorithm>
#include <string_view>

#include <fmt/core.h>
#include <fmt/ranges.h>
#define TOML_EXCEPTIONS 0
#include <toml++/toml.h>

#include "base/file.h"
#include "base/text.h"

namespace crosstie::app {
namespace {

using base::ErrorCode;
using base::Result;

constexpr std::size_t kMaxJobBytes = 16U << 20U;
constexpr std::string_view kFormat = "crosstie-job/1";

/// The keys of each table. Tables that later verbs read are known too, so that one job file serves all versions.
const std::map<std::string, std::vector<std::string>>& known_keys() {
  static const std::map<std::string, std::vector<std::string>> keys = {
      {"",
       {"format", "name", "markers", "board", "camera", "rig", "network", "cross", "machine", "station", "hole", "reference",
        "limits"}},
      {"markers", {"family", "dot_diameter_mm", "thickness_mm", "ids", "exclude_ids"}},
      {"board", {"corners", "pitch_mm"}},
      {"camera",
       {"board_images", "model", "focal_mm", "sensor_width_mm", "focal_px", "temperature_c", "lens", "estimate", "white_level",
        "fixed", "sigmas"}},
      {"rig", {"name", "cameras"}},
      {"network", {"images", "scale_bars", "scale_from", "scale", "control", "datum", "uncoded"}},
      {"cross", {"points", "spheres", "temperature_c", "cte_per_k"}},
      {"machine", {"probed_spheres", "temperature_c"}},
      {"station", {"name", "axis_mm", "cross", "scan"}},
      {"hole", {"nominal", "nominal_frame", "markers"}},
      {"reference", {"points", "surface", "unit"}},
      {"limits",
       {"sigma0_px", "scale_bar_w", "control_w", "point_sigma_mm", "deviation_rms_mm", "deviation_max_mm", "length_mpe_a_mm",
        "length_mpe_k"}},
  };
  return keys;
}

/// Reads values out of tables and remembers the first thing that is wrong.
class Reader {
 public:
  explicit Reader(std::filesystem::path file) : file_(std::move(file)) {}

  [[nodiscard]] bool failed() const { return error_.has_value(); }
  [[nodiscard]] base::Error error() const { return *error_; }

  void complain(const toml::node* node, const std::string& message) {
    if (error_) return;
    const std::string where = node != nullptr && node->source().begin.line > 0
                                  ? fmt::format("{}:{}", file_.string(), node->source().begin.line)
                                  : file_.string();
    error_ = base::Error{ErrorCode::kBadInput, fmt::format("{}: {}", where, message)};
  }

  void check_keys(const toml::table& table, const std::string& section) {
    const auto& known = known_keys().at(section);
    for (const auto& [key, node] : table) {
      const std::string name(key.str());
      if (std::find(known.begin(), known.end(), name) != known.end()) continue;
      const auto meant = base::nearest_word(name, known);
      complain(&node, fmt::format("unknown key '{}' in {}{}", name, section.empty() ? "the job" : fmt::format("[{}]", section),
                                  meant ? fmt::format(", did you mean '{}'?", *meant)
                                        : fmt::format("; it knows {}", fmt::join(known, ", "))));
    }
  }

  const toml::table* table(const toml::table& parent, const char* key) {
    const toml::node* node = parent.get(key);
    if (node == nullptr) return nullptr;
    if (!node->is_table()) complain(node, fmt::format("{} must be a table, [{}]", key, key));
    return node->as_table();
  }

  void text(const toml::table& table, const char* key, std::string& value) {
    const toml::node* node = table.get(key);
    if (node == nullptr) return;
    if (const auto* found = node->as_string()) {
      value = found->get();
      return;
    }
    complain(node, fmt::format("{} must be a text in quotes", key));
  }

  void path(const toml::table& table, const char* key, std::optional<std::filesystem::path>& value) {
    std::string found;
    text(table, key, found);
    if (!found.empty()) value = found;
  }

  void number(const toml::table& table, const char* key, std::optional<double>& value, bool positive = true) {
    const toml::node* node = table.get(key);
    if (node == nullptr) return;
    const std::optional<double> found = node->is_number() ? node->value<double>() : std::nullopt;
    if (!found || !std::isfinite(*found) || (positive && *found <= 0.0)) {
      complain(node, fmt::format("{} must be a {}number", key, positive ? "positive " : ""));
      return;
    }
    value = found;
  }

  void number(const toml::table& table, const char* key, double& value) {
    std::optional<double> found;
    number(table, key, found);
    value = found.value_or(value);
  }

  void flag(const toml::table& table, const char* key, bool& value) {
    const toml::node* node = table.get(key);
    if (node == nullptr) return;
    if (const auto* found = node->as_boolean()) {
      value = found->get();
      return;
    }
    complain(node, fmt::format("{} must be true or false", key));
  }

  void texts(const toml::table& table, const char* key, std::vector<std::string>& value) {
    const toml::node* node = table.get(key);
    if (node == nullptr) return;
    const toml::array* list = node->as_array();
    if (list == nullptr) return complain(node, fmt::format("{} must be a list of texts in quotes", key));
    for (const toml::node& item : *list) {
      if (!item.is_string()) return complain(&item, fmt::format("{} must be a list of texts in quotes", key));
      value.push_back(item.as_string()->get());
    }
  }

  void ids(const toml::table& table, const char* key, IdRanges& value) {
    const toml::node* node = table.get(key);
    if (node == nullptr) return;
    std::vector<std::string> texts;
    const toml::array* list = node->as_array();
    if (list == nullptr) return complain(node, fmt::format("{} must be a list such as [\"0-127\"]", key));
    for (const toml::node& item : *list) {
      if (const auto* range = item.as_string()) {
        texts.push_back(range->get());
      } else if (const auto* single = item.as_integer()) {
        texts.push_back(fmt::format("{}", single->get()));
      } else {
        complain(&item, fmt::format("{} holds ids and ranges such as \"0-127\"", key));
      }
    }
    auto parsed = parse_id_ranges(texts);
    if (!parsed) return complain(node, fmt::format("{}: {}", key, parsed.error().message));
    value = std::move(*parsed);
  }

 private:
  std::filesystem::path file_;
  std::optional<base::Error> error_;
};

void read_cameras(Reader& reader, const toml::table& root, Job& job) {
  const toml::table* cameras = reader.table(root, "camera");
  if (cameras == nullptr) return;
  for (const auto& [key, node] : *cameras) {
    const toml::table* table = node.as_table();
    if (table == nullptr) return reader.complain(&node, fmt::format("cameras are tables of their own: [camera.{}]", key.str()));
    reader.check_keys(*table, "camera");
    JobCamera camera;
    reader.path(*table, "model", camera.model);
    reader.number(*table, "focal_mm", camera.focal_mm);
    reader.number(*table, "sensor_width_mm", camera.sensor_width_mm);
    reader.number(*table, "focal_px", camera.focal_px);
    reader.number(*table, "white_level", camera.white_level);
    reader.text(*table, "lens", camera.lens);
    reader.flag(*table, "estimate", camera.estimate);
    reader.texts(*table, "fixed", camera.fixed);
    if (const toml::table* sigmas = reader.table(*table, "sigmas")) {
      for (const auto& [parameter, sigma] : *sigmas) {
        std::optional<double> value;
        reader.number(*sigmas, parameter.data(), value, false);
        if (value && *value < 0.0) reader.complain(&sigma, "a sigma is 0 or larger");
        if (value) camera.sigmas[std::string(parameter.str())] = *value;
      }
    }
    if (camera.focal_mm.has_value() != camera.sensor_width_mm.has_value()) {
      reader.complain(table, fmt::format("[camera.{}] needs focal_mm and sensor_width_mm together", key.str()));
    }
    static const std::vector<std::string> kLenses = {"pinhole", "opencv4", "opencv5", "opencv8", "opencv12"};
    if (std::find(kLenses.begin(), kLenses.end(), camera.lens) == kLenses.end()) {
      reader.complain(table->get("lens"),
                      fmt::format("lens must be one of {}, not '{}'", fmt::join(kLenses, ", "), camera.lens));
    }
    if (!camera.estimate && !camera.model) {
      reader.complain(table,
                      fmt::format("[camera.{}] estimate = false needs a model whose parameters are to be taken", key.str()));
    }
    job.cameras.emplace(std::string(key.str()), std::move(camera));
  }
}

void read_rig(Reader& reader, const toml::table& root, Job& job) {
  const toml::table* table = reader.table(root, "rig");
  if (table == nullptr) return;
  reader.check_keys(*table, "rig");
  JobRig rig;
  reader.text(*table, "name", rig.name);
  reader.texts(*table, "cameras", rig.cameras);
  if (rig.cameras.size() < 2) reader.complain(table, "[rig] needs cameras = [\"LEFT\", \"RIGHT\"], two or more");
  job.rig = std::move(rig);
}

void read_scale_from(Reader& reader, const toml::table& table, JobNetwork& network) {
  const toml::node* node = table.get("scale_from");
  if (node == nullptr) return;
  const toml::array* pair = node->as_array();
  if (pair != nullptr && pair->empty()) return;
  if (pair == nullptr || pair->size() != 2 || !pair->is_homogeneous(toml::node_type::integer)) {
    return reader.complain(node, "scale_from must be two ids, such as [11, 52]");
  }
  const auto a = pair->get(0)->value<int>();
  const auto b = pair->get(1)->value<int>();
  if (!a || !b || *a == *b) return reader.complain(node, "scale_from must be two different ids");
  network.scale_from = {*a, *b};
}

void read_network(Reader& reader, const toml::table& root, Job& job) {
  const toml::table* table = reader.table(root, "network");
  if (table == nullptr) return;
  reader.check_keys(*table, "network");
  JobNetwork network;
  const toml::table* images = reader.table(*table, "images");
  if (images == nullptr || images->empty()) {
    return reader.complain(table, "[network] needs images = { CAMERA = \"pattern\" }");
  }
  for (const auto& [camera, pattern] : *images) {
    if (!pattern.is_string()) return reader.complain(&pattern, "a file pattern must be a text in quotes");
    network.images.emplace_back(std::string(camera.str()), pattern.as_string()->get());
    job.cameras.try_emplace(std::string(camera.str()));
  }
  std::sort(network.images.begin(), network.images.end());
  reader.path(*table, "scale_bars", network.scale_bars);
  read_scale_from(reader, *table, network);
  std::string scale;
  reader.text(*table, "scale", scale);
  if (!scale.empty() && scale != "free") reader.complain(table->get("scale"), "scale can only be \"free\"");
  network.scale_is_free = scale == "free";
  reader.path(*table, "control", network.control);
  reader.path(*table, "datum", network.datum);
  if (network.control && network.datum) {
    reader.complain(table->get("datum"), "control points define the frame already: give datum or control, not both");
  }
  reader.flag(*table, "uncoded", network.uncoded);
  job.network = std::move(network);
}

void read_limits(Reader& reader, const toml::table& root, JobLimits& limits) {
  const toml::table* table = reader.table(root, "limits");
  if (table == nullptr) return;
  reader.check_keys(*table, "limits");
  reader.number(*table, "sigma0_px", limits.sigma0_px);
  reader.number(*table, "scale_bar_w", limits.scale_bar_w);
  reader.number(*table, "control_w", limits.control_w);
  reader.number(*table, "point_sigma_mm", limits.point_sigma_mm);
  reader.number(*table, "deviation_rms_mm", limits.deviation_rms_mm);
  reader.number(*table, "deviation_max_mm", limits.deviation_max_mm);
  reader.number(*table, "length_mpe_a_mm", limits.length_mpe_a_mm);
  reader.number(*table, "length_mpe_k", limits.length_mpe_k);
}

/// Tables of later verbs: their keys are checked, their values are not read yet.
void read_past(Reader& reader, const toml::table& root, Job& job) {
  for (const char* section : {"board", "cross", "machine", "station", "hole"}) {
    const toml::node* node = root.get(section);
    if (node == nullptr) continue;
    job.unused.emplace_back(section);
    if (const toml::table* table = node->as_table()) {
      reader.check_keys(*table, section);
    } else if (const toml::array* list = node->as_array()) {
      for (const toml::node& item : *list) {
        if (item.is_table()) reader.check_keys(*item.as_table(), section);
      }
    }
  }
}

void read_root(Reader& reader, const toml::table& root, Job& job) {
  reader.check_keys(root, "");
  std::string format;
  reader.text(root, "format", format);
  if (format != kFormat) {
    reader.complain(root.get("format"), fmt::format("a job starts with format = \"{}\"{}", kFormat,
                                                    format.empty() ? "" : fmt::format(", not \"{}\"", format)));
  }
  reader.text(root, "name", job.name);
  if (const toml::table* markers = reader.table(root, "markers")) {
    reader.check_keys(*markers, "markers");
    reader.text(*markers, "family", job.family);
    reader.number(*markers, "dot_diameter_mm", job.dot_diameter_mm);
    reader.ids(*markers, "ids", job.ids);
    reader.ids(*markers, "exclude_ids", job.exclude_ids);
  }
  read_cameras(reader, root, job);
  read_rig(reader, root, job);
  read_network(reader, root, job);
  if (const toml::table* reference = reader.table(root, "reference")) {
    reader.check_keys(*reference, "reference");
    reader.path(*reference, "points", job.reference_points);
    reader.text(*reference, "unit", job.reference_unit);
  }
  read_limits(reader, root, job.limits);
  read_past(reader, root, job);
  if (job.network && job.family.empty()) reader.complain(&root, "[markers] needs a family, such as \"ring10\"");
  if (job.network && job.network->scale_from && !job.reference_points) {
    reader.complain(&root, "[network] scale_from takes a distance of the reference, but there is no [reference] points");
  }
  if (job.network && job.network->scale_is_free &&
      (job.network->scale_bars || job.network->scale_from || job.network->control)) {
    reader.complain(&root, "[network] scale = \"free\" contradicts scale_bars, scale_from and control");
  }
  for (const std::string& camera : job.rig ? job.rig->cameras : std::vector<std::string>{}) {
    if (!job.cameras.contains(camera))
      reader.complain(root.get("rig"), fmt::format("[rig] names the camera {}, which the job does not have", camera));
  }
}

}  // namespace

bool IdRanges::contains(int id) const {
  return std::any_of(ranges.begin(), ranges.end(), [id](const auto& range) { return range.first <= id && id <= range.second; });
}

Result<IdRanges> parse_id_ranges(const std::vector<std::string>& texts) {
  IdRanges ids;
  for (const std::string& text : texts) {
    for (const std::string_view part : base::split(text, ',')) {
      const std::string_view range = base::trim(part);
      const std::size_t dash = range.find('-');
      const auto first = base::parse_int(range.substr(0, dash));
      const auto last = dash == std::string_view::npos ? first : base::parse_int(range.substr(dash + 1));
      if (!first || !last || *first < 0 || *last < *first || *last > 1'000'000) {
        return base::fail(ErrorCode::kBadInput, fmt::format("'{}' is no id and no range of ids such as 0-127", range));
      }
      ids.ranges.emplace_back(static_cast<int>(*first), static_cast<int>(*last));
    }
  }
  return ids;
}

Result<std::pair<int, int>> parse_id_pair(const std::string& text) {
  const auto parts = base::split(text, ',');
  const auto a = base::parse_int(parts.front());
  const auto b = base::parse_int(parts.back());
  if (parts.size() != 2 || !a || !b || *a == *b || *a < 0 || *b < 0 || std::max(*a, *b) > 1'000'000) {
    return base::fail(ErrorCode::kUsage, fmt::format("'{}' is no pair of ids such as 11,52", text));
  }
  return std::pair{static_cast<int>(*a), static_cast<int>(*b)};
}

std::vector<std::string> format_id_ranges(const IdRanges& ids) {
  std::vector<std::string> texts;
  for (const auto& [first, last] : ids.ranges)
    texts.push_back(first == last ? fmt::format("{}", first) : fmt::format("{}-{}", first, last));
  return texts;
}

std::filesystem::path Job::resolve(const std::filesystem::path& path) const { return (folder / path).lexically_normal(); }

Result<Job> read_job(const std::filesystem::path& folder_or_file) {
  std::error_code ignored;
  Job job;
  job.file = std::filesystem::is_directory(folder_or_file, ignored) ? folder_or_file / "job.toml" : folder_or_file;
  job.folder = job.file.has_parent_path() ? job.file.parent_path() : std::filesystem::path(".");
  auto text = base::read_file(job.file, kMaxJobBytes);
  if (!text) return base::fail(std::move(text));
  const toml::parse_result parsed = toml::parse(*text, job.file.string());
  if (!parsed) {
    return base::fail(ErrorCode::kBadInput, fmt::format("{}:{}: {}", job.file.string(), parsed.error().source().begin.line,
                                                        parsed.error().description()));
  }
  Reader reader(job.file);
  read_root(reader, parsed.table(), job);
  if (reader.failed()) return tl::unexpected(reader.error());
  return job;
}

}  // namespace crosstie::app
