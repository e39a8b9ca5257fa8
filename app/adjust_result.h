#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "app/result_folder.h"
#include "app/steps.h"
#include "base/network.h"
#include "base/result_document.h"

namespace crosstie::app {

/// What a result of `adjust` says besides the network itself.
struct AdjustmentRecord {
  const std::string& title;
  std::vector<base::ResultInput> inputs;
  const nlohmann::ordered_json& options;
  JobLimits limits;
  std::string overview;  ///< from the report to the overview of its job (overview_of)
};

/// Judges the network and writes its tables, clouds, cameras, covariance, report and result.json into `folder`, then publishes it as
/// `out`.
base::Result<StepOutcome> write_adjustment(ResultFolder& folder, const std::filesystem::path& out,
                                           const base::AdjustedNetwork& adjusted, AdjustmentRecord record);

}  // namespace crosstie::app
