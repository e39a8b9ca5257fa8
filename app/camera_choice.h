#pragma once

#include <filesystem>
#include <string>

#include "base/camera.h"
#include "base/result.h"

namespace crosstie::app {

/// A camera model and the file that it was read from.
struct ChosenCamera {
  base::Camera camera;
  std::filesystem::path file;
};

/// `path` is a camera file (.cameramodel, OpenCV's YAML, kalibr's chain), or the folder of a result with camera models in it (calibrate,
/// adjust). Of a chain and of a folder `name` says which; it may be empty where there is one only.
/// Errors: kFileSystem; kBadInput for damaged files; kUsage where the folder has no such camera (the message names those that it
/// has).
base::Result<ChosenCamera> choose_camera(const std::filesystem::path& path, const std::string& name);

/// Whether `path` is a folder or a chain, in which a name chooses.
[[nodiscard]] bool holds_cameras(const std::filesystem::path& path);

}  // namespace crosstie::app
