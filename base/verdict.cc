#include "base/verdict.h"

namespace crosstie::base {

std::string_view verdict_level_name(VerdictLevel level) {
  switch (level) {
    case VerdictLevel::kOk:
      return "OK";
    case VerdictLevel::kWarning:
      return "WARNING";
    case VerdictLevel::kFail:
      return "FAIL";
  }
  return "";
}

VerdictLevel judge_upper_limit(double value, double limit, double expanded_uncertainty) {
  // Written so that a value, limit or uncertainty that is not a number never passes.
  if (value + expanded_uncertainty <= limit) return VerdictLevel::kOk;
  if (value - expanded_uncertainty <= limit) return VerdictLevel::kWarning;
  return VerdictLevel::kFail;
}

}  // namespace crosstie::base
