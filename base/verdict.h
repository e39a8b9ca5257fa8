#pragma once

#include <string>
#include <string_view>

namespace crosstie::base {

/// After ISO 14253-1: inside the limit by more than U (k = 2) is OK, within U of it on either side, where neither can be
/// proven, WARNING, outside by more than U FAIL.
enum class VerdictLevel { kOk, kWarning, kFail };

/// "OK", "WARNING", "FAIL".
[[nodiscard]] std::string_view verdict_level_name(VerdictLevel level);

/// A value held against a limit.
struct Verdict {
  std::string name;
  double value = 0.0;
  double limit = 0.0;
  std::string unit;
  std::string source;  ///< where the limit comes from: "job", or the default's origin
  VerdictLevel level = VerdictLevel::kOk;
};

/// The verdict on a value that must not exceed `limit`, with the expanded uncertainty U = `expanded_uncertainty` of the value.
[[nodiscard]] VerdictLevel judge_upper_limit(double value, double limit, double expanded_uncertainty);

}  // namespace crosstie::base
