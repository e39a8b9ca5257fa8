#pragma once

#include <filesystem>
#include <utility>
#include <vector>

#include "base/network.h"
#include "base/result.h"

namespace crosstie::base {

/// The files of an AICON 3D Studio project, one of each kind.
struct AiconProject {
  std::filesystem::path image_points;   ///< .phc
  std::filesystem::path object_points;  ///< .obc
  std::filesystem::path cameras;        ///< .ior
  std::filesystem::path images;         ///< .eor
  std::filesystem::path scales;         ///< .scale
};

/// Finds them by their endings. Errors: kBadInput where a kind is missing or stands there twice; kFileSystem where there is no
/// such folder.
Result<AiconProject> find_aicon_project(const std::filesystem::path& folder);

struct AiconNetworkOptions {
  struct ImagePointId {
    int image = 0;
    int point = 0;
  };
  struct Sigma {
    ImagePointId of;
    double sigma_mm = 0.0;
  };

  /// A priori sigma of an image coordinate on the sensor [mm]. Default: AICON's; the sigmas of the .phc file are those of the
  /// ellipse fit, with which AICON does not adjust.
  double sigma_mm = 0.0005;
  /// The same in px, where it is positive.
  double sigma_px = 0.0;
  std::vector<Sigma> overrides;        ///< image points with a sigma of their own
  std::vector<ImagePointId> excluded;  ///< image points that do not take part
  bool start_values = true;            ///< false: poses and points of the .eor and .obc files are not used to start with
};

/// The project as a network: the active image points (those of inactive object points aside; points that the .obc file does not list
/// are new ones), all cameras and images, the active scale bars. The datum are all active object points with their coordinates of the .obc file. Names of cameras and images are AICON's numbers.
///
/// Errors: those of the readers in aicon_files.h; kBadInput for files that do not belong together (an image of no camera, a rotation
/// order other than 0), for sensors without a size, and for overrides and exclusions that name no image point.
Result<Network> read_aicon_network(const AiconProject& project, const AiconNetworkOptions& options = {});

/// Reads the columns image,id,sigma_mm (image,id); an image point occurs once.
Result<std::vector<AiconNetworkOptions::Sigma>> read_image_point_sigmas(const std::filesystem::path& path);
Result<std::vector<AiconNetworkOptions::ImagePointId>> read_image_point_ids(const std::filesystem::path& path);

}  // namespace crosstie::base
