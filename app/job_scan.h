#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "app/job.h"
#include "app/steps_scan.h"

namespace crosstie::app {

/// A station's scan with the folder of its result.
struct StationScan {
  std::string station;
  ScanTask task;
  std::filesystem::path out;
};

/// The scans of the job's stations, or of `station` alone. The head is `head`, see read_head(); results go to `out`/<station>.
/// kBadInput where no station has a scan, kUsage where the job has no station of that name.
base::Result<std::vector<StationScan>> station_scans(const Job& job, const std::string& head,
                                                     const std::optional<std::string>& station,
                                                     const std::filesystem::path& out);

/// The folder that the head of the job's scans is read from: results/commission where it is there, since the head was adjusted in it,
/// else the calibration.
base::Result<std::filesystem::path> scan_head_folder(const Job& job, const std::filesystem::path& results);

/// The same; the calibration is brought up to date where the job has the images for it.
base::Result<std::filesystem::path> scan_head(const Job& job, const std::filesystem::path& results, Session& session);

/// Hears of each step that was done, with the word that it is told by.
using TellScan = std::function<void(const std::string& what, const StepOutcome&)>;

/// All of it: every station's scan that is out of date is computed again. kVerdictFailed where one of them has a FAIL.
base::Result<Outcome> scan_stations(const std::vector<StationScan>& scans, const TellScan& tell, Session& session);

}  // namespace crosstie::app
