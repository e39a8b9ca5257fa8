#pragma once

#include <filesystem>

#include "base/camera.h"
#include "base/pose.h"
#include "base/result.h"

namespace crosstie::base {

/// Reads a camera model by its content: mrcal's `.cameramodel` or OpenCV's YAML (camera_matrix, distortion_coefficients,
/// image_width, image_height, as calibrateCamera's sample writes them). Of a .cameramodel the extrinsics and the optimization
/// inputs are passed over; valid_intrinsics_region and our own key intrinsics_covariance are taken where they are.
Result<Camera> read_camera(const std::filesystem::path& path);

/// Writes mrcal's `.cameramodel` with 17 significant digits (mrcal 2.2's own writer keeps six decimals); with the valid region and the
/// covariance where the camera has them (mrcal passes over the latter). The extrinsics are where the camera sits in a frame that several share,
/// rotation vector [rad] and translation in metres, the unit of mrcal's tools; identity by default.
Result<> write_cameramodel(const std::filesystem::path& path, const Camera& camera, const Pose& camera_from_reference = {});

/// Writes OpenCV's YAML with 17 significant digits.
Result<> write_opencv_yaml(const std::filesystem::path& path, const Camera& camera);

}  // namespace crosstie::base
