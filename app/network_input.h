#pragma once

#include <filesystem>

#include "app/job.h"
#include "base/network.h"
#include "base/result.h"
#include "base/result_document.h"

namespace crosstie::app {

/// What the adjustment of a job's network starts from: the observations of `detection` with the cameras, rig, lengths and known
/// points that the job names.
base::Result<base::Network> network_of(const Job& job, const std::filesystem::path& detection);

/// The files that it reads, with their hashes; sorted by path.
base::Result<std::vector<base::ResultInput>> network_inputs(const Job& job, const std::filesystem::path& detection);

}  // namespace crosstie::app
