#pragma once

#include <filesystem>

#include "base/result.h"
#include "base/result_document.h"

namespace crosstie::base {

/// What every result says, of whatever verb: verb, frame, inputs, verdicts and warnings, from the result.json in a folder.
/// Errors: kFileSystem, kBadInput with the file where it is no result.
Result<ResultEnvelope> read_envelope(const std::filesystem::path& folder);

}  // namespace crosstie::base
