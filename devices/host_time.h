#pragma once

#include <chrono>
#include <functional>

namespace crosstie::devices {

/// When something happened, on the host's monotonic clock: it never jumps, so ages and the order of frames and readings hold even
/// where the wall clock is set. It says nothing across a restart of the machine and is never written to a file.
using HostTime = std::chrono::time_point<std::chrono::steady_clock, std::chrono::nanoseconds>;

/// Tells the time; tests hand in their own. Called from the devices' threads, so it must be safe to call from any.
using Clock = std::function<HostTime()>;

[[nodiscard]] inline HostTime host_now() { return std::chrono::steady_clock::now(); }

[[nodiscard]] inline double seconds_between(HostTime from, HostTime to) {
  return std::chrono::duration<double>(to - from).count();
}

[[nodiscard]] inline std::chrono::nanoseconds to_nanoseconds(double seconds) {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(std::chrono::duration<double>(seconds));
}

}  // namespace crosstie::devices
