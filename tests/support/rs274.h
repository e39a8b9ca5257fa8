#pragma once

#include <cstdlib>
#include <sstream>
#include <string>
#include <vector>

#include "base/text.h"
#include "tests/support/temporary_folder.h"

namespace crosstie::tests {

/// Whether LinuxCNC's stand-alone interpreter is here (Debian: linuxcnc-uspace): tests that ask it skip where it is not.
inline bool has_rs274() { return std::system("command -v rs274 >/dev/null 2>&1") == 0; }

/// A command of the canonical machine: "STRAIGHT_FEED" and its numbers.
struct CanonicalCommand {
  std::string name;
  std::vector<double> numbers;
  std::string text;
};

/// What the interpreter makes of a program; `error` holds what it says against it, with its last line.
struct Interpreted {
  std::vector<CanonicalCommand> commands;
  std::string error;
};

inline Interpreted run_rs274(const std::string& program) {
  const TemporaryFolder folder;
  folder.write("program.ngc", program);
  const std::string out = (folder / "out").string();
  const std::string err = (folder / "err").string();
  const std::string command =
      "cd '" + folder.path().string() + "' && timeout 60 rs274 -g program.ngc >'" + out + "' 2>'" + err + "' </dev/null";
  Interpreted result;
  if (std::system(command.c_str()) != 0) result.error = read_all(err) + read_all(out);
  std::istringstream lines(read_all(out));
  for (std::string line; std::getline(lines, line);) {
    const auto open = line.find('(');
    const auto close = line.rfind(')');
    const auto dots = line.find("N.....");
    if (open == std::string::npos || close == std::string::npos || dots == std::string::npos) continue;
    CanonicalCommand one;
    one.name = std::string(base::trim(line.substr(dots + 6, open - dots - 6)));
    one.text = line.substr(open + 1, close - open - 1);
    for (const auto cell : base::split(one.text, ',')) {
      if (const auto number = base::parse_double(cell)) one.numbers.push_back(*number);
    }
    result.commands.push_back(std::move(one));
  }
  return result;
}

}  // namespace crosstie::tests
