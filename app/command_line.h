#pragma once

#include <string>
#include <vector>

#include "app/verb.h"

namespace crosstie::app {

/// What the command line asks for.
struct Invocation {
  const Verb* verb = nullptr;  ///< null where only text is to be shown
  Arguments arguments;
  bool quiet = false;
  int threads = 0;   ///< 0: as many as the machine has
  std::string text;  ///< help or version, for stdout
};

/// Parses the words after the program's name; a kUsage Error says what is wrong and how to get help. Beside the verbs there is
/// `help [VERB]` and, for those who install the program, `help --man [VERB]`, `help --bash-completion` and `help --verbs`.
base::Result<Invocation> parse_command_line(const std::vector<std::string>& words, const std::vector<Verb>& verbs);

}  // namespace crosstie::app
