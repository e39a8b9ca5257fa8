#include "devices/axis_reader.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <fmt/format.h>

namespace crosstie::devices {

using base::ErrorCode;

base::Result<AxisReading> fresh_reading(const AxisState& state, HostTime now, double max_age_s) {
  if (!(max_age_s > 0.0) || !std::isfinite(max_age_s)) {
    return base::fail(ErrorCode::kUsage, fmt::format("{}: the largest age of a reading must be positive and finite, not {} s",
                                                     state.source, max_age_s));
  }
  const std::string why = state.trouble.empty() ? "" : "; " + state.trouble;
  if (!state.latest) return base::fail(ErrorCode::kDevice, fmt::format("{}: no reading yet{}", state.source, why));
  const double age_s = std::max(0.0, seconds_between(state.latest->time, now));
  if (age_s > max_age_s) {
    return base::fail(ErrorCode::kDevice, fmt::format("{}: the reading of {:.3f} mm is {:.1f} s old, {:.1f} s are allowed{}",
                                                      state.source, state.latest->position_mm, age_s, max_age_s, why));
  }
  return *state.latest;
}

TypedAxis::TypedAxis(Clock clock) : clock_(std::move(clock)) {}

base::Result<> TypedAxis::enter(double position_mm) {
  if (!std::isfinite(position_mm)) return base::fail(ErrorCode::kUsage, "typed axis position: not a finite number");
  const std::lock_guard lock(mutex_);
  latest_ = AxisReading{position_mm, clock_()};
  return {};
}

void TypedAxis::forget() {
  const std::lock_guard lock(mutex_);
  latest_.reset();
}

AxisState TypedAxis::state() {
  const std::lock_guard lock(mutex_);
  return {"typed axis position", latest_, {}};
}

SimulatedAxis::SimulatedAxis(std::function<base::Result<double>(HostTime)> position_mm, Clock clock)
    : position_mm_(std::move(position_mm)), clock_(std::move(clock)) {}

AxisState SimulatedAxis::state() {
  const std::lock_guard lock(mutex_);
  const HostTime now = clock_();
  const base::Result<double> position_mm = position_mm_(now);
  if (position_mm) latest_ = AxisReading{*position_mm, now};
  return {"simulated axis", latest_, position_mm ? std::string() : position_mm.error().message};
}

}  // namespace crosstie::devices
