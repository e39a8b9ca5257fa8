#pragma once

#include <array>
#include <filesystem>
#include <string>
#include <vector>

#include "app/job.h"
#include "base/result.h"

namespace crosstie::app {

/// A left and a right image that belong together.
using PairOfFiles = std::array<std::filesystem::path, 2>;

/// The job's images of the board, as they lie in its folder.
struct BoardShots {
  std::vector<PairOfFiles> taken = {};  ///< by their text for the asterisk
  PairOfFiles next = {};                ///< where the next pair belongs
};

/// kBadInput where the job has no [board] with images of both of the head's cameras, or their patterns are not a folder and a name with
/// one asterisk.
base::Result<BoardShots> board_shots(const Job& job);

/// What a station of the job wants and has.
struct StationShots {
  std::string name = {};
  double axis_mm = 0.0;  ///< as planned; as read once something was taken
  bool wants_cross = false;
  bool wants_scan = false;
  bool cross_taken = false;  ///< both photographs are there
  bool scan_taken = false;   ///< all images of both cameras are there
  PairOfFiles cross = {};    ///< paths of the photographs
  PairOfFiles scan = {};     ///< folders of the fringe images
  std::filesystem::path manifest = {};
};

/// By the reading of the axis. Errors: kBadInput for a station whose photographs are not of both of the head's cameras, and those of the
/// manifests.
base::Result<std::vector<StationShots>> station_shots(const Job& job);

/// Moves files and folders of a job into `undone/NUMBER/` in it, each under its path in the job, so that nothing that was taken is
/// lost; what is not there is passed over, and empty folders go. Returns the folder. Errors: kFileSystem, kUsage for a path outside of the job.
base::Result<std::filesystem::path> put_aside(const std::filesystem::path& job_folder,
                                              const std::vector<std::filesystem::path>& paths);

}  // namespace crosstie::app
