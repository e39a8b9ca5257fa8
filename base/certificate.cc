#include "base/certificate.h"

#include <algorithm>
#include <cctype>

#include <fmt/format.h>

#include "base/text.h"

namespace crosstie::base {

Result<> Certificate::validate() const {
  if (issued && valid_until && *valid_until < *issued) {
    return fail(ErrorCode::kBadInput, fmt::format("certificate {}: its last day, {}, lies before the day of its issue, {}",
                                                  number, format_date(*valid_until), format_date(*issued)));
  }
  return {};
}

Result<std::chrono::year_month_day> parse_date(std::string_view text) {
  const auto refuse = [&] {
    return fail(ErrorCode::kBadInput,
                fmt::format("\"{}\" is no date; write year-month-day, as in 2026-05-31", text.substr(0, 40)));
  };
  constexpr std::string_view kPattern = "dddd-dd-dd";
  if (text.size() != kPattern.size()) return refuse();
  for (std::size_t i = 0; i < text.size(); ++i) {
    const bool digit = std::isdigit(static_cast<unsigned char>(text[i])) != 0;
    if (digit != (kPattern[i] == 'd') || (!digit && text[i] != '-')) return refuse();
  }
  const auto number = [&](std::size_t first, std::size_t count) { return *parse_int(text.substr(first, count)); };
  const std::chrono::year_month_day day{std::chrono::year(static_cast<int>(number(0, 4))),
                                        std::chrono::month(static_cast<unsigned>(number(5, 2))),
                                        std::chrono::day(static_cast<unsigned>(number(8, 2)))};
  if (!day.ok()) return refuse();
  return day;
}

std::string format_date(std::chrono::year_month_day day) {
  return fmt::format("{:04}-{:02}-{:02}", static_cast<int>(day.year()), static_cast<unsigned>(day.month()),
                     static_cast<unsigned>(day.day()));
}

}  // namespace crosstie::base
