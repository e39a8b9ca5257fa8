#pragma once

#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "base/machine.h"
#include "base/network.h"
#include "base/progress.h"
#include "base/result.h"
#include "base/stitching.h"
#include "registration/surface.h"

namespace crosstie::registration {

/// A marker as one station saw it.
struct Sighting {
  int id = 0;
  Eigen::Vector3d p_in_rig_mm = Eigen::Vector3d::Zero();
  Eigen::Matrix3d cov_mm2 = Eigen::Matrix3d::Zero();  ///< of the cameras' noise alone
};

/// What the head saw from one place.
struct StationScan {
  std::string name;
  std::optional<double> axis_mm = {};  ///< reading of the axis; asked for where there is a commissioned head
  std::vector<Sighting> markers = {};
  std::optional<Surface> surface = {};
  std::optional<base::Pose> start = {};  ///< about where it is in the common frame, where no axis and no markers tell
};

/// Coordinates of the markers as somebody measured them.
struct MarkerReference {
  base::ControlGroup points;
  /// True: they are in a frame of their own, which lies somewhere in the machine; false: in the frame of the result.
  bool own_frame = false;
};

/// The head and the machine's frame as commission left them, known together. Without a frame (its covariance is empty) it is a calibrated
/// head that nothing ties to the machine; stations then bring no reading of an axis.
struct CommissionedHead {
  base::Head head;
  base::MachineFrame frame;
  /// Of the head's parameters (as Head::cov has them), then of the frame's (as MachineFrame::cov has them).
  Eigen::MatrixXd cov;

  /// Takes both with their correlations out of a commissioning. kBadInput where its covariance does not hold them.
  static base::Result<CommissionedHead> of(const base::Commissioning& commissioning);
  /// A head that nothing ties to the machine.
  static CommissionedHead calibrated(const base::Head& head);
};

struct StitchInput {
  std::vector<StationScan> stations;
  std::optional<MarkerReference> reference = {};
  std::optional<CommissionedHead> commissioned = {};
  std::optional<base::Segment> segment = {};  ///< nothing: fitted to the surfaces
};

struct StitchOptions {
  int max_iterations = 20;       ///< of the matching loop (ICP); then the pairs are held
  double converged_mm = 5e-4;    ///< largest move of a station at which the matching loop ends
  double max_normal_rad = 0.35;  ///< angle between the normals of two pieces that may be matched: 20 degrees
  /// Distance of a piece from its partner in the first round. Nothing: 0.8 cells, or three times what the start is known to.
  std::optional<double> start_reach_mm = {};
  int least_matches = 30;  ///< of an overlap: fewer pieces say too little of six motions
  /// Share of a motion that the surface must see, mean squared shift along its normals over mean squared shift: below, the overlap
  /// takes no part in that direction. 1e-3: slopes below 1.8 degrees, where errors of form pull more than the noise allows.
  double least_seen = 1e-3;
  /// Level at which a marker's place is rejected, before it is divided by their number (Bonferroni).
  double rejection_significance = 0.01;
  double marker_tolerance_mm = 0.5;  ///< beside five sigmas: how far markers of two stations may disagree in the start
  int threads = 0;                   ///< 0: as many as the machine has; no effect on the outcome

  /// kUsage where a value is out of its range.
  [[nodiscard]] base::Result<> validate() const;
};

/// Brings all stations (or one, where an axis or a list of markers ties it) into one frame by one least-squares problem: docs/formulation.md, "One frame for all stations".
///
/// Unknown are the pose of every station, the place of every marker, the commissioned head and frame (prior: their joint covariance; one
/// block for all stations, so that it never averages down), and where the list of markers has a frame of its own, its place. Observed are
/// the markers (3D in the rig, with the cameras' noise), their list, the stops on the axis, and where surfaces overlap the distance of
/// their pieces along the mean of both normals (symmetric point-to-plane: Rusinkiewicz, ACM TOG 38(4), 2019). Surfaces are weighted with
/// robust weights and with the number of independent pieces that they are worth; a motion that an overlap does not see gets nothing from
/// it, so that a cylinder cannot slide. Partners are sought anew in each round: this outer loop is ICP (iterative closest point).
///
/// Start: the axis, or a chain of weighted rigid fits of common markers, each by consensus. Markers with swapped or misread ids, and
/// such as moved, are named and left out; later ones are found by their standardised residuals (Baarda's w).
///
/// Errors: kBadInput for names or scans that come twice, markers of two stations that do not agree; kNoUniqueSolution where something
/// leaves a station free: which one, and in which directions of the segment; kUsage, kCancelled.
base::Result<base::Stitching> stitch(const StitchInput& input, const StitchOptions& options = {},
                                     const base::Progress& progress = {});

}  // namespace crosstie::registration
