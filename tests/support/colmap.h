#pragma once

#include <cstdlib>
#include <filesystem>
#include <string>

#include "tests/support/temporary_folder.h"

namespace crosstie::tests {

/// Whether COLMAP's executable is here: tests that ask it skip where it is not.
inline bool has_colmap() { return std::system("command -v colmap >/dev/null 2>&1") == 0; }

/// Runs `colmap <arguments>` with a time-out; its output, or nothing where it failed.
inline std::string run_colmap(const std::string& arguments) {
  const TemporaryFolder folder;
  const std::string out = (folder / "out").string();
  const std::string command = "QT_QPA_PLATFORM=offscreen timeout 60 colmap " + arguments + " >'" + out + "' 2>&1";
  return std::system(command.c_str()) == 0 ? read_all(out) + "\n" : std::string();
}

}  // namespace crosstie::tests
