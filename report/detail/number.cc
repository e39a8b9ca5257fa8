#include "report/detail/number.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include <fmt/format.h>

namespace crosstie::report::detail {
namespace {

constexpr int kMaxDecimals = 9;
constexpr double kMicrometresBelow_mm = 0.1;
constexpr const char* kNotAvailable = "n/a";

std::vector<double> positive(std::span<const double> values) {
  std::vector<double> result;
  for (const double value : values) {
    if (std::isfinite(value) && value > 0.0) result.push_back(value);
  }
  std::sort(result.begin(), result.end());
  return result;
}

}  // namespace

std::string fixed(double value, int decimals) {
  if (!std::isfinite(value)) return kNotAvailable;
  std::string text = fmt::format("{:.{}f}", value, std::clamp(decimals, 0, 17));
  const bool zero = text.find_first_of("123456789") == std::string::npos;
  if (zero && text.front() == '-') text.erase(0, 1);
  return text;
}

std::string significant(double value, int digits) {
  if (!std::isfinite(value)) return kNotAvailable;
  if (value == 0.0) return "0";
  const double size = std::abs(value);
  if (size < 1e-4 || size >= 1e7) return fmt::format("{:.{}e}", value, digits - 1);
  // The power of ten after rounding: 9.996 to three digits is 10.0, not 10.00.
  const std::string rounded = fmt::format("{:.{}e}", size, digits - 1);
  const int power = std::stoi(rounded.substr(rounded.find('e') + 1));
  return fixed(value, std::max(0, digits - 1 - power));
}

std::string plain(double value, int digits) {
  std::string text = significant(value, digits);
  if (text.find('.') == std::string::npos || text.find('e') != std::string::npos) return text;
  text.erase(text.find_last_not_of('0') + 1);
  if (text.back() == '.') text.pop_back();
  return text;
}

std::string probability(double p) { return p < 1e-4 ? "< 0.0001" : "= " + significant(p, 2); }

std::string counted(long long value) {
  std::string digits = std::to_string(std::abs(value));
  for (auto at = static_cast<std::ptrdiff_t>(digits.size()) - 3; at > 0; at -= 3) {
    digits.insert(static_cast<std::size_t>(at), "\u202f");  // narrow no-break space
  }
  return (value < 0 ? "-" : "") + digits;
}

int decimals_for_sigma(double sigma, int otherwise) {
  if (!std::isfinite(sigma) || sigma <= 0.0) return otherwise;
  const std::string rounded = fmt::format("{:.1e}", sigma);
  return std::clamp(1 - std::stoi(rounded.substr(rounded.find('e') + 1)), 0, kMaxDecimals);
}

int decimals_for_column(std::span<const double> sigmas, int otherwise) {
  const std::vector<double> sorted = positive(sigmas);
  if (sorted.empty()) return otherwise;
  return std::min(decimals_for_sigma(sorted.front()), decimals_for_sigma(sorted[sorted.size() / 2]) + 1);
}

std::string with_sigma(double value, double sigma, std::string_view unit) {
  const std::string suffix = unit.empty() ? "" : fmt::format("\u00a0{}", unit);
  if (!std::isfinite(sigma) || sigma <= 0.0) return significant(value, 4) + suffix;
  const int decimals = decimals_for_sigma(sigma);
  return fmt::format("{}\u00a0\u00b1\u00a0{}{}", fixed(value, decimals), fixed(sigma, decimals), suffix);
}

std::string expanded(double sigma, std::string_view unit) {
  if (!std::isfinite(sigma) || sigma <= 0.0) return "";
  return fmt::format("U\u00a0=\u00a0{}{}{}", fixed(2.0 * sigma, decimals_for_sigma(2.0 * sigma)), unit.empty() ? "" : "\u00a0",
                     unit);
}

LengthUnit unit_for_lengths(std::span<const double> lengths_mm) {
  const std::vector<double> sorted = positive(lengths_mm);
  if (sorted.empty() || sorted[sorted.size() / 2] >= kMicrometresBelow_mm) return {1.0, "mm"};
  return {1000.0, "\u00b5m"};
}

double median(std::span<const double> values) {
  std::vector<double> sorted(values.begin(), values.end());
  std::erase_if(sorted, [](double value) { return !std::isfinite(value); });
  if (sorted.empty()) return 0.0;
  std::sort(sorted.begin(), sorted.end());
  return sorted[sorted.size() / 2];
}

}  // namespace crosstie::report::detail
