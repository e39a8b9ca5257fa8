#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "base/edge_curve.h"
#include "base/edge_pixels.h"
#include "base/machine.h"
#include "base/pose.h"
#include "base/progress.h"
#include "base/result.h"
#include "base/scan_summary.h"
#include "edge/nominal.h"

namespace crosstie::edge {

/// What one station saw: edges of both images and the depths of the left one.
struct StationView {
  std::string name;
  const base::Head* head = nullptr;
  std::array<const base::EdgePixels*, 2> edges = {};  ///< left, right
  const std::vector<float>* depth_mm = nullptr;  ///< z of each left pixel in the rig's frame, not a number where there is none
  const std::vector<float>* sigma_mm = nullptr;  ///< of it, along the ray, of the cameras' noise
  base::Pose frame_from_rig = {};
  base::Matrix6d frame_from_rig_cov = base::Matrix6d::Zero();
  /// How far the cameras miss each other across the epipolar lines, as the scan saw it. Empty: not known, a rim tells it by itself.
  std::vector<base::HeadTest::Place> off_curve = {};
};

/// What the stations share where it is known together, as stitch leaves it.
struct SharedKnowledge {
  /// Joint covariance of frame_from_rig of every station [rad, mm], in their order, then of the head's parameters as Head::cov has them;
  /// it takes the place of StationView::frame_from_rig_cov and Head::cov, and all stations have the same head. Empty: those, independent.
  Eigen::MatrixXd cov = {};
  /// By what the head's parameters were adjusted since the depths were computed with StationView::head, as Head::cov counts them; the
  /// rim's points follow to first order. Empty: they were not.
  Eigen::VectorXd head_change = {};
};

/// Where the surface is hidden: a marker (to 3.6 dot radii) or a magnet.
struct MaskedDisc {
  std::string name;
  Eigen::Vector3d centre_mm = Eigen::Vector3d::Zero();  ///< in the frame
  double radius_mm = 0.0;
};

/// Where the rim should be, as far as that is known beforehand.
struct ExpectedRim {
  NominalCurve nominal;
  base::Pose frame_from_hole;
  double reach_mm = 0.0;  ///< edges farther from it belong to something else
};

struct HoleEdgeOptions {
  /// Part of the left image in which the hole lies: u0, v0, u1, v1 [px]; nothing: all of it. With several stations in each.
  std::optional<std::array<double, 4>> roi_px = {};
  /// Part of the rim by its angle in the left image about the middle of roi_px: from +x (right) to +y (down), from, to [rad]. Nothing: all.
  std::optional<std::array<double, 2>> arc_rad = {};
  /// Along the rim, of one point of the curve. 0: the piece of edge that tells one edge pixel, so that points do not share pixels.
  double cell_mm = 0.0;
  /// How far to the material side the surface is fitted [px], and from which distance on, so that no pixel sees the edge.
  double surface_reach_px = 25.0;
  double surface_guard_px = 2.5;
  /// How far it is fitted for the normal alone, whose slope across the rim a narrow strip hardly tells. Over much more than this a wall of 2 m is no
  /// quadric any more, and a plate that the heat bends none at all. Never more than 60 px.
  double normal_reach_mm = 60.0;
  /// Edge pixels on a surface that lies farther than this from the face about the hole belong to something else: ledges, the far rim.
  double max_off_face_mm = 3.0;
  double max_turn_rad = 0.5;  ///< of an edge pixel's surface against the face: the cut face beyond the rim stands upright on it
  double max_w =
      3.29;  ///< standardised distance from the neighbours, or of the cameras from each other, from which on a point goes
  double min_gap_cells = 2.5;  ///< a longer way without a point is a gap
  std::vector<MaskedDisc> masks = {};
  std::optional<ExpectedRim> expected = {};

  [[nodiscard]] base::Result<> validate() const;
};

/// How a point of the curve came about.
struct RimPoint {
  std::array<int, 2> pixels = {};       ///< edge pixels of the left and right cameras
  std::array<double, 2> off_mm = {};    ///< of each camera's mean from the point, in the surface across the rim (u)
  std::array<double, 2> sigma_mm = {};  ///< of that, its own part
  double band_mm = 0.0;                 ///< mean extent of a chamfer or lip beside the edge
  double off_neighbours_mm = 0.0;       ///< from the smooth line through its neighbours
};

struct HoleEdge {
  base::EdgeCurve curve;
  std::vector<RimPoint> points;  ///< one for each of the curve's
  /// What became of the edge pixels that lie in the part of the image.
  struct Counts {
    std::int64_t used = 0;
    std::int64_t shadow = 0;      ///< not material; paint is not counted at all
    std::int64_t elsewhere = 0;   ///< not where the rim is expected
    std::int64_t no_surface = 0;  ///< too few depths on the material side
    std::int64_t off_face = 0;    ///< on another surface: ledge, far rim, cut face
    std::int64_t inwards = 0;     ///< material on the wrong side: outer contours
    std::int64_t masked = 0;
    std::int64_t stray = 0;  ///< off the line of their neighbours
    std::int64_t inner =
        0;  ///< the far side of a chamfer, lip or thick wall, whose near side the same camera or neighbours show
  } counts;
  /// Scatter of the points about the smooth line through their neighbours over what their sigmas say: the rim's own roughness shows here.
  /// Sigmas across the rim were multiplied by it where above 1.
  double roughness_factor = 1.0;
  std::vector<base::Warning> warnings;
};

/// Edge pixels of both cameras and all stations -> the rim of a hole as one curve.
///
/// Each material edge's viewing ray meets the surface fitted to the depths on its material side (a plane, with a curvature across the edge where
/// significant; robust). What lies on another surface than the face about the hole goes: ledges and the far rim by their distance, the cut
/// face by its direction. The rest is ordered by the angle about its middle in the face's plane (the rim must be seen whole from there: convex
/// ones are), and gathered into cells along the rim. In a cell, each camera's positions become one (pixels of one piece of edge are one
/// measurement), cameras and stations are fused by their sigmas, after those went that contradict their neighbours' smooth line. Its normal
/// is that of a wider surface, fitted once for each station that saw it.
/// Of a chamfer that is not seen everywhere from both sides one side is the rim (detail/chamfer_side.h). Where the cameras of a station see the rim
/// apart across the epipolar lines, they are met half way by what the scan's texture tells, else by the rim itself, the other half is a shared part, and a warning `cameras_miss` says so
/// (detail/camera_miss.h). Edges that were classed as paint count where the surface's depths do not go on beyond them.
/// Covariance: across the rim of the images and of the surface's slope, along the normal of the surface's fit; what calibration and poses
/// add is shared by all points of a station and stands in EdgeCurve::shared_mm.
/// Errors: options; kInternal for a `shared` of another size; kNoUniqueSolution where no rim is found, with what became of the edge pixels.
base::Result<HoleEdge> find_hole_edge(std::span<const StationView> stations, const HoleEdgeOptions& options,
                                      const SharedKnowledge& shared = {}, const base::Progress& progress = {});

}  // namespace crosstie::edge
