#pragma once

#include <chrono>
#include <functional>
#include <thread>

namespace crosstie::tests {

/// Whether `condition` becomes true. The limit is reached only by a test that fails.
inline bool eventually(const std::function<bool()>& condition) {
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(30);
  while (!condition()) {
    if (std::chrono::steady_clock::now() > end) return false;
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  return true;
}

}  // namespace crosstie::tests
