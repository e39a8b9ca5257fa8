#pragma once

#include <sys/wait.h>

#include <cstdlib>
#include <string>
#include <vector>

#include "tests/support/temporary_folder.h"

namespace crosstie::tests {

/// What the executable did.
struct ProgramRun {
  int exit_code = -1;
  std::string out;
  std::string err;
};

/// Runs the crosstie executable of this build with the given words.
inline ProgramRun run_program(const std::vector<std::string>& words) {
  const TemporaryFolder folder;
  std::string command = "'" CROSSTIE_EXECUTABLE "'";
  for (const std::string& word : words) {
    std::string quoted;
    for (const char c : word) quoted += c == '\'' ? std::string("'\\''") : std::string(1, c);
    command += " '" + quoted + "'";
  }
  command += " >'" + (folder / "out").string() + "' 2>'" + (folder / "err").string() + "'";
  const int status = std::system(command.c_str());
  ProgramRun run;
  run.exit_code = WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  run.out = read_all(folder / "out");
  run.err = read_all(folder / "err");
  return run;
}

}  // namespace crosstie::tests
