#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "base/phase_map.h"
#include "base/result.h"

namespace crosstie::base {

/// What one camera contributed to a scan.
struct ScannedCamera {
  std::string name;
  std::array<std::int64_t, kPhaseStatusCount> counts = {};  ///< pixels by PhaseStatus
  GreyNoise noise;
  bool noise_given = false;
  double light = 0.0;            ///< median mean level of the lit pixels [grey levels]
  double modulation = 0.0;       ///< median B of the lit pixels [grey levels]
  double sigma_phase_rad = 0.0;  ///< median of the finest fringes
  double residual_ratio = 0.0;   ///< see PhaseMap
  double ripple_rad = 0.0;       ///< taken out
  double word_agreement = 1.0;   ///< of the Gray code with the fringes; 1 without a Gray code
  std::int64_t repaired = 0;     ///< pixels whose fringe the neighbours told
  Stillness stillness;
};

/// A marker that both cameras of a scan read.
struct ScannedMarker {
  int id = 0;
  Eigen::Vector3d p_in_rig_mm = Eigen::Vector3d::Zero();          ///< middle of its dot
  Eigen::Matrix3d cov_mm2 = Eigen::Matrix3d::Zero();              ///< of the noise in both images
  Eigen::Matrix3d calibration_cov_mm2 = Eigen::Matrix3d::Zero();  ///< of the head's calibration; zero where that is unknown
  double off_curve_px = 0.0;              ///< of the right observation from the left one's epipolar curve
  double off_curve_sigma_px = 0.0;        ///< of the noise in both images
  double off_curve_calibration_px = 0.0;  ///< 1 sigma of the calibration
  /// Of the wall beneath, towards the cameras; zero where the cloud does not show it round the marker, and then all that follows is, too.
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();
  Eigen::Vector3d wall_in_rig_mm = Eigen::Vector3d::Zero();  ///< the centre moved onto the wall by the marker's thickness
  double height_mm = 0.0;                                    ///< of the dot over the wall as the cloud shows it
  double height_sigma_mm = 0.0;                              ///< of the noise of both

  [[nodiscard]] bool on_wall() const { return normal.squaredNorm() > 0.0; }
};

/// What a scan says of the calibration of its head: how far places that both cameras see lie off the epipolar curves.
struct HeadTest {
  std::string source;        ///< "phases", "texture", "markers"; empty: nothing in this scan tells it
  std::int64_t samples = 0;  ///< parts of the image, or markers
  double off_px = 0.0;       ///< rms of the distances, of what is not noise
  double sigma_px = 0.0;     ///< of that rms
  /// The right camera against the left one, each term alone explaining the distances.
  struct Term {
    std::string name;  ///< "pitch", "yaw", "roll" of the right camera about its x, y, z; "baseline up", "baseline forward"
    double value_rad = 0.0;
    double sigma_rad = 0.0;
    double calibration_rad = 0.0;  ///< 1 sigma that the head's calibration leaves of it; 0 where that is unknown
    double off_px = 0.0;           ///< rms of the distances that it makes
    double explained = 0.0;        ///< share of the sum of squares, 0..1
  };
  std::vector<Term> terms;
  /// A place of the left image whose image in the right one lies this far off its epipolar curve, positive downwards in rectified images.
  struct Place {
    Eigen::Vector2d left_px = Eigen::Vector2d::Zero();
    double off_px = 0.0;
    double sigma_px = 0.0;
  };
  std::vector<Place> places;  ///< those samples that were counted

  [[nodiscard]] bool done() const { return !source.empty(); }
};

/// The edges of one camera's image, by class (base/edge_pixels.h).
struct ScannedEdges {
  std::int64_t material = 0;
  std::int64_t shadow = 0;
  std::int64_t paint = 0;
  double blur_px = 0.0;   ///< sigma of the point spread, as found
  double piece_px = 0.0;  ///< length of the piece of edge that tells one position
  double sigma_px = 0.0;  ///< median, across material edges
};

/// What a scan of one station found, without its points.
struct ScanSummary {
  std::string name;  ///< of the station; may be empty
  int width = 0;     ///< of the left image
  int height = 0;
  bool both_axes = false;
  std::array<ScannedCamera, 2> cameras;
  std::array<ScannedEdges, 2> edges;
  std::int64_t points = 0;
  std::int64_t guarded = 0;    ///< pixels beside the end of a surface
  std::int64_t unmatched = 0;  ///< pixels that the other camera does not see
  std::int64_t off_curve = 0;  ///< pixels whose two phases meet off the epipolar curve
  std::int64_t grazing = 0;
  std::int64_t off_surface = 0;
  bool markers_wanted = false;
  std::array<std::int64_t, 2> markers_read = {};  ///< in each camera's image
  std::int64_t on_markers = 0;                    ///< points left out
  double marker_thickness_mm = 0.0;
  std::vector<ScannedMarker> markers;        ///< by id
  double sigma_mm = 0.0;                     ///< median along the viewing ray, noise alone
  double sigma_p95_mm = 0.0;                 ///< below which 95 % of them lie
  std::optional<double> calibration_mm;      ///< median of the calibration's part; nothing where its covariance is unknown
  std::optional<double> epipolar_median_px;  ///< signed; nothing with one direction
  HeadTest head_test;
  double epipolar_mad_px = 0.0;  ///< 1.4826 times the median absolute deviation
  double depth_min_mm = 0.0;
  double depth_max_mm = 0.0;
  double correlation_length_mm = 0.0;  ///< of the surface filter; 0 without one
  /// Means over square cells of the left image, row by row from its top; not a number where nothing was measured.
  double cell_px = 0.0;
  Eigen::MatrixXd depth_mm;
  Eigen::MatrixXd sigma_cells_mm;
  std::vector<double> epipolar_px;  ///< a sample, for the histogram
  /// A sample of the points, for the 3D view: x y z in the rig's frame and sigma, mm.
  std::vector<Eigen::Vector4d> sample;
  std::vector<Warning> warnings;
};

}  // namespace crosstie::base
