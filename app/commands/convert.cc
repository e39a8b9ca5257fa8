// crosstie convert: files of other programs, in and out

#include <algorithm>
#include <filesystem>

#include <fmt/core.h>

#include "app/exchange.h"
#include "app/result_folder.h"
#include "app/verb.h"
#include "base/aicon_files.h"
#include "base/camera_file.h"
#include "base/cloud_table.h"
#include "base/file.h"
#include "base/kalibr.h"
#include "base/opencv_stereo.h"
#include "base/pcd.h"
#include "base/ply.h"
#include "base/tool_path_gcode.h"

namespace crosstie::app {
namespace {

namespace fs = std::filesystem;
using base::ErrorCode;
using base::Result;

/// What the user asks for.
struct Wish {
  fs::path in;
  fs::path out;
  std::string unit;  ///< empty: not said
  double unit_mm = 1.0;
  std::string camera = {};
  bool binary = false;
  bool single = false;
  bool chain = false;
  base::GcodeOptions gcode = {};
};

tl::unexpected<base::Error> impossible(const Wish& wish) {
  return base::fail(ErrorCode::kUsage, fmt::format("{} cannot become {}; possible: {}", base::shown(wish.in),
                                                   base::shown(wish.out), kConversions));
}

/// Whether a folder holds nothing but files of a COLMAP model.
bool is_colmap_folder(const fs::path& folder) {
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(folder, error)) {
    const std::string stem = entry.path().stem().string();
    const std::string ending = entry.path().extension().string();
    const bool known = stem == "cameras" || stem == "images" || stem == "points3D" || stem == "rigs" || stem == "frames";
    if (!known || (ending != ".txt" && ending != ".bin")) return false;
  }
  return !error;
}

Result<> write_colmap(const Wish& wish, const Exchanged& content, Session& session) {
  const auto model = colmap_of(content);
  if (!model) return impossible(wish);
  std::error_code ignored;
  if (fs::exists(wish.out, ignored) && !is_colmap_folder(wish.out)) {
    return base::fail(ErrorCode::kUsage, fmt::format("{} holds other files than a COLMAP model's; name a new or empty folder",
                                                     base::shown(wish.out)));
  }
  auto folder = ResultFolder::begin(wish.out, is_colmap_folder);
  if (!folder) return base::fail(std::move(folder));
  const auto format = wish.binary ? base::ColmapFormat::kBinary : base::ColmapFormat::kText;
  if (auto written = base::write_colmap_model(folder->path(), *model, format); !written) return written;
  if (std::holds_alternative<base::AdjustedNetwork>(content)) session.say("in mm; COLMAP's files hold no covariances");
  return folder->commit();
}

/// The camera with its place in the rig, where it has one and the file can hold it.
Result<> write_camera(const Wish& wish, const Exchanged& content, Session& session) {
  const auto cameras = cameras_of(content);
  if (cameras.empty()) return impossible(wish);
  const auto one = chosen_camera(cameras, wish.camera);
  if (!one) return base::fail(one.error().code, fmt::format("{}: {}", base::shown(wish.in), one.error().message));
  const bool mrcal = wish.out.extension() == ".cameramodel";
  auto written = mrcal ? base::write_cameramodel(wish.out, one->camera, one->camera_from_rig.value_or(base::Pose{}))
                       : base::write_opencv_yaml(wish.out, one->camera);
  if (!written) return written;
  if (!mrcal && one->camera.covariance().size() > 0) session.say("OpenCV's files hold no covariance");
  if (!mrcal && cameras.size() > 1 && one->camera_from_rig)
    session.say("the camera's place on its rig is not in this file; INTRINSICS.yml,EXTRINSICS.yml would hold it");
  return written;
}

Result<> write_chain(const Wish& wish, const Exchanged& content, Session& session) {
  std::vector<base::KalibrCamera> chain;
  std::optional<base::Pose> previous;
  std::string names;
  for (PlacedCamera& one : cameras_of(content)) {
    base::KalibrCamera& link = chain.emplace_back(base::KalibrCamera{std::move(one.name), std::move(one.camera), {}});
    if (previous && one.camera_from_rig) link.camera_from_previous = *one.camera_from_rig * previous->inverse();
    previous = one.camera_from_rig;
    names +=
        fmt::format("{}cam{} is {}", names.empty() ? "" : ", ", chain.size() - 1, link.name.empty() ? "the camera" : link.name);
  }
  if (chain.empty()) return impossible(wish);
  auto written = base::write_kalibr_chain(wish.out, chain);
  if (written) session.say(names + "; kalibr's files hold no covariance");
  return written;
}

/// "INTRINSICS.yml,EXTRINSICS.yml", as scan --head takes them; nothing where the text is no such pair.
std::optional<std::pair<fs::path, fs::path>> stereo_pair(const fs::path& out) {
  const std::string text = out.string();
  const std::size_t comma = text.find(',');
  if (comma == std::string::npos) return std::nullopt;
  const std::pair<fs::path, fs::path> files(text.substr(0, comma), text.substr(comma + 1));
  for (const fs::path& file : {files.first, files.second}) {
    if (file.extension() != ".yml" && file.extension() != ".yaml") return std::nullopt;
  }
  return files;
}

Result<> write_stereo(const Wish& wish, const Exchanged& content, Session& session) {
  const auto cameras = cameras_of(content);
  if (cameras.size() != 2 || !cameras[0].camera_from_rig || !cameras[1].camera_from_rig) return impossible(wish);
  const auto [intrinsic, extrinsic] = *stereo_pair(wish.out);
  session.say(fmt::format("T in mm, of images of {} x {} px; these files hold no covariance", cameras[0].camera.width_px(),
                          cameras[0].camera.height_px()));
  return base::write_opencv_stereo(intrinsic, extrinsic, cameras[0].camera, cameras[1].camera,
                                   *cameras[1].camera_from_rig * cameras[0].camera_from_rig->inverse());
}

Result<> write_path(const Wish& wish, const base::ToolPath& path) {
  const std::string ending = wish.out.extension().string();
  if (ending == ".csv") return base::write_tool_path_csv(wish.out, path);
  if (ending == ".dxf") return base::write_tool_path_dxf(wish.out, path);
  if (ending == ".ngc") return base::write_gcode(wish.out, path, wish.gcode);
  return impossible(wish);
}

Result<> write_points(const Wish& wish, const Exchanged& content, Session& session) {
  const std::string ending = wish.out.extension().string();
  if (std::holds_alternative<base::ColmapModel>(content) && wish.unit.empty()) {
    session.say("COLMAP's files name no unit; mm is taken, as in those that crosstie writes (--unit says otherwise)");
  }
  if (ending == ".ply" || ending == ".pcd" || ending == ".txt" ||
      (std::holds_alternative<base::Cloud>(content) && ending != ".obc")) {
    const auto cloud = cloud_of(content, wish.unit_mm);
    if (!cloud) return tl::unexpected(cloud.error());
    if (!*cloud) return impossible(wish);
    if (ending == ".pcd") session.say("PCD files hold 4-byte floats: coordinates of 1 m to 1e-4 mm");
    if (ending == ".pcd") return base::write_pcd(wish.out, **cloud);
    if (ending == ".ply") return base::write_ply(wish.out, **cloud, {.double_coordinates = !wish.single});
    return base::write_cloud_table(wish.out, **cloud);
  }
  const auto points = points_of(content, wish.unit_mm);
  if (!points) return tl::unexpected(points.error());
  if (!*points) return impossible(wish);
  if (ending == ".obc") session.say("object lists hold sigmas, but no correlations");
  return ending == ".obc" ? base::write_aicon_object_points(wish.out, (*points)->list)
                          : base::write_point_list(wish.out, (*points)->list);
}

using Write = Result<> (*)(const Wish&, const Exchanged&, Session&);

/// By the ending of OUT.
Result<Write> writer(const Wish& wish) {
  if (stereo_pair(wish.out)) return write_stereo;
  const std::string ending = wish.out.extension().string();
  const auto is = [&](std::initializer_list<const char*> endings) {
    return std::any_of(endings.begin(), endings.end(), [&](const char* one) { return ending == one; });
  };
  if (is({".csv", ".txt", ".obc", ".ply", ".pcd", ".dxf", ".ngc"})) {
    return [](const Wish& w, const Exchanged& content, Session& session) -> Result<> {
      if (const auto* path = std::get_if<base::ToolPath>(&content)) return write_path(w, *path);
      if (w.out.extension() == ".dxf" || w.out.extension() == ".ngc") return impossible(w);
      return write_points(w, content, session);
    };
  }
  if (is({".cameramodel", ".yaml", ".yml"})) return wish.chain ? write_chain : write_camera;
  std::error_code ignored;
  if (ending.empty() || fs::is_directory(wish.out, ignored)) return write_colmap;
  return base::fail(ErrorCode::kUsage,
                    fmt::format("cannot convert into {}; possible: {}", base::shown(wish.out), kConversions));
}

Result<> check_overwriting(const fs::path& out, bool force) {
  ResultFolder::clear_leftovers(out);
  std::error_code ignored;
  if (force || !fs::exists(out, ignored) || (fs::is_directory(out, ignored) && fs::is_empty(out, ignored))) return {};
  return base::fail(ErrorCode::kUsage, fmt::format("{} exists; --force replaces it", base::shown(out)));
}

/// Options that say nothing of this OUT are mistakes.
Result<> check_options(const Wish& wish, const Arguments& arguments) {
  const std::string ending = wish.out.extension().string();
  const bool camera = ending == ".cameramodel" || ending == ".yaml" || ending == ".yml";
  const std::pair<const char*, bool> rules[] = {{"--binary", ending.empty()},
                                                {"--single", ending == ".ply"},
                                                {"--kalibr", camera && ending != ".cameramodel" && !stereo_pair(wish.out)},
                                                {"--camera", camera && !wish.chain && !stereo_pair(wish.out)},
                                                {"--template", ending == ".ngc"},
                                                {"--arc-tolerance-mm", ending == ".ngc"},
                                                {"--retract-mm", ending == ".ngc"}};
  for (const auto& [option, fits] : rules) {
    if (arguments.has(option) && !fits)
      return base::fail(ErrorCode::kUsage, fmt::format("{} says nothing of {}", option, base::shown(wish.out)));
  }
  return {};
}

Result<Wish> wish_of(const Arguments& arguments) {
  Wish wish{.in = *arguments.get("IN"), .out = *arguments.get("OUT"), .unit = arguments.get("--unit").value_or("")};
  if (wish.unit == "m")
    wish.unit_mm = 1000.0;
  else if (wish.unit == "inch")
    wish.unit_mm = 25.4;
  else if (!wish.unit.empty() && wish.unit != "mm")
    return base::fail(ErrorCode::kUsage, fmt::format("--unit is mm, m or inch, not '{}'", wish.unit));
  wish.camera = arguments.get("--camera").value_or("");
  wish.binary = arguments.has("--binary");
  wish.single = arguments.has("--single");
  wish.chain = arguments.has("--kalibr");
  for (const auto& [name, value] :
       {std::pair{"--arc-tolerance-mm", &wish.gcode.arc_tolerance_mm}, std::pair{"--retract-mm", &wish.gcode.retract_mm}}) {
    const auto number = arguments.number(name);
    if (!number) return tl::unexpected(number.error());
    if (*number) *value = **number;
  }
  wish.gcode.program = wish.in.stem().string();
  if (const auto file = arguments.get("--template")) {
    constexpr std::size_t kMostBytes = std::size_t{1} << 20;
    auto text = base::read_file(*file, kMostBytes);
    if (!text) return base::fail(std::move(text));
    if (text->empty()) return base::fail(ErrorCode::kBadInput, fmt::format("{} is empty", base::shown(*file)));
    wish.gcode.template_text = *std::move(text);
  }
  return wish;
}

Result<Outcome> run(const Arguments& arguments, Session& session) {
  const auto wish = wish_of(arguments);
  if (!wish) return tl::unexpected(wish.error());
  const auto write = writer(*wish);
  if (!write) return tl::unexpected(write.error());
  if (auto good = check_options(*wish, arguments); !good) return base::fail(std::move(good));
  std::vector<fs::path> files = {wish->out};
  if (const auto pair = stereo_pair(wish->out)) files = {pair->first, pair->second};
  for (const fs::path& file : files) {
    if (auto may = check_overwriting(file, arguments.has("--force")); !may) return base::fail(std::move(may));
  }
  const auto content = read_exchanged(wish->in, wish->unit);
  if (!content) return tl::unexpected(content.error());
  const bool takes_unit = std::holds_alternative<FramedPoints>(*content) ||
                          std::holds_alternative<base::ColmapModel>(*content) || std::holds_alternative<base::Cloud>(*content);
  if (!wish->unit.empty() && (!takes_unit || *write == Write{write_colmap})) {
    return base::fail(ErrorCode::kUsage, "--unit is for lists of points, clouds, and COLMAP models that become such lists");
  }
  if (auto written = (*write)(*wish, *content, session); !written) return base::fail(std::move(written));
  session.print(wish->out.string());
  return Outcome::kOk;
}

}  // namespace

