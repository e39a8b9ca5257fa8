#include "app/certificates.h"

#include <fmt/core.h>

namespace crosstie::app {

void check_certificate(const base::Certificate& certificate, std::string_view what,
                       const std::optional<std::chrono::year_month_day>& date, std::vector<base::Warning>& warnings) {
  if (!certificate.issued && !certificate.valid_until) return;
  const std::string name = fmt::format("{}{}{}", what, certificate.number.empty() ? "" : ", certificate ", certificate.number);
  const auto warn = [&](const char* code, std::string message) {
    warnings.push_back({code, std::string(what), std::move(message)});
  };
  if (!date) {
    return warn(
        "certificate_not_checked",
        fmt::format("{}: nobody can tell whether it was valid, since the job names no day of the measurement; add date = "
                    "\"YYYY-MM-DD\"",
                    name));
  }
  if (certificate.expired_on(*date)) {
    warn("certificate_expired", fmt::format("{}: it ended on {}, the measurement is of {}; have it calibrated again", name,
                                            base::format_date(*certificate.valid_until), base::format_date(*date)));
  }
  if (certificate.issued && *date < *certificate.issued) {
    warn("certificate_younger", fmt::format("{}: it was issued on {}, after the measurement of {}", name,
                                            base::format_date(*certificate.issued), base::format_date(*date)));
  }
}

}  // namespace crosstie::app
