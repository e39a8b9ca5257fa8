#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "base/result.h"

namespace crosstie::app {

/// A list of ids as the job writes it: ["0-127", "200"]; empty means all.
struct IdRanges {
  std::vector<std::pair<int, int>> ranges;  ///< first and last, both included

  [[nodiscard]] bool contains(int id) const;
};

/// "7", "0-127" or several of them separated by commas.
base::Result<IdRanges> parse_id_ranges(const std::vector<std::string>& texts);
/// "11,52": two different ids; a kUsage Error else.
base::Result<std::pair<int, int>> parse_id_pair(const std::string& text);
/// Back to the words of the job.
std::vector<std::string> format_id_ranges(const IdRanges& ids);

/// `[camera.NAME]`: where the start values of a camera come from.
struct JobCamera {
  std::optional<std::filesystem::path> model;  ///< a .cameramodel or OpenCV YAML; else a nominal focal length:
  std::optional<double> focal_mm;              ///< with sensor_width_mm
  std::optional<double> sensor_width_mm;
  std::optional<double> focal_px;        ///< else from the photographs' EXIF data
  std::string lens = "opencv5";          ///< model of a camera without a file: pinhole, opencv4, opencv5, opencv8, opencv12
  bool estimate = true;                  ///< false: the parameters of `model` are taken as they are
  std::vector<std::string> fixed;        ///< parameters that stay at their start values, such as "k3"
  std::map<std::string, double> sigmas;  ///< prior sigma of parameters, in their units; 0 holds one
  std::optional<double> white_level;     ///< grey level of a saturated pixel, where it is not the file format's
};

/// `[network]`: photographs of an object for its coordinates.
struct JobNetwork {
  std::vector<std::pair<std::string, std::string>> images;  ///< camera and file pattern, sorted by camera
  std::optional<std::filesystem::path> scale_bars;
  std::optional<std::pair<int, int>> scale_from;  ///< one distance of the reference that defines the scale
  bool scale_is_free = false;                     ///< scale = "free": no scale is known and none is wanted
  std::optional<std::filesystem::path> control;   ///< a point list with sigmas, or the result folder of another adjust
  std::optional<std::filesystem::path> datum;     ///< a point list, perhaps with the column axes
  bool uncoded = true;                            ///< match and adjust the dots without a code, too
};

/// `[rig]`: cameras on one mount; the first one's frame is the rig's.
struct JobRig {
  std::string name = "rig";
  std::vector<std::string> cameras;
};

/// `[limits]`: what makes a verdict fail. Those that are not set are not judged, the first aside.
struct JobLimits {
  double sigma0_px = 0.1;     ///< of one image coordinate; circular targets are measured far better than a tenth of a pixel
  double scale_bar_w = 3.29;  ///< standardised deviation of a scale bar; 0.1 % two-sided of a normal distribution
  double control_w = 3.29;    ///< the same of a control point
  std::optional<double> point_sigma_mm;    ///< largest sigma of a coordinate
  std::optional<double> deviation_rms_mm;  ///< 3D, against the reference
  std::optional<double> deviation_max_mm;
  std::optional<double> length_mpe_a_mm;  ///< maximum permissible length error A + L / K (VDI/VDE 2634-1)
  std::optional<double> length_mpe_k;     ///< mm of length per mm of error
};

/// A job folder's job.toml (docs/formats.md). Paths in it are relative to the folder.
struct Job {
  std::filesystem::path file;
  std::filesystem::path folder;
  std::string name;
  std::string family;
  std::optional<double> dot_diameter_mm;
  IdRanges ids;
  IdRanges exclude_ids;
  std::map<std::string, JobCamera> cameras;
  std::optional<JobRig> rig;
  std::optional<JobNetwork> network;
  std::optional<std::filesystem::path> reference_points;
  std::string reference_unit;  ///< empty: the file says
  JobLimits limits;
  std::vector<std::string> unused;  ///< sections that this version reads past

  [[nodiscard]] std::filesystem::path resolve(const std::filesystem::path& path) const;
};

/// Reads a job folder or its job.toml. Unknown keys, wrong types and missing sections are kBadInput Errors with file and line.
base::Result<Job> read_job(const std::filesystem::path& folder_or_file);

}  // namespace crosstie::app
