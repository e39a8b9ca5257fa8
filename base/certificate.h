#pragma once

#include <chrono>
#include <optional>
#include <string>
#include <string_view>

#include "base/result.h"

namespace crosstie::base {

/// What the certificate of an artefact (board, bar, cross, sphere) says of itself.
struct Certificate {
  std::string number;                                           ///< empty: none is known
  std::optional<std::chrono::year_month_day> issued = {};       ///< the day of the certificate
  std::optional<std::chrono::year_month_day> valid_until = {};  ///< its last day

  [[nodiscard]] bool known() const { return !number.empty() || issued || valid_until; }
  /// Whether the last day lies before `day`; false where no last day is known.
  [[nodiscard]] bool expired_on(std::chrono::year_month_day day) const { return valid_until && *valid_until < day; }
  /// An Error (kBadInput) where the last day lies before the day of the certificate.
  [[nodiscard]] Result<> validate() const;
};

/// Reads "2026-05-31"; an Error (kBadInput) for anything else, and for days that no calendar has.
[[nodiscard]] Result<std::chrono::year_month_day> parse_date(std::string_view text);
/// "2026-05-31".
[[nodiscard]] std::string format_date(std::chrono::year_month_day day);

}  // namespace crosstie::base
