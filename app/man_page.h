#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "app/verb.h"

namespace crosstie::app {

/// What the program's exit codes mean, for its man pages.
struct ExitStatus {
  int code = 0;
  std::string_view meaning;
};
[[nodiscard]] const std::vector<ExitStatus>& exit_statuses();

/// crosstie(1), the page that lists the verbs, in the man(7) language.
[[nodiscard]] std::string man_page(const std::vector<Verb>& verbs);

/// crosstie-VERB(1): the text of `crosstie VERB --help` and of docs/cli.md.
[[nodiscard]] std::string man_page(const Verb& verb);

}  // namespace crosstie::app
