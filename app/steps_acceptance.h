#pragma once

#include <filesystem>
#include <vector>

#include "app/session.h"
#include "app/steps.h"
#include "base/result.h"

namespace crosstie::app {

/// An acceptance test of a scanner (docs/formats.md) -> characteristics, verdicts, report.
base::Result<StepOutcome> acceptance_step(const std::filesystem::path& file, const std::filesystem::path& out,
                                          Session& session);

/// Results of one verb on the same thing, folders or their result.json -> scatter against the predicted sigmas: points of adjust, rims of edge,
/// characteristics of verify --acceptance. The limit on the ratio is judged where it is given.
base::Result<StepOutcome> repeat_step(const std::vector<std::filesystem::path>& runs, std::optional<double> ratio_limit,
                                      const std::filesystem::path& out, Session& session);

}  // namespace crosstie::app
