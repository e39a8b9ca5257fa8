#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "app/result_folder.h"
#include "app/session.h"
#include "app/verb.h"
#include "base/result.h"
#include "base/result_document.h"

namespace crosstie::app {

/// Path relative to `folder`, with forward slashes, and the file's hash.
base::Result<base::ResultInput> hashed_input(const std::filesystem::path& path, const std::filesystem::path& folder);

/// The same of each of them, in their order: that is their roles.
base::Result<std::vector<base::ResultInput>> hashed_inputs(const std::vector<std::filesystem::path>& paths,
                                                           const std::filesystem::path& folder);

/// The result of a verb as it stands in a folder, where it was made by this version with these options; null otherwise (also
/// where it is missing or damaged: then it is computed again). What a killed process left beside the folder is removed.
nlohmann::ordered_json earlier_result(const std::filesystem::path& folder, const nlohmann::ordered_json& options);

/// kVerdictFailed where a verdict of the result is a FAIL.
Outcome outcome_of(const nlohmann::ordered_json& result);

/// Whether a result was computed from exactly these inputs, in their order: files that change places, left and right or measured and
/// reference, are other inputs.
bool same_inputs(const nlohmann::ordered_json& result, const std::vector<base::ResultInput>& inputs);

/// From a report in this folder to the overview of its job, as a relative address: "../index.html"; empty where the folder does not stand
/// in the results of a job, nor in those that the session writes of one.
std::string overview_of(const std::filesystem::path& out, const Session& session);

/// Writes report.html and result.json into a folder in the making and puts it in its place.
base::Result<> publish(ResultFolder& folder, const std::string& html, const nlohmann::ordered_json& result);

}  // namespace crosstie::app
