#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "base/progress.h"
#include "base/result.h"

namespace crosstie::app {

/// The program that prints pages: `wanted` where given, else the first of Chromium, Chrome and Edge on PATH. kFileSystem where there is
/// none.
base::Result<std::filesystem::path> find_browser(const std::optional<std::string>& wanted);

/// Prints a page as PDF with a browser that shows no window and has a profile of its own, which goes afterwards. Replaces `out` in
/// one step. kFileSystem where the browser cannot be started, does not end within five minutes or makes no PDF.
base::Result<> print_as_pdf(const std::string& html, const std::filesystem::path& out, const std::filesystem::path& browser,
                            const base::Progress& progress);

}  // namespace crosstie::app
