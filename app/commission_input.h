#pragma once

#include <filesystem>
#include <vector>

#include "app/job.h"
#include "base/result.h"
#include "base/result_document.h"
#include "bundle/commission.h"

namespace crosstie::app {

/// The results of earlier steps that a commissioning reads.
struct CommissionSources {
  std::filesystem::path calibration;  ///< folder of calibrate, where the cameras have no model of their own
  std::filesystem::path adjustment;   ///< folder of adjust, where the cross is measured by the job itself
  std::filesystem::path detection;    ///< folder of the stations' detection
};

/// Names of the head's cameras in the job, the left one first: those of [rig], else "left" and "right".
[[nodiscard]] std::pair<std::string, std::string> head_cameras(const Job& job);

/// Whether the head comes from the job's own calibrate.
[[nodiscard]] bool is_calibrated_here(const Job& job);

/// The folder that holds the calibration of both of the head's cameras: `own`, where the job calibrates them, or the one that both of
/// their models name. kBadInput where there is neither.
base::Result<std::filesystem::path> calibration_folder(const Job& job, const std::filesystem::path& own);

/// kBadInput where the job does not say all that a commissioning needs: [cross] with spheres, [machine] with their probing, [[station]]
/// with photographs by the head's cameras. To be asked before the photographs are looked at.
base::Result<> check_commission(const Job& job);

/// What the adjustment starts from.
base::Result<bundle::CommissionInput> commission_input(const Job& job, const CommissionSources& sources,
                                                       std::vector<base::Warning>& warnings);

/// The files that it reads, with their hashes, results of earlier steps by their place in the job; sorted by path.
base::Result<std::vector<base::ResultInput>> commission_inputs(const Job& job, const CommissionSources& sources);

}  // namespace crosstie::app
