// crosstie targets: the codes of a marker family

#include <fmt/core.h>

#include "app/verb.h"
#include "markers/family.h"

namespace crosstie::app {
namespace {

using base::Result;

Result<Outcome> run(const Arguments& arguments, Session& session) {
  const auto family = markers::marker_family(*arguments.get("--family"));
  if (!family) return tl::unexpected(family.error());
  if (!arguments.has("--list")) return base::fail(base::ErrorCode::kUsage, "targets: say what is wanted, --list");
  std::string lines;
  for (const auto& code : family->codes) lines += fmt::format("{} {}\n", code.id, code.code);
  if (!lines.empty()) lines.pop_back();
  session.print(lines);
  return Outcome::kOk;
}

}  // namespace

Verb targets_verb() {
  return {"targets",
          "list the codes of a marker family",
          "  $ crosstie targets --family aicon14 --list | head -n 2\n"
          "  1 129\n"
          "  2 135",
          {{"--family", "FAMILY", "marker family: ring10, aicon14, ...", true, false},
           {"--list", "", "one id and its code (decimal; first segment = most significant bit) a line", false, false}},
          run};
}

}  // namespace crosstie::app
