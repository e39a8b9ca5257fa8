#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "app/job.h"
#include "app/steps.h"

namespace crosstie::app {

/// The hole of a job whose stations were stitched.
struct JobEdgeTask {
  Job job;
  std::filesystem::path stitch;  ///< folder of its result
  std::filesystem::path scans;   ///< each station's result in a folder of its name
  std::string head;              ///< that the scans were made with, see read_head()
};

/// What the job asks for, with its results in `results`. kBadInput where it has no [hole] nominal or nothing was stitched.
base::Result<JobEdgeTask> job_edge_task(const Job& job, const std::filesystem::path& results);

/// Files of the job that it reads, besides the results of other steps.
[[nodiscard]] std::vector<std::filesystem::path> job_edge_files(const Job& job);

/// edge pixels and depths of all stations, their places, the nominal hole -> the hole's edge, the part's place, the torch's path.
base::Result<StepOutcome> job_edge_step(const JobEdgeTask& task, const std::filesystem::path& out, Session& session);

}  // namespace crosstie::app
