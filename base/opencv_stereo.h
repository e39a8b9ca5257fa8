#pragma once

#include <filesystem>

#include "base/machine.h"
#include "base/result.h"

namespace crosstie::base {

/// Reads a stereo pair as OpenCV's stereo_calib sample writes it: M1 D1 M2 D2 of `intrinsic`, R T of `extrinsic` (right_from_left; the
/// unit of T is taken as mm). These files do not say the images' size nor any covariance. Errors: kFileSystem; kBadInput with the file
/// where a matrix is missing or of another shape, or R is no rotation.
Result<Head> read_opencv_stereo(const std::filesystem::path& intrinsic, const std::filesystem::path& extrinsic, int width_px,
                                int height_px);

/// Writes such a pair with 17 significant digits; T in mm. An Error (kUsage) names the model that OpenCV does not have.
Result<> write_opencv_stereo(const std::filesystem::path& intrinsic, const std::filesystem::path& extrinsic, const Camera& left,
                             const Camera& right, const Pose& right_from_left);

}  // namespace crosstie::base
