// ids and ranges of ids, as jobs and options write them

#include <algorithm>

#include <fmt/core.h>

#include "app/job.h"
#include "base/text.h"

namespace crosstie::app {

using base::ErrorCode;
using base::Result;

bool IdRanges::contains(int id) const {
  return std::any_of(ranges.begin(), ranges.end(), [id](const auto& range) { return range.first <= id && id <= range.second; });
}

Result<IdRanges> parse_id_ranges(const std::vector<std::string>& texts) {
  IdRanges ids;
  for (const std::string& text : texts) {
    for (const std::string_view part : base::split(text, ',')) {
      const std::string_view range = base::trim(part);
      const std::size_t dash = range.find('-');
      const auto first = base::parse_int(range.substr(0, dash));
      const auto last = dash == std::string_view::npos ? first : base::parse_int(range.substr(dash + 1));
      if (!first || !last || *first < 0 || *last < *first || *last > 1'000'000) {
        return base::fail(ErrorCode::kBadInput, fmt::format("'{}' is no id and no range of ids such as 0-127", range));
      }
      ids.ranges.emplace_back(static_cast<int>(*first), static_cast<int>(*last));
    }
  }
  return ids;
}

Result<std::pair<int, int>> parse_id_pair(const std::string& text) {
  const auto parts = base::split(text, ',');
  const auto a = base::parse_int(parts.front());
  const auto b = base::parse_int(parts.back());
  if (parts.size() != 2 || !a || !b || *a == *b || *a < 0 || *b < 0 || std::max(*a, *b) > 1'000'000) {
    return base::fail(ErrorCode::kUsage, fmt::format("'{}' is no pair of ids such as 11,52", text));
  }
  return std::pair{static_cast<int>(*a), static_cast<int>(*b)};
}

std::vector<std::string> format_id_ranges(const IdRanges& ids) {
  std::vector<std::string> texts;
  for (const auto& [first, last] : ids.ranges)
    texts.push_back(first == last ? fmt::format("{}", first) : fmt::format("{}-{}", first, last));
  return texts;
}

}  // namespace crosstie::app
