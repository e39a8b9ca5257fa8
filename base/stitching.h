#pragma once

#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "base/machine.h"
#include "base/pose.h"
#include "base/result.h"

namespace crosstie::base {

/// The shape of the part where it was scanned; its axes name the directions of an alignment.
struct Segment {
  enum class Kind {
    kNone,   ///< no shape that fits: directions are those of the frame, "x", "y", "z", "about x", ...
    kPlane,  ///< "in plane 1", "in plane 2", "normal", and turns about them
    kCylinder,  ///< "axial", "tangential", "radial", "roll" (about the axis), "pitch" (about the tangent), "yaw" (about the radius)
    kCone,      ///< as the cylinder
  };
  Kind kind = Kind::kNone;
  Eigen::Vector3d point_mm = Eigen::Vector3d::Zero();    ///< on the axis, or in the plane
  Eigen::Vector3d direction = Eigen::Vector3d::UnitZ();  ///< of the axis, or the normal
  double radius_mm = 0.0;                                ///< of a cylinder; of a cone at `point_mm`
  double half_angle_rad = 0.0;
  double rms_mm = 0.0;  ///< of the surface round the shape
  bool given = false;   ///< by the job, and not fitted
};

/// "none", "plane", "cylinder", "cone".
[[nodiscard]] std::string_view segment_name(Segment::Kind kind);

/// Parts of one variance that stem from the noise of each source; together 1. Of sources that determine a direction side by side they
/// are the shares of information. A source that does not see a direction may still help by turns that it holds.
struct SourceShares {
  double markers = 0.0;      ///< what the stations saw of the markers
  double reference = 0.0;    ///< the list of their coordinates
  double axis = 0.0;         ///< the commissioned frame, the reading and the stop
  double surface = 0.0;      ///< overlaps
  double calibration = 0.0;  ///< of the head: one block for all stations
};

/// How well a station's place is known in one direction of the segment: of the middle of its cloud, or a turn about it.
struct DirectionKnowledge {
  std::string name;  ///< see Segment::Kind
  bool angle = false;
  double sigma = 0.0;  ///< mm or rad
  SourceShares share = {};
};

/// A station in the common frame.
struct StitchedStation {
  std::string name;
  std::optional<double> axis_mm = {};
  Pose machine_from_rig = {};
  Matrix6d cov = Matrix6d::Zero();
  Eigen::Vector3d centre_mm = Eigen::Vector3d::Zero();                  ///< of what it saw, in machine
  Eigen::Matrix3d directions_in_machine = Eigen::Matrix3d::Identity();  ///< columns: axial, tangential, radial
  std::vector<DirectionKnowledge> directions = {};                      ///< six: the three shifts, then the turns about them
  int markers = 0;                                                      ///< that took part
  long points = 0;                                                      ///< of its cloud
  /// From the commissioned pose to this one, [rad, mm]; with its standardised length. Nothing without an axis.
  std::optional<Vector6d> off_axis = {};
  double off_axis_w = 0.0;
};

/// A place of an overlap: mean difference of the two surfaces there, along their normal.
struct OverlapCell {
  Eigen::Vector3d centre_mm = Eigen::Vector3d::Zero();  ///< in machine
  double difference_mm = 0.0;                           ///< first minus second station
  double sigma_mm = 0.0;                                ///< of that difference, noise alone
};

/// Two stations whose surfaces overlap, after the adjustment.
struct StitchedOverlap {
  int a = 0;  ///< index into Stitching::stations
  int b = 0;
  int matches = 0;                         ///< pairs of surface pieces
  double mean_mm = 0.0;                    ///< mean difference a minus b along the normal
  double sigma_mm = 0.0;                   ///< of that mean before the adjustment, from the independent points that it is worth
  double rms_mm = 0.0;                     ///< robust standard deviation of the pieces' differences
  double normalised = 0.0;                 ///< rms of the cells' differences over their sigmas: near 1 where the surfaces agree
  std::vector<std::string> not_seen = {};  ///< directions that this overlap does not tell and in which it takes no part
  std::vector<OverlapCell> cells = {};
};

/// A marker in the common frame.
struct StitchedMarker {
  int id = 0;
  Eigen::Vector3d xyz_mm = Eigen::Vector3d::Zero();
  Eigen::Matrix3d cov_mm2 = Eigen::Matrix3d::Zero();
  std::vector<int> stations = {};  ///< that saw it and took part
  double max_w = 0.0;              ///< largest standardised residual
  bool in_reference = false;
  Eigen::Vector3d reference_residual_mm = Eigen::Vector3d::Zero();  ///< adjusted minus given, in the list's frame
};

/// What a station saw of a marker, or a place of the list, that did not take part.
struct RejectedSighting {
  int station = -1;  ///< index into Stitching::stations; -1: the list of reference coordinates
  int id = 0;
  std::string reason;
  double distance_mm = 0.0;  ///< from where the others put it
  double w = 0.0;
};

/// How far two stations may drift from each other: sigmas of the second's place as the first sees it.
struct StitchDrift {
  int from = 0;
  int to = 0;
  double distance_mm = 0.0;
  Eigen::Vector3d sigma_mm = Eigen::Vector3d::Zero();  ///< axial, tangential, radial (the segment's directions at the second)
  /// The same if neither the list nor the axis held the stations: what markers and surfaces alone would carry along the strip.
  Eigen::Vector3d free_sigma_mm = Eigen::Vector3d::Zero();
};

/// One matching round of the alignment (ICP).
struct StitchIteration {
  int matches = 0;
  double moved_mm = 0.0;  ///< largest shift of a station's middle or turn times its reach
  double rms_mm = 0.0;    ///< robust, of all differences
};

/// What stitch found.
struct Stitching {
  std::string frame;  ///< "machine", "part" (that of the reference list), or "rig of NAME" (nothing ties it to more)
  std::vector<StitchedStation> stations = {};
  std::vector<StitchedOverlap> overlaps = {};
  std::vector<StitchedMarker> markers = {};
  std::vector<RejectedSighting> rejected = {};
  Segment segment = {};
  std::vector<StitchDrift> drift = {};
  std::vector<StitchIteration> iterations = {};  ///< of the matching loop (ICP)
  /// Where the list of markers lies, when it has a frame of its own beside the machine's.
  std::optional<Pose> machine_from_part = {};
  Matrix6d machine_from_part_cov = Matrix6d::Zero();
  /// The head as adjusted here: what its calibration left open and markers, axis and overlaps tell. Nothing without one.
  std::optional<Head> head = {};
  double calibration_shift = 0.0;  ///< standardised length of the change of the head, 1 is expected at most
  double surface_factor = 1.0;     ///< observed over stated sigma of the surface pieces
  double independent_share = 1.0;  ///< of the surface pieces' number: how many independent ones they are worth (N_eff / N)
  double marker_ratio = 0.0;       ///< v'Pv over redundancy of the sightings; near 1 where their sigmas are true
  double reference_ratio = 0.0;    ///< the same of the list
  int observations = 0;
  int unknowns = 0;
  int redundancy = 0;
  std::vector<Warning> warnings = {};
  /// Joint covariance of machine_from_rig of every station [rad, mm] and, where there is a head, of its parameters as Head::cov has
  /// them; `labels` in its order: "station x0850 rx [rad]", "head left fx [px]", ...
  Eigen::MatrixXd covariance = {};
  std::vector<std::string> labels = {};
};

}  // namespace crosstie::base
