// crosstie init: a folder of images -> a job folder

#include <algorithm>
#include <optional>

#include <fmt/core.h>
#include <fmt/ranges.h>

#include "app/image_files.h"
#include "app/job.h"
#include "app/toml_text.h"
#include "app/verb.h"
#include "base/file.h"
#include "base/point_list.h"
#include "base/text.h"
#include "markers/family.h"

namespace crosstie::app {
namespace {

namespace fs = std::filesystem;
using base::ErrorCode;
using base::Result;

/// What the options say, checked before anything is written.
struct Wishes {
  fs::path job_folder;
  fs::path images;
  std::vector<std::pair<std::string, std::string>> cameras;  ///< name and pattern
  std::string family;
  std::optional<fs::path> reference;
  std::optional<fs::path> scale_bars;
  std::optional<fs::path> control;
  std::optional<fs::path> datum;
  std::vector<std::string> rig;  ///< cameras on one mount
  std::optional<std::pair<int, int>> scale_from;
  IdRanges ids;
  IdRanges exclude_ids;
  std::optional<double> focal_mm;
  std::optional<double> sensor_width_mm;
  std::optional<double> focal_px;
  std::optional<double> dot_diameter_mm;
};

Result<> read_numbers(const Arguments& arguments, Wishes& wishes) {
  for (const auto& [name, value] :
       {std::pair{"--focal-mm", &wishes.focal_mm}, std::pair{"--sensor-width-mm", &wishes.sensor_width_mm},
        std::pair{"--focal-px", &wishes.focal_px}, std::pair{"--dot-diameter-mm", &wishes.dot_diameter_mm}}) {
    const auto number = arguments.number(name);
    if (!number) return tl::unexpected(number.error());
    if (*number && **number <= 0.0) return base::fail(ErrorCode::kUsage, fmt::format("{} must be positive", name));
    *value = *number;
  }
  if (wishes.focal_mm.has_value() != wishes.sensor_width_mm.has_value()) {
    return base::fail(ErrorCode::kUsage, "--focal-mm and --sensor-width-mm go together");
  }
  return {};
}

Result<Wishes> wishes_of(const Arguments& arguments) {
  Wishes wishes;
  wishes.job_folder = *arguments.get("--out");
  wishes.images = *arguments.get("--images");
  wishes.family = *arguments.get("--family");
  const auto family = markers::marker_family(wishes.family);
  if (!family) return tl::unexpected(family.error());
  for (const std::string& word : arguments.all("--camera")) {
    auto camera = named_pattern("--camera", word);
    if (!camera) return base::fail(std::move(camera));
    wishes.cameras.push_back(std::move(*camera));
  }
  if (wishes.cameras.empty()) wishes.cameras.emplace_back("camera", "*");
  if (const auto path = arguments.get("--reference")) wishes.reference = *path;
  if (const auto path = arguments.get("--scale-bars")) wishes.scale_bars = *path;
  if (const auto path = arguments.get("--control")) wishes.control = *path;
  if (const auto path = arguments.get("--datum")) wishes.datum = *path;
  if (wishes.control && wishes.datum) return base::fail(ErrorCode::kUsage, "--control and --datum exclude each other");
  if (const auto cameras = arguments.get("--rig")) {
    for (const std::string_view name : base::split(*cameras, ',')) wishes.rig.emplace_back(base::trim(name));
    for (const std::string& name : wishes.rig) {
      const bool known =
          std::any_of(wishes.cameras.begin(), wishes.cameras.end(), [&](const auto& camera) { return camera.first == name; });
      if (!known || wishes.rig.size() < 2) {
        return base::fail(ErrorCode::kUsage, "--rig names two or more of the cameras, such as left,right");
      }
    }
  }
  if (const auto text = arguments.get("--scale-from")) {
    const auto pair = parse_id_pair(*text);
    if (!pair) return tl::unexpected(pair.error());
    wishes.scale_from = *pair;
  }
  for (const auto& [name, value] : {std::pair{"--ids", &wishes.ids}, std::pair{"--exclude-ids", &wishes.exclude_ids}}) {
    auto ids = parse_id_ranges(arguments.all(name));
    if (!ids) return base::fail(ErrorCode::kUsage, fmt::format("{}: {}", name, ids.error().message));
    *value = std::move(*ids);
  }
  if (auto numbers = read_numbers(arguments, wishes); !numbers) return base::fail(std::move(numbers));
  return wishes;
}

/// The files are there and can be read.
Result<> check_files(const Wishes& wishes) {
  std::error_code ignored;
  if (!fs::is_directory(wishes.images, ignored)) {
    return base::fail(ErrorCode::kBadInput, fmt::format("there is no folder {}", wishes.images.string()));
  }
  for (const auto& [name, pattern] : wishes.cameras) {
    const auto files = match_files(wishes.images / pattern);
    if (!files) return tl::unexpected(files.error());
  }
  if (wishes.scale_from && !wishes.reference)
    return base::fail(ErrorCode::kUsage, "--scale-from takes a distance of the --reference");
  if (wishes.reference) {
    const auto points = base::read_point_list(*wishes.reference);
    if (!points) return tl::unexpected(points.error());
    for (const int id :
         wishes.scale_from ? std::vector<int>{wishes.scale_from->first, wishes.scale_from->second} : std::vector<int>{}) {
      if (points->find(id) == nullptr) {
        return base::fail(ErrorCode::kBadInput,
                          fmt::format("{} has no point {} (--scale-from)", wishes.reference->string(), id));
      }
    }
  }
  if (wishes.scale_bars) {
    const auto bars = base::read_scale_bars(*wishes.scale_bars);
    if (!bars) return tl::unexpected(bars.error());
  }
  return {};
}

std::string toml_of(const Wishes& wishes) {
  const auto from_job = [&](const fs::path& path) {
    std::error_code ignored;
    const fs::path relative = fs::proximate(path, wishes.job_folder, ignored);
    return toml_string((ignored ? path : relative).generic_string());
  };
  const auto quoted = [](const IdRanges& ids) {
    std::vector<std::string> words = format_id_ranges(ids);
    for (std::string& word : words) word = toml_string(word);
    return fmt::format("[{}]", fmt::join(words, ", "));
  };
  std::string text = "format = \"crosstie-job/1\"\n";
  text += fmt::format("name = {}\n\n[markers]\nfamily = {}\n",
                      toml_string(fs::absolute(wishes.job_folder).lexically_normal().filename().string()),
                      toml_string(wishes.family));
  if (wishes.dot_diameter_mm) text += fmt::format("dot_diameter_mm = {}\n", toml_number(*wishes.dot_diameter_mm));
  if (!wishes.ids.ranges.empty()) text += fmt::format("ids = {}\n", quoted(wishes.ids));
  if (!wishes.exclude_ids.ranges.empty()) text += fmt::format("exclude_ids = {}\n", quoted(wishes.exclude_ids));
  for (const auto& [name, pattern] : wishes.cameras) {
    text += fmt::format("\n[camera.{}]\n", name);
    if (wishes.focal_mm) {
      text += fmt::format("focal_mm = {}\nsensor_width_mm = {}\n", toml_number(*wishes.focal_mm),
                          toml_number(*wishes.sensor_width_mm));
    }
    if (wishes.focal_px) text += fmt::format("focal_px = {}\n", toml_number(*wishes.focal_px));
  }
  if (!wishes.rig.empty()) {
    std::vector<std::string> names;
    for (const std::string& name : wishes.rig) names.push_back(toml_string(name));
    text += fmt::format("\n[rig]\ncameras = [{}]\n", fmt::join(names, ", "));
  }
  text += "\n[network]\n";
  std::vector<std::string> images;
  for (const auto& [name, pattern] : wishes.cameras)
    images.push_back(fmt::format("{} = {}", name, from_job(wishes.images / pattern)));
  text += fmt::format("images = {{ {} }}\n", fmt::join(images, ", "));
  if (wishes.scale_bars) text += fmt::format("scale_bars = {}\n", from_job(*wishes.scale_bars));
  if (wishes.scale_from) text += fmt::format("scale_from = [{}, {}]\n", wishes.scale_from->first, wishes.scale_from->second);
  if (wishes.control) text += fmt::format("control = {}\n", from_job(*wishes.control));
  if (wishes.datum) text += fmt::format("datum = {}\n", from_job(*wishes.datum));
  if (wishes.reference) text += fmt::format("\n[reference]\npoints = {}\n", from_job(*wishes.reference));
  return text;
}

Result<Outcome> run(const Arguments& arguments, Session& session) {
  const auto wishes = wishes_of(arguments);
  if (!wishes) return tl::unexpected(wishes.error());
  if (auto checked = check_files(*wishes); !checked) return tl::unexpected(checked.error());
  std::error_code ignored;
  const fs::path file = wishes->job_folder / "job.toml";
  if (fs::exists(file, ignored)) {
    return base::fail(ErrorCode::kUsage, fmt::format("{} is there already; name another folder or remove it", file.string()));
  }
  const bool is_new = !fs::exists(wishes->job_folder, ignored);
  if (auto made = base::make_folder(wishes->job_folder); !made) return tl::unexpected(made.error());
  if (auto written = base::write_file_atomically(file, toml_of(*wishes)); !written) {
    if (is_new) fs::remove(wishes->job_folder, ignored);
    return tl::unexpected(written.error());
  }
  if (!wishes->scale_from && !wishes->scale_bars && !wishes->control) {
    session.say("the job knows no scale yet: add scale_bars or scale_from to [network], or scale = \"free\"");
  }
  session.print(file.string());
  return Outcome::kOk;
}

}  // namespace

Verb init_verb() {
  return {"init",
          "make a job folder for a folder of photographs",
          "  $ crosstie init --images photographs --camera left='L_*' --camera right='R_*' --family aicon14 \\\n"
          "      --reference panel.obc --scale-from 11,52 --focal-mm 24 --sensor-width-mm 23.5 --out job\n"
          "  job/job.toml",
          {{"--images", "DIR", "folder of the photographs (they stay where they are)", true, false},
           {"--camera", "NAME='PATTERN'", "a camera and the pattern of its files' names; default: one camera, all images",
            false, true},
           {"--family", "FAMILY", "ring10, aicon12/14/20, agisoft12/14/16/20, apriltag:tag36h11, ...", true, false, 1,
            markers::marker_family_names()},
           {"--reference", "FILE", "known coordinates: a point list, or an AICON object list (mm)", false, false},
           {"--scale-from", "ID,ID", "the one distance of the reference that defines the scale; all others stay checks", false,
            false},
           {"--scale-bars", "FILE", "scale bars: id_a,id_b,length_mm,sigma_mm,...", false, false},
           {"--control", "FILE", "points known with their sigmas, or the result folder of another adjust", false, false},
           {"--datum", "FILE", "points onto which the frame of the result is fitted", false, false},
           {"--rig", "NAMES", "cameras on one mount, such as left,right; patterns' wildcards tell the stations", false, false},
           {"--ids", "IDS", "ids in use, such as 0-127 (default: all of the family)", false, true},
           {"--exclude-ids", "IDS", "ids that are seen but not wanted, such as 72-74", false, true},
           {"--focal-mm", "MM", "nominal focal length of the cameras; default: EXIF data", false, false},
           {"--sensor-width-mm", "MM", "width of the sensor, with --focal-mm", false, false},
           {"--focal-px", "PX", "nominal focal length in pixels instead", false, false},
           {"--dot-diameter-mm", "MM", "diameter of the markers' dots", false, false},
           {"--out", "JOB", "job folder; may exist, without a job.toml", true, false}},
          run};
}

}  // namespace crosstie::app
