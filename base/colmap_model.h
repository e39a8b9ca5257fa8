#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "base/camera.h"
#include "base/network.h"
#include "base/pose.h"
#include "base/result.h"

namespace crosstie::base {

struct ColmapCamera {
  std::uint32_t id = 0;
  Camera camera;
};

/// An image point and the 3D point that it shows.
struct ColmapImagePoint {
  Eigen::Vector2d pixel_px = Eigen::Vector2d::Zero();  ///< (0, 0) is the centre of the first pixel
  std::optional<std::uint64_t> point_id;               ///< nothing where it shows no point of the model
};

struct ColmapImage {
  std::uint32_t id = 0;
  std::string name;
  std::uint32_t camera_id = 0;
  Pose camera_from_world;  ///< its translation is in the model's unit
  std::vector<ColmapImagePoint> points;
};

/// Where a 3D point is seen: an image and the index into its points.
struct ColmapTrackElement {
  std::uint32_t image_id = 0;
  std::uint32_t point_index = 0;
};

struct ColmapPoint {
  std::uint64_t id = 0;
  Eigen::Vector3d xyz = Eigen::Vector3d::Zero();  ///< in the model's unit
  std::array<std::uint8_t, 3> rgb{};
  double error_px = -1.0;  ///< mean length of its residuals; negative where unknown
  std::vector<ColmapTrackElement> track;
};

/// A sparse model of COLMAP (colmap.github.io/format.html; github.com/colmap/colmap, src/colmap/sensor/models.h).
///
/// Its unit is whatever its maker took: COLMAP's files name none. Those that crosstie writes are in mm. Rigs and frames of
/// newer COLMAP versions are not read; they are not needed to understand the images' poses.
///
/// Pixels: COLMAP counts from the image's corner, so that its first pixel's centre is (0.5, 0.5); here it is (0, 0). Principal
/// points and image points are shifted by half a pixel where files are read and written.
///
/// Lens models: SIMPLE_PINHOLE and PINHOLE are kPinhole; SIMPLE_RADIAL, RADIAL and OPENCV are kOpenCv4; FULL_OPENCV is
/// kOpenCv8. Written are PINHOLE, OPENCV, and FULL_OPENCV for kOpenCv5 (k4 = k5 = k6 = 0) and kOpenCv8; kOpenCv12 only where
/// its thin-prism terms are zero. All others are Errors, never approximations.
struct ColmapModel {
  std::vector<ColmapCamera> cameras;  ///< sorted by id, as the other lists
  std::vector<ColmapImage> images;
  std::vector<ColmapPoint> points;
};

enum class ColmapFormat { kText, kBinary };

/// Whether a folder holds a model, and in which format; binary where it holds both, as COLMAP itself decides.
[[nodiscard]] std::optional<ColmapFormat> colmap_format_of(const std::filesystem::path& folder);

/// Reads cameras, images and points3D (.bin or .txt) of a folder. Counts are checked against the files' sizes before anything
/// is allocated. Errors (kBadInput) name file and line or offset: damaged syntax, values that are not finite, lens models that
/// are not known here, ids that occur twice, references to what does not exist, tracks and image points that contradict
/// each other.
Result<ColmapModel> read_colmap_model(const std::filesystem::path& folder);

/// Writes the three files into an existing folder, each atomically. Text has 17 significant digits: both formats read back as
/// the same model, pixels to the last digit or two (the shift of half a pixel is rounded). An Error (kBadInput) where the model
/// contradicts itself, a lens model has no counterpart, or a name cannot be written (blanks separate the words of the text
/// format, a zero byte ends a name in the binary one).
Result<> write_colmap_model(const std::filesystem::path& folder, const ColmapModel& model, ColmapFormat format);

/// The model of an adjusted network, in mm: world is the network's frame, points keep their ids, cameras and images are
/// numbered from 1 in the order of their names, and the image points are the measured ones that took part. Images carry the
/// names of the network, which are file names without their ending.
[[nodiscard]] ColmapModel colmap_model_of(const AdjustedNetwork& network);

}  // namespace crosstie::base
