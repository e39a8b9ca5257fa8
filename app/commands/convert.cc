// crosstie convert: files of other programs, in and out

#include <algorithm>
#include <filesystem>

#include <fmt/core.h>

#include "app/exchange.h"
#include "app/result_folder.h"
#include "app/verb.h"
#include "base/camera_file.h"
#include "base/file.h"

namespace crosstie::app {
namespace {

namespace fs = std::filesystem;
using base::ErrorCode;
using base::Result;

enum class OutKind { kPoints, kCamera, kColmap };

Result<OutKind> out_kind(const fs::path& out) {
  const std::string ending = out.extension().string();
  if (ending == ".csv" || ending == ".obc" || ending == ".ply") return OutKind::kPoints;
  if (ending == ".cameramodel" || ending == ".yaml" || ending == ".yml") return OutKind::kCamera;
  std::error_code ignored;
  if (ending.empty() || fs::is_directory(out, ignored)) return OutKind::kColmap;
  return base::fail(ErrorCode::kUsage, fmt::format("cannot convert into {}; possible: {}", base::shown(out), kConversions));
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

Result<> check_overwriting(const fs::path& out, bool force) {
  ResultFolder::clear_leftovers(out);
  std::error_code ignored;
  if (force || !fs::exists(out, ignored) || (fs::is_directory(out, ignored) && fs::is_empty(out, ignored))) return {};
  return base::fail(ErrorCode::kUsage, fmt::format("{} exists; --force replaces it", base::shown(out)));
}

Result<> write_colmap(const fs::path& out, const base::ColmapModel& model, bool binary) {
  std::error_code ignored;
  if (fs::exists(out, ignored) && !is_colmap_folder(out)) {
    return base::fail(ErrorCode::kUsage,
                      fmt::format("{} holds other files than a COLMAP model's; name a new or empty folder", base::shown(out)));
  }
  auto folder = ResultFolder::begin(out, is_colmap_folder);
  if (!folder) return base::fail(std::move(folder));
  const auto format = binary ? base::ColmapFormat::kBinary : base::ColmapFormat::kText;
  if (auto written = base::write_colmap_model(folder->path(), model, format); !written) return written;
  return folder->commit();
}

Result<> write_camera(const fs::path& out, const base::Camera& camera) {
  return out.extension() == ".cameramodel" ? base::write_cameramodel(out, camera) : base::write_opencv_yaml(out, camera);
}

tl::unexpected<base::Error> impossible(const fs::path& in, const fs::path& out) {
  return base::fail(ErrorCode::kUsage,
                    fmt::format("{} cannot become {}; possible: {}", base::shown(in), base::shown(out), kConversions));
}

/// What a conversion cannot carry over is said, not passed over in silence.
void say_losses(const Exchanged& content, const fs::path& out, OutKind kind, bool unit_given, Session& session) {
  if (std::holds_alternative<base::ColmapModel>(content) && kind == OutKind::kPoints && !unit_given) {
    session.say("COLMAP's files name no unit; mm is taken, as in those that crosstie writes (--unit says otherwise)");
  }
  if (kind == OutKind::kColmap && std::holds_alternative<base::AdjustedNetwork>(content)) {
    session.say("in mm; COLMAP's files hold no covariances");
  }
  if (out.extension() == ".obc") session.say("object lists hold sigmas, but no correlations");
  if (const auto* camera = std::get_if<base::Camera>(&content); camera != nullptr && camera->covariance().size() > 0) {
    session.say("camera files hold no covariance");
  }
}

Result<double> unit_in_mm(const std::string& unit) {
  if (unit.empty() || unit == "mm") return 1.0;
  if (unit == "m") return 1000.0;
  if (unit == "inch") return 25.4;
  return base::fail(ErrorCode::kUsage, fmt::format("--unit is mm, m or inch, not '{}'", unit));
}

Result<Outcome> run(const Arguments& arguments, Session& session) {
  const fs::path in = *arguments.get("IN");
  const fs::path out = *arguments.get("OUT");
  const std::string unit = arguments.get("--unit").value_or("");
  const auto unit_mm = unit_in_mm(unit);
  if (!unit_mm) return tl::unexpected(unit_mm.error());
  const auto kind = out_kind(out);
  if (!kind) return tl::unexpected(kind.error());
  if (arguments.has("--binary") && *kind != OutKind::kColmap) {
    return base::fail(ErrorCode::kUsage, "--binary is for COLMAP folders");
  }
  if (auto may = check_overwriting(out, arguments.has("--force")); !may) return base::fail(std::move(may));
  const auto content = read_exchanged(in, unit, arguments.get("--camera").value_or(""));
  if (!content) return tl::unexpected(content.error());
  const bool has_unit =
      std::holds_alternative<base::Camera>(*content) || std::holds_alternative<base::AdjustedNetwork>(*content);
  if (!unit.empty() && (has_unit || *kind == OutKind::kColmap)) {
    return base::fail(ErrorCode::kUsage, "--unit is for lists of points and COLMAP models that become such lists");
  }

  Result<> written;
  if (*kind == OutKind::kCamera) {
    const auto* camera = std::get_if<base::Camera>(&*content);
    if (camera == nullptr) return impossible(in, out);
    written = write_camera(out, *camera);
  } else if (*kind == OutKind::kColmap) {
    const auto model = colmap_of(*content);
    if (!model) return impossible(in, out);
    written = write_colmap(out, *model, arguments.has("--binary"));
  } else {
    const auto points = points_of(*content, *unit_mm);
    if (!points) return tl::unexpected(points.error());
    if (!*points) return impossible(in, out);
    written = write_points(out, **points);
  }
  if (!written) return base::fail(std::move(written));
  say_losses(*content, out, *kind, !unit.empty(), session);
  session.print(out.string());
  return Outcome::kOk;
}

}  // namespace

Verb convert_verb() {
  return {"convert",
          "turn files of one program into those of another",
          "  $ crosstie convert results/adjust colmap\n"
          "  in mm; COLMAP's files hold no covariances\n"
          "  colmap\n"
          "  $ crosstie convert tritop.obc tritop.csv\n"
          "  tritop.csv",
          {{"IN", "IN", "list of points (.csv, .txt, .obc), camera (.cameramodel, .yaml), result of adjust or COLMAP folder",
            true, false},
           {"OUT", "OUT",
            "by its ending: .csv, .obc or .ply for points, .cameramodel or .yaml for a camera, no ending for a COLMAP folder",
            true, false},
           {"--binary", "", "write COLMAP's binary files (default: text)", false, false},
           {"--unit",
            "UNIT",
            "mm, m or inch: of a list whose columns do not say, or of a COLMAP model (default mm)",
            false,
            false,
            1,
            {"mm", "m", "inch"}},
           {"--camera", "NAME", "of a chain of kalibr (camchain.yaml) with several cameras: which one", false, false},
           {"--force", "", "replace OUT where it exists", false, false}},
          run};
}

}  // namespace crosstie::app
