#pragma once

#include <filesystem>

#include "app/job.h"
#include "app/verb.h"
#include "base/result.h"

namespace crosstie::app {

/// Writes index.html into the job's `results`: the overview of all results that the job asks for, with links to their reports. Every verb that
/// puts a result there calls it, so that the page is never older than what it tells of; where it says the same it is left alone.
base::Result<> write_job_index(const Job& job, const std::filesystem::path& results);

/// How a verb ended that put its result into the job's results, after the overview was written anew.
base::Result<Outcome> with_index(const Job& job, base::Result<Outcome> ended);

}  // namespace crosstie::app
