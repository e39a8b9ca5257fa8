#pragma once

#include <map>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "base/result.h"
#include "math/model.h"
#include "math/normal_equations.h"
#include "registration/detail/overlap.h"
#include "registration/detail/shared.h"
#include "registration/detail/start.h"
#include "registration/stitch.h"

namespace crosstie::registration::detail {

/// Where a group of observations comes from.
enum class Source { kMarkers, kReference, kAxis, kSurface, kFrame, kCalibration };

/// Present values of all unknowns.
struct StitchState {
  std::vector<base::Pose> machine_from_rig;
  std::optional<base::Pose> machine_from_part;
  Eigen::VectorXd shared;                  ///< z of SharedModes
  std::map<int, Eigen::Vector3d> markers;  ///< by id
  bool datum_is_first = false;
};

/// The adjustment as it stands: what takes part, and the overlaps as they are matched.
struct StitchWork {
  const StitchInput& input;
  const StitchOptions& options;
  std::optional<SharedModes> modes = {};
  StitchState state = {};
  std::vector<std::vector<bool>> active = {};  ///< of each station's sightings
  std::vector<bool> listed = {};               ///< of each point of the list
  std::vector<base::RejectedSighting> rejected = {};
  base::Segment segment = {};
  std::vector<Overlap> overlaps = {};
  OverlapScale scale = {};
  int rounds = 0;  ///< of matching
  std::vector<Eigen::MatrixXf> piece_by_shared =
      {};  ///< of each station: three columns for each piece, derivatives by z; empty: not computed

  [[nodiscard]] int shared_size() const { return modes ? modes->size() : 0; }
};

/// One group of rows: where it is from and which observation it is.
struct StitchGroup {
  Source source = Source::kMarkers;
  int station = -1;  ///< of a sighting or a stop
  int index = -1;  ///< of the sighting in its station, of the point in the list where it has a group of its own, of the overlap
};

struct StitchModel {
  math::Model model;
  std::vector<StitchGroup> groups;  ///< one for each measurement
  std::vector<int> poses;           ///< block of each station
  int part = -1;
  int shared = -1;
  std::map<int, int> points;             ///< block by id
  std::vector<int> listed_in_one_group;  ///< indices into the list, where its covariance joins them
  Eigen::MatrixXd listed_whitening;      ///< of that group
};

/// Blocks and measurements at the present state. kBadInput for covariances that are none.
base::Result<StitchModel> build_model(const StitchWork& work);

/// The model's values back into the state.
void read_back(const StitchModel& model, StitchState& state);

/// Rows of `by_shared` of an overlap: derivative of each match's distance by z.
Eigen::MatrixXd overlap_by_shared(const StitchWork& work, const Overlap& overlap);

/// What an error of rank means: which stations are free, in which directions, and what would hold them.
base::Error explain_free(const StitchWork& work, const StitchModel& model);

}  // namespace crosstie::registration::detail
