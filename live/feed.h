#pragma once

#include <array>
#include <condition_variable>
#include <cstdint>
#include <memory>
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

/// The newest value of something: readers that are slower than the publisher miss versions, and memory stays bounded. Publishing never
/// waits for them, nor for their copying. Safe to call from any thread.
template <typename T>
class Newest {
 public:
  void publish(T value) {
    auto made = std::make_shared<const T>(std::move(value));
    {
      const std::lock_guard lock(mutex_);
      value_.swap(made);
      ++version_;
    }
    changed_.notify_all();
  }

  /// Of the newest value; 0: nothing was published yet.
  [[nodiscard]] std::uint64_t version() const {
    const std::lock_guard lock(mutex_);
    return version_;
  }

  /// The newest value, without waiting; nothing where none was published yet.
  [[nodiscard]] std::optional<Versioned<T>> newest() const {
    std::unique_lock lock(mutex_);
    return copy(lock, 0);
  }

  /// The newest value if its version is above `than`, at once or within `timeout_s`; nothing after that, or when asked to stop.
  [[nodiscard]] std::optional<Versioned<T>> wait_newer(std::uint64_t than, double timeout_s, const std::stop_token& stop = {}) {
    std::unique_lock lock(mutex_);
    changed_.wait_until(lock, stop, devices::host_now() + devices::to_nanoseconds(timeout_s), [&] { return version_ > than; });
    if (stop.stop_requested()) return std::nullopt;
    return copy(lock, than);
  }

 private:
  [[nodiscard]] std::optional<Versioned<T>> copy(std::unique_lock<std::mutex>& lock, std::uint64_t than) const {
    if (version_ <= than) return std::nullopt;
    const std::uint64_t version = version_;
    const std::shared_ptr<const T> value = value_;
    lock.unlock();
    return Versioned<T>{version, *value};
  }

  mutable std::mutex mutex_;
  std::condition_variable_any changed_;
  std::uint64_t version_ = 0;
  std::shared_ptr<const T> value_;
};

/// What the page sees: state and scene are JSON, pictures are JPEG files (left, right).
struct Feed {
  Newest<std::string> state;
  Newest<std::string> scene;
  std::array<Newest<std::string>, 2> pictures;
};

}  // namespace crosstie::live
