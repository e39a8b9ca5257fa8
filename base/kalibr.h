#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/camera.h"
#include "base/pose.h"
#include "base/result.h"

namespace crosstie::base {

/// A camera of a chain as kalibr writes it (camchain.yaml, results-cam.yaml).
struct KalibrCamera {
  std::string name;                          ///< "cam0"
  Camera camera;                             ///< pinhole, or opencv4 for the distortion model radtan
  std::optional<Pose> camera_from_previous;  ///< T_cn_cnm1, its metres turned into mm; of the first camera there is none
};

/// Whether a YAML text is a chain: its top level has the key cam0.
[[nodiscard]] bool is_kalibr_chain(std::string_view text);

/// Reads a chain: of each camera camera_model pinhole with intrinsics [fu, fv, pu, pv], distortion_model radtan (k1, k2, p1, p2) or none,
/// resolution [width, height]. Pixels are those of the corner detector, (0, 0) the centre of the first, as here. Other keys (rostopic,
/// T_cam_imu, overlaps) are passed over.
///
/// Errors: kFileSystem; kBadInput with file and line for what is no such list of numbers, for other camera and distortion models (nothing is
/// approximated), for a T_cn_cnm1 that is no rotation and translation, and for more than 64 cameras.
Result<std::vector<KalibrCamera>> read_kalibr_chain(const std::filesystem::path& path);
/// The same for a text in memory; `path` is what error messages name.
Result<std::vector<KalibrCamera>> parse_kalibr_chain(const std::filesystem::path& path, std::string_view text);

/// Writes a chain that kalibr reads, with 17 significant digits: cam0, cam1, ... in the order of `cameras` (their own names are lost), T_cn_cnm1
/// in metres where `camera_from_previous` is known. An Error (kUsage) names a camera that is neither pinhole nor opencv4; one with more
/// coefficients only where those that radtan lacks are zero.
Result<> write_kalibr_chain(const std::filesystem::path& path, const std::vector<KalibrCamera>& cameras);

/// A camera file of any kind (base/camera_file.h); of a chain `name` says which, and may be empty where there is one only. kUsage, with the
/// names that there are, where the chain has no such camera.
Result<Camera> read_named_camera(const std::filesystem::path& path, const std::string& name);

}  // namespace crosstie::base
