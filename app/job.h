#pragma once

#include <chrono>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "base/board.h"
#include "base/camera.h"
#include "base/certificate.h"
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

/// `[camera.NAME]`: where a camera's lens comes from.
struct JobCamera {
  std::optional<std::string> board_images;     ///< file pattern of its images of the `[board]`: it is calibrated by them
  std::optional<double> temperature_c;         ///< of the camera while it took them
  std::optional<std::filesystem::path> model;  ///< a .cameramodel or OpenCV YAML; else a nominal focal length:
  std::optional<double> focal_mm;              ///< with sensor_width_mm
  std::optional<double> sensor_width_mm;
  std::optional<double> focal_px;        ///< else from the photographs' EXIF data
  std::optional<base::LensModel> lens;   ///< of a camera without a file (kOpenCv5 where none is given); calibrate: no ladder
  bool estimate = true;                  ///< false: the parameters of `model` are taken as they are
  std::vector<std::string> fixed;        ///< parameters that stay at their start values, such as "k3"
  std::map<std::string, double> sigmas;  ///< prior sigma of parameters, in their units; 0 holds one
  std::optional<double> white_level;     ///< grey level of a saturated pixel, where it is not the file format's
};

/// `[board]`: what the cameras are calibrated by.
struct JobBoard {
  base::Board board;              ///< with its prior; the default prior where the job gives none
  std::string family;             ///< of an AprilGrid's tags
  std::string detector = "auto";  ///< "classic", "sb", or "auto": the first, with the second for comparison
};

/// Temperature and expansion of an artefact, as measured.
struct JobThermal {
  double temperature_c = 20.0;
  double temperature_sigma_c = 0.0;
  double cte_per_k = 0.0;
  double cte_sigma_per_k = 0.0;
};

/// `[cross]`: the calibration cross, bolted to the machine.
struct JobCross {
  std::optional<std::filesystem::path> points;   ///< a point list with sigmas; none: the job's own adjustment measures it
  std::optional<std::filesystem::path> spheres;  ///< centres and diameters in the same frame
  std::optional<double> points_temperature_c;    ///< to which `points` and `spheres` refer; none: 20 degrees C
  JobThermal thermal;                            ///< on the machine
  base::Certificate certificate;
};

/// `[machine]`: what the machine's touch probe and X axis say.
struct JobMachine {
  std::optional<std::filesystem::path> probed_spheres;  ///< centres in the machine's frame, or
  std::optional<std::filesystem::path> probe_hits;      ///< the centre of the stylus tip at each hit
  std::optional<double> stylus_diameter_mm;
  std::optional<double> probe_sigma_mm;
  std::optional<double> axis_sigma_mm;
  double temperature_c = 20.0;
  double temperature_sigma_c = 0.0;
  base::Certificate certificate;  ///< of the spheres
};

/// The fringe images of a station.
struct JobScan {
  std::filesystem::path left;  ///< folder of the left camera's images
  std::filesystem::path right;
  std::filesystem::path manifest;
};

/// `[[station]]`: the head at one place of its travel.
struct JobStation {
  std::string name;                                                  ///< also the name of a folder
  double axis_mm = 0.0;                                              ///< the reading of the X axis
  std::vector<std::pair<std::string, std::filesystem::path>> cross;  ///< camera and photograph of the cross, sorted by camera
  std::optional<JobScan> scan;
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
  bool apply_components = false;                  ///< variance_components = "apply": sigmas of each group by their residuals
};

/// `[rig]`: cameras on one mount; the first one's frame is the rig's.
struct JobRig {
  std::string name = "rig";
  std::vector<std::string> cameras;
  std::optional<double>
      baseline_mm;  ///< distance of the first two as a drawing tells it: calibrate refuses what contradicts it
};

/// `[hole]`: what the hole should be.
struct JobHole {
  std::string nominal;                 ///< circle, ellipse, oval, superellipse, or a file with a list of points
  std::string nominal_frame = "part";  ///< of the list, or of centre_mm: part or machine
  std::string unit;                    ///< of the list, where its columns do not say
  bool closed = true;                  ///< of the list
  bool spline = true;                  ///< interpolation = "spline" or "lines"
  std::optional<double> diameter_mm;   ///< of a circle; sizes that are not given are fitted
  std::optional<double> length_mm;     ///< of the others, with width_mm
  std::optional<double> width_mm;
  double exponent = 2.5;                         ///< of a superellipse
  std::optional<Eigen::Vector3d> centre_mm;      ///< on the shell; none: the place is fitted to the measured rim
  std::optional<Eigen::Vector3d> normal;         ///< towards the head; of a prism that is cut into a tower: its direction
  std::optional<Eigen::Vector3d> direction;      ///< of the length
  std::optional<std::filesystem::path> markers;  ///< coordinates of the markers round the hole, where measured
  bool markers_in_part = true;                   ///< markers_frame = "part": in the part's frame; "machine": in the machine's
};

/// `[part]`: the workpiece, and how its place in the machine is found.
struct JobPart {
  std::string position = "none";  ///< none (part and machine are one), markers, rps, tower
  /// Markers or RPS points in part, with `axes` of those that lock single axes. position = "markers" without them: [hole] markers in part,
  /// to which stitch has tied the stations.
  std::optional<std::filesystem::path> points;
  std::optional<std::filesystem::path> measured;   ///< the same in machine, with sigmas
  std::optional<Eigen::Vector3d> axis_point_mm;    ///< of the tower, in part
  std::optional<Eigen::Vector3d> axis_direction;   ///< to where a cone widens
  std::optional<Eigen::Vector3d> axis_in_machine;  ///< about where axis_direction points to in machine
  std::optional<double> radius_mm;                 ///< of the shell at axis_point_mm, across the axis
  double half_angle_rad = 0.0;                     ///< 0: a cylinder
  bool seen_from_inside = false;                   ///< the head is inside of the tower
};

