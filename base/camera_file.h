#pragma once

#include <filesystem>

#include "base/camera.h"
#include "base/result.h"

namespace crosstie::base {

/// Reads a camera model by its content: mrcal's `.cameramodel` or OpenCV's YAML (camera_matrix, distortion_coefficients,
/// image_width, image_height, as calibrateCamera's sample writes them).
Result<Camera> read_camera(const std::filesystem::path& path);

/// Writes mrcal's `.cameramodel` with 17 significant digits (mrcal 2.2's own writer keeps six decimals) and identity
/// extrinsics.
Result<> write_cameramodel(const std::filesystem::path& path, const Camera& camera);

/// Writes OpenCV's YAML with 17 significant digits.
Result<> write_opencv_yaml(const std::filesystem::path& path, const Camera& camera);

}  // namespace crosstie::base
