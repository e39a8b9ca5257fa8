#pragma once

#include <string>
#include <vector>

#include "app/job_steps.h"

namespace crosstie::app {

/// The steps as a Snakefile to be run in the job folder: a rule each, from its files and the steps that it needs to a stamp
/// results/FOLDER.done. A rule calls `crosstie run . --to STEP`, which computes what changed by content; stamps tell a workflow engine the order
/// and what may run at the same time, on any machine that sees the folder. A verdict that FAILs does not stop the others.
base::Result<std::string> snakefile(const Job& job, const std::vector<const JobStep*>& steps);

}  // namespace crosstie::app