/// `[path]`: the way of the torch.
struct JobPath {
  double step_mm = 2.0;
  double cutoff_mm = 10.0;
  double tilt_cutoff_mm = 60.0;
  double max_correction_mm = 10.0;
  double max_slope = 0.1;
  double max_gap_mm = 50.0;
  double blend_mm = 10.0;
  bool counter_clockwise = true;  ///< direction = "ccw" or "cw", as seen from the head
  double start_mm = 0.0;
  double bevel_rad = 0.0;
  double lead_rad = 0.0;
  double standoff_mm = 0.0;
  double offset_mm = 0.0;
  double speed_mm_per_s = 10.0;
  std::optional<double> max_turn_rad_per_s;
  std::optional<Eigen::Vector3d> reach_low_mm;  ///< the machine's volume, with reach_high_mm
  std::optional<Eigen::Vector3d> reach_high_mm;
  double retract_mm = 50.0;
  std::optional<std::filesystem::path> gcode_template;
  double arc_tolerance_mm = 0.0;  ///< 0: straight moves alone
};

/// `[limits]`: what makes a verdict fail. Those that are not set are not judged.
struct JobLimits {
  double sigma0_px = 0.1;     ///< of one image coordinate; circular targets are measured far better than a tenth of a pixel
  double scale_bar_w = 3.29;  ///< standardised deviation of a scale bar; 0.1 % two-sided of a normal distribution
  double control_w = 3.29;    ///< the same of a control point
  double heldout_rms_px =
      0.2;  ///< of board corners held out, per point: public boards reach 0.02 to 0.05 px, with corners of other programs up to 0.17
  double halves_ratio = 2.0;      ///< what odd and even views differ by, over its prediction (mrcal's cross-validation)
  double area_not_covered = 0.3;  ///< share of the image's inner cells without board corners; a WARNING, never a FAIL
  double prior_ratio = 2.0;       ///< what the board's shape deviates by, over its prior
  double sphere_w = 3.29;         ///< standardised residual of a reference sphere; 0.1 % two-sided
  double rig_change_w = 3.76;     ///< change of the rig since calibrate over its sigma; 0.1 % two-sided of the largest of six
  std::optional<double> epipolar_px;  ///< of a scan: rms distance from the epipolar curves; nothing: off_curve_limit_px()
  double seam_mm = 0.1;               ///< step where two scans overlap: the accuracy that is asked of the hole's edge
  double calibration_change =
      3.0;  ///< rms of the standardised change of the head by stitch: never reached by a calibration that holds
  double off_axis_w = 3.29;          ///< standardised distance of a station from the commissioned axis; 0.1 % two-sided
  std::optional<double> frame_u_mm;  ///< U of a point of the working volume by the machine's frame alone, worst direction
  std::optional<double> baseline_sigma_mm;
  std::optional<double> point_sigma_mm;    ///< largest sigma of a coordinate
  std::optional<double> deviation_rms_mm;  ///< 3D, against the reference
  std::optional<double> deviation_max_mm;
  double surface_tolerance_mm = 0.3;      ///< whose share of a cloud's points is told; a choice, no standard names one
  std::optional<double> surface_p95_mm;   ///< 95 % of a cloud's |deviations| are below
  std::optional<double> edge_rms_mm;      ///< of a hole's rim against its reference
  std::optional<double> length_mpe_a_mm;  ///< maximum permissible length error A + L / K (VDI/VDE 2634-1)
  std::optional<double> length_mpe_k;     ///< mm of length per mm of error
};

/// A job folder's job.toml (docs/formats.md). Paths in it are relative to the folder.
struct Job {
  std::filesystem::path file;
  std::filesystem::path folder;
  std::string name;
  std::optional<std::chrono::year_month_day> date;  ///< of the measurement: certificates are held against it
  std::string family;
  std::optional<double> dot_diameter_mm;
  double marker_thickness_mm = 0.0;  ///< of markers on a wall, with what holds them: from the wall to the plane of the dots
  IdRanges ids;
  IdRanges exclude_ids;
  std::map<std::string, JobCamera> cameras;
  std::optional<JobRig> rig;
  std::optional<JobBoard> board;
  std::optional<JobNetwork> network;
  std::optional<JobCross> cross;
  std::optional<JobMachine> machine;
  std::vector<JobStation> stations;  ///< by the reading of the axis
  std::optional<JobHole> hole;
  JobPart part;
  JobPath path;
  std::optional<std::filesystem::path> reference_points;
  std::optional<std::filesystem::path> reference_surface;  ///< a cloud or mesh (PLY)
  std::string surface_frame = "machine";                   ///< its frame: machine or part
  bool surface_best_fit = false;                           ///< the cloud is first laid onto it
  std::string reference_unit;                              ///< empty: the file says
  JobLimits limits;

  /// The cameras that the board calibrates: of a rig in its order, else by name.
  [[nodiscard]] std::vector<std::string> board_cameras() const;
  [[nodiscard]] std::filesystem::path resolve(const std::filesystem::path& relative) const;
};

/// Reads a job folder or its job.toml. Unknown keys, wrong types and missing sections are kBadInput Errors with file and line.
base::Result<Job> read_job(const std::filesystem::path& folder_or_file);

}  // namespace crosstie::app
