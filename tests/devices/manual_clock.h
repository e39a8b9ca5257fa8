#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>

#include "devices/host_time.h"

namespace crosstie::tests {

/// A clock that stands until a test moves it.
class ManualClock {
 public:
  [[nodiscard]] devices::Clock clock() const {
    return [this] { return now(); };
  }
  [[nodiscard]] devices::HostTime now() const { return devices::HostTime(std::chrono::nanoseconds(now_ns_.load())); }
  void advance(std::chrono::nanoseconds time) { now_ns_ += time.count(); }

 private:
  std::atomic<std::int64_t> now_ns_ = 1'000'000'000'000;
};

}  // namespace crosstie::tests