Verb convert_verb() {
  return {
      "convert",
      "turn files of one program into those of another",
      "  $ crosstie convert results/adjust colmap\n"
      "  in mm; COLMAP's files hold no covariances\n"
      "  colmap\n"
      "  $ crosstie convert tritop.obc tritop.csv\n"
      "  tritop.csv\n"
      "  $ crosstie convert results/calibrate right.cameramodel --camera right\n"
      "  right.cameramodel",
      {{"IN", "IN",
        "list of points (.csv, .txt, .obc), cloud (.ply, .pcd), camera (.cameramodel, .yaml), path.json, COLMAP folder, result "
        "of adjust, "
        "calibrate or commission",
        true, false},
       {"OUT", "OUT",
        "by its ending: .csv, .txt, .obc, .ply or .pcd for points, .cameramodel or .yaml for a camera, "
        "INTRINSICS.yml,EXTRINSICS.yml for "
        "OpenCV's stereo pair, .csv, .dxf or .ngc for a path, no ending for a COLMAP folder",
        true, false},
       {"--binary", "", "write COLMAP's binary files (default: text)", false, false},
       {"--single", "", "coordinates of a .ply as 4-byte floats (default: double)", false, false},
       {"--unit",
        "UNIT",
        "mm, m or inch: of a list whose columns do not say, of a cloud, or of a COLMAP model (default mm)",
        false,
        false,
        1,
        {"mm", "m", "inch"}},
       {"--camera", "NAME", "which one, where IN holds several cameras", false, false},
       {"--kalibr", "", "write a .yaml as kalibr's chain of all cameras of IN (default: OpenCV's YAML of one)", false, false},
       {"--template", "FILE", "of a .ngc: text with placeholders (default: the program's own, formats.md)", false, false},
       {"--arc-tolerance-mm", "MM", "of a .ngc: runs of points become arcs within it (default 0: straight moves alone)", false,
        false},
       {"--retract-mm", "MM", "of a .ngc: the torch comes and goes along its axis from so far (default 50)", false, false},
       {"--force", "", "replace OUT where it exists", false, false}},
      run};
}

}  // namespace crosstie::app
