#pragma once

#include <cstdio>
#include <optional>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "app/command_line.h"
#include "app/verb.h"

namespace crosstie::tests {

/// What a verb answered.
struct VerbAnswer {
  std::optional<base::Error> error;
  std::string out;  ///< what it printed
  app::Outcome outcome = app::Outcome::kOk;
};

/// Runs the verb words[0] as the command line does.
inline VerbAnswer run_verb(const std::vector<std::string>& words) {
  const auto invocation = app::parse_command_line(words, app::verbs());
  if (!invocation) return {invocation.error(), ""};
  app::Session session(true, 1, {});
  testing::internal::CaptureStdout();
  const auto outcome = invocation->verb->run(invocation->arguments, session);
  std::fflush(stdout);
  VerbAnswer answer{std::nullopt, testing::internal::GetCapturedStdout()};
  if (outcome) {
    answer.outcome = *outcome;
  } else {
    answer.error = outcome.error();
  }
  return answer;
}

}  // namespace crosstie::tests
