#pragma once

#include <array>
#include <condition_variable>
#include <cstdint>
#include <mutex>
#include <optional>
#include <stop_token>
#include <string>
#include <utility>

#include "devices/host_time.h"

namespace crosstie::live {

template <typename T>
struct Versioned {
  std::uint64_t version = 0;  ///< of the first published value 1, then counting up
  T value;
};

/// The newest value of something. Publishing never waits; readers wait for something newer. Safe to call from any thread.
template <typename T>
class Newest {
 public:
  void publish(T value) {
    {
      const std::lock_guard lock(mutex_);
      value_ = std::move(value);
      ++version_;
    }
    changed_.notify_all();
  }

  /// Of the newest value; 0: nothing was published yet.
  [[nodiscard]] std::uint64_t version() const {
    const std::lock_guard lock(mutex_);
    return version_;
  }

  /// The newest value if its version is above `than`, at once or within `timeout_s`; nothing after that, or when asked to stop.
  [[nodiscard]] std::optional<Versioned<T>> wait_newer(std::uint64_t than, double timeout_s, const std::stop_token& stop = {}) {
    std::unique_lock lock(mutex_);
    if (!changed_.wait_until(lock, stop, devices::host_now() + devices::to_nanoseconds(timeout_s),
                             [&] { return version_ > than; })) {
      return std::nullopt;
    }
    return Versioned<T>{version_, value_};
  }

 private:
  mutable std::mutex mutex_;
  std::condition_variable_any changed_;
  std::uint64_t version_ = 0;
  T value_{};
};

/// What the page sees: state and scene are JSON, pictures are JPEG files (left, right).
struct Feed {
  Newest<std::string> state;
  Newest<std::string> scene;
  std::array<Newest<std::string>, 2> pictures;
};

}  // namespace crosstie::live
