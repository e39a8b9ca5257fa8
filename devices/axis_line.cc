#include "devices/axis_line.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <optional>
#include <vector>

#include <fmt/format.h>

#include "base/text.h"
#include "devices/detail/shown_line.h"

namespace crosstie::devices {
namespace {

using base::ErrorCode;

constexpr std::string_view kSeparators = " \t\r\n,;=:|<>()[]";
constexpr std::array<std::string_view, 10> kUnits = {"mm", "m", "cm", "um", "nm", "in", "inch", "inches", "ft", "\""};

std::vector<std::string_view> words_of(std::string_view line) {
  std::vector<std::string_view> words;
  while (true) {
    const std::size_t begin = line.find_first_not_of(kSeparators);
    if (begin == std::string_view::npos) return words;
    const std::size_t end = std::min(line.find_first_of(kSeparators, begin), line.size());
    words.push_back(line.substr(begin, end - begin));
    line.remove_prefix(end);
  }
}

bool is_digit(char c) { return c >= '0' && c <= '9'; }

/// `850,04` is 850 and 04 to one reader, 850.04 to another.
bool decimal_comma(std::string_view line, std::string_view number) {
  const auto after = static_cast<std::size_t>(number.data() + number.size() - line.data());
  return after + 1 < line.size() && line[after] == ',' && is_digit(line[after + 1]) &&
         number.find('.') == std::string_view::npos;
}

/// The words that follow the label, or all of them where there is none; nothing where the label is missing.
std::optional<std::vector<std::string_view>> words_after(std::vector<std::string_view> words, const std::string& label) {
  if (label.empty()) return words;
  const auto apart = std::find(words.begin(), words.end(), label);
  if (apart != words.end()) return std::vector(apart + 1, words.end());
  const auto attached = std::find_if(words.begin(), words.end(), [&](std::string_view word) {
    return word.starts_with(label) && base::parse_double(word.substr(label.size()));
  });
  if (attached == words.end()) return std::nullopt;
  attached->remove_prefix(label.size());
  return std::vector(attached, words.end());
}

/// Some displays write the sign in a column of its own: `-   12.5`.
double take_sign(std::vector<std::string_view>& words) {
  if (words.size() < 2 || (words[0] != "+" && words[0] != "-") || !(is_digit(words[1][0]) || words[1][0] == '.')) return 1.0;
  const double sign = words[0] == "-" ? -1.0 : 1.0;
  words.erase(words.begin());
  return sign;
}

bool foreign_unit(std::string_view word, const AxisLineFormat& format) {
  return word != format.unit && std::find(kUnits.begin(), kUnits.end(), word) != kUnits.end();
}

}  // namespace

base::Result<> AxisLineFormat::validate() const {
  if (label.find_first_of(kSeparators) != std::string::npos) {
    return base::fail(ErrorCode::kUsage, fmt::format("axis label \"{}\": a label is one word without {}",
                                                     detail::shown_line(label), "blanks, commas, colons, brackets or bars"));
  }
  if (!std::isfinite(mm_per_unit) || mm_per_unit == 0.0 || !std::isfinite(zero_mm)) {
    return base::fail(ErrorCode::kUsage, fmt::format("axis: mm_per_unit = {} must be finite and not 0, zero_mm = {} finite",
                                                     mm_per_unit, zero_mm));
  }
  if (!(min_mm < max_mm)) {
    return base::fail(ErrorCode::kUsage, fmt::format("axis: its travel from {} to {} mm is empty", min_mm, max_mm));
  }
  return {};
}

base::Result<double> parse_axis_line(std::string_view line, const AxisLineFormat& format) {
  const auto refuse = [&](std::string_view why) {
    return base::fail(ErrorCode::kBadInput, fmt::format("\"{}\" is no position: {}", detail::shown_line(line), why));
  };
  if (line.size() > kMaxAxisLineBytes) return refuse("the line is too long");
  auto words = words_after(words_of(line), format.label);
  if (!words) return refuse(fmt::format("it does not say \"{}\"", format.label));
  const double sign = take_sign(*words);
  if (words->empty()) return refuse("there is no number");
  const std::string_view number = words->front();
  const std::optional<double> value = base::parse_double(number);
  if (!value) return refuse("there is no number");
  if (decimal_comma(line, number)) return refuse("a comma may stand for a decimal point or divide two numbers");
  if (words->size() > 1) {
    const std::string_view unit = (*words)[1];
    if (foreign_unit(unit, format)) return refuse(fmt::format("its unit is {}, not {}", unit, format.unit));
    if (format.label.empty() && (unit != format.unit || words->size() > 2)) return refuse("more than one number and its unit");
  }
  const double position_mm = format.zero_mm + format.mm_per_unit * sign * *value;
  if (!(position_mm >= format.min_mm && position_mm <= format.max_mm) || !std::isfinite(position_mm)) {
    return refuse(
        fmt::format("{} mm is outside of the axis's travel from {} to {} mm", position_mm, format.min_mm, format.max_mm));
  }
  return position_mm;
}

}  // namespace crosstie::devices
