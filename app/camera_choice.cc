#include "app/camera_choice.h"

#include <algorithm>
#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "base/file.h"
#include "base/kalibr.h"

namespace crosstie::app {
namespace {

namespace fs = std::filesystem;
using base::ErrorCode;
using base::fail;
using base::Result;

const char* const kEnding = ".cameramodel";

/// Names of the camera models in a folder.
Result<std::vector<std::string>> cameras_in(const fs::path& folder) {
  std::vector<std::string> names;
  std::error_code error;
  for (fs::directory_iterator entry(folder, error), end; !error && entry != end; entry.increment(error)) {
    if (entry->path().extension() == kEnding) names.push_back(entry->path().stem().string());
  }
  if (error) return fail(ErrorCode::kFileSystem, fmt::format("{}: {}", base::shown(folder), error.message()));
  std::sort(names.begin(), names.end());
  return names;
}

Result<fs::path> file_in(const fs::path& folder, const std::string& name) {
  const auto names = cameras_in(folder);
  if (!names) return tl::unexpected(names.error());
  if (names->empty()) {
    return fail(ErrorCode::kBadInput,
                fmt::format("{}: no camera model (*{}) is in this folder; results of calibrate and adjust "
                            "hold them",
                            base::shown(folder), kEnding));
  }
  if (name.empty() && names->size() == 1) return folder / (names->front() + kEnding);
  if (std::find(names->begin(), names->end(), name) != names->end()) return folder / (name + kEnding);
  return fail(ErrorCode::kUsage,
              fmt::format("{}: {}; --camera is one of {}", base::shown(folder),
                          name.empty() ? std::string("several cameras") : "no camera " + name, fmt::join(*names, ", ")));
}

}  // namespace

bool holds_cameras(const fs::path& path) {
  constexpr std::size_t kMaxBytes = std::size_t{4} << 20;
  std::error_code error;
  if (fs::is_directory(path, error)) return true;
  const auto text = base::read_file(path, kMaxBytes);
  return text && base::is_kalibr_chain(*text);
}

Result<ChosenCamera> choose_camera(const fs::path& path, const std::string& name) {
  fs::path file = path;
  std::error_code error;
  if (fs::is_directory(path, error)) {
    auto inside = file_in(path, name);
    if (!inside) return fail(std::move(inside));
    file = *std::move(inside);
  }
  auto camera = base::read_named_camera(file, name);
  if (!camera) return fail(std::move(camera));
  return ChosenCamera{*std::move(camera), std::move(file)};
}

}  // namespace crosstie::app
