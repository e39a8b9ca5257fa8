#include "live/warm_up.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <iterator>
#include <utility>

#include <fmt/format.h>

namespace crosstie::live {
namespace {

constexpr double kTenMinutes_s = 600.0;
constexpr std::ptrdiff_t kFewest = 3;  // readings: a line has two parameters

}  // namespace

base::Result<> WarmUpOptions::validate() const {
  const auto bad = [](const char* member, double value, const char* domain) {
    return base::fail(base::ErrorCode::kUsage, fmt::format("warm-up: {} is {}, it must be {}", member, value, domain));
  };
  if (!(most_k_per_10_min > 0.0 && std::isfinite(most_k_per_10_min)))
    return bad("most_k_per_10_min", most_k_per_10_min, "positive");
  if (!(window_s > 0.0 && std::isfinite(window_s))) return bad("window_s", window_s, "positive");
  if (!(least_s > 0.0 && least_s <= window_s)) return bad("least_s", least_s, "positive and at most window_s");
  return {};
}

base::Result<WarmUp> judge_warm_up(std::span<const TemperatureReading> readings, const WarmUpOptions& options) {
  if (auto valid = options.validate(); !valid) return base::fail(std::move(valid));
  WarmUp result;
  if (readings.empty()) return result;
  const TemperatureReading& latest = readings.back();
  result.temperature_c = latest.temperature_c;
  const auto first = std::find_if(readings.begin(), readings.end(), [&](const TemperatureReading& one) {
    return devices::seconds_between(one.time, latest.time) <= options.window_s;
  });
  const auto count = std::distance(first, readings.end());
  if (count < kFewest || devices::seconds_between(first->time, latest.time) < options.least_s) return result;

  double mean_t = 0.0, mean_c = 0.0;
  for (auto one = first; one != readings.end(); ++one) {
    mean_t += devices::seconds_between(latest.time, one->time) / static_cast<double>(count);
    mean_c += one->temperature_c / static_cast<double>(count);
  }
  double tt = 0.0, tc = 0.0, cc = 0.0;
  for (auto one = first; one != readings.end(); ++one) {
    const double t = devices::seconds_between(latest.time, one->time) - mean_t;
    const double c = one->temperature_c - mean_c;
    tt += t * t;
    tc += t * c;
    cc += c * c;
  }
  const double slope = tc / tt;
  const double left = std::max(0.0, cc - slope * tc) / static_cast<double>(count - 2);
  result.k_per_10_min = kTenMinutes_s * slope;
  result.sigma_k_per_10_min = kTenMinutes_s * std::sqrt(left / tt);
  result.warming = *result.k_per_10_min > options.most_k_per_10_min;
  return result;
}

}  // namespace crosstie::live
