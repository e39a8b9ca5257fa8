#pragma once

#include <sys/wait.h>

#include <cstdlib>
#include <string>
#include <vector>

#include "tests/support/bounded.h"
#include "tests/support/temporary_folder.h"

namespace crosstie::tests {

/// What the executable did.
struct ProgramRun {
  int exit_code = -1;
  std::string out;
  std::string err;
};

/// Runs the crosstie executable of this build with the given words; `before` are commands of the shell that starts it.
inline ProgramRun run_program(const std::vector<std::string>& words, const std::string& before = "") {
  const TemporaryFolder folder;
  std::string command = before + "'" CROSSTIE_EXECUTABLE "'";
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

/// The same with a limited address space; it is ended when it takes too long.
inline ProgramRun run_bounded(const std::vector<std::string>& words, const std::string& before = "") {
  const std::string memory = kLimitsMemory ? "ulimit -v " + std::to_string(kMemoryLimit >> 10) + "; " : std::string();
  return run_program(words, memory + before + "timeout " + std::to_string(kTimeLimit_s) + " ");
}

}  // namespace crosstie::tests
