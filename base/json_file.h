#pragma once

#include <filesystem>

#include <nlohmann/json_fwd.hpp>

#include "base/result.h"

namespace crosstie::base {

/// Reads a JSON file; damaged syntax, nesting over 64 levels and files over kMaxFileBytes are Errors with the line.
Result<nlohmann::ordered_json> read_json(const std::filesystem::path& path);

/// Writes indented JSON with a final newline, atomically. Doubles read back exactly; values that are not finite become null.
Result<> write_json(const std::filesystem::path& path, const nlohmann::ordered_json& json);

}  // namespace crosstie::base
