#pragma once

#include <filesystem>
#include <functional>
#include <string_view>
#include <vector>

#include "app/steps.h"

namespace crosstie::app {

/// What a step works with.
struct StepRun {
  const Job& job;
  std::filesystem::path results;  ///< of the job: each step has a folder in it
  Session& session;
};

/// One step of a job, from files to files.
struct JobStep {
  std::string_view name;    ///< as people are told, and as `run --to` takes it
  std::string_view folder;  ///< of its result in the job's results
  bool (*wanted)(const Job&);
  /// Steps whose results it reads; they stand before it in the table.
  std::vector<std::string_view> (*needs)(const Job&);
  /// What the job lacks for it, told before anything is computed.
  base::Result<> (*check)(const Job&);
  /// Files of the job that it reads, besides job.toml and the results of other steps.
  base::Result<std::vector<std::filesystem::path>> (*files)(const Job&);
  base::Result<StepOutcome> (*run)(const StepRun&, const std::filesystem::path& out);
  /// Its results where there are several, each in a folder of this name in the step's: the stations' scans. nullptr: one result.
  std::vector<std::string> (*parts)(const Job&) = nullptr;
};

/// All steps in the order of the data flow. A new one is a line of this table.
[[nodiscard]] const std::vector<JobStep>& job_steps();

/// Those that the job asks for, in their order.
[[nodiscard]] std::vector<const JobStep*> steps_of(const Job& job);
/// A step and all that it needs, in their order. kUsage for a name that is no step, kBadInput for one that the
/// job does not ask for.
base::Result<std::vector<const JobStep*>> steps_until(const Job& job, std::string_view name);

/// A result that a job asks for.
struct WantedResult {
  std::string name;              ///< of the step, with the part where there are several: "scan x0500"
  std::filesystem::path folder;  ///< in the job's results
};
[[nodiscard]] std::vector<WantedResult> results_of(const JobStep& step, const Job& job);

/// Hears of each step that was done.
using TellStep = std::function<void(const JobStep&, const StepOutcome&)>;

/// Checks all of the steps, then does one after the other; what has not changed is not computed again. Ends at the first Error.
base::Result<> do_steps(const std::vector<const JobStep*>& steps, const StepRun& run, const TellStep& tell);
/// What a step needs beforehand, without the step itself.
base::Result<> prepare(std::string_view name, const StepRun& run, const TellStep& tell);

}  // namespace crosstie::app
