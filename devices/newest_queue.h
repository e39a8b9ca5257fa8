#pragma once

#include <algorithm>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <mutex>
#include <optional>
#include <utility>

#include "base/result.h"
#include "devices/host_time.h"

namespace crosstie::devices {

/// Hands items from one thread to another, never more than `capacity` at a time: where the taker is slower, the oldest are dropped
/// and counted, so that what is shown is new and memory is bounded. For measuring, where every frame counts, `dropped` must stay 0.
/// Make it before the camera whose sink pushes into it: it must outlive that.
template <typename T>
class NewestQueue {
 public:
  explicit NewestQueue(std::size_t capacity) : capacity_(std::max<std::size_t>(capacity, 1)) {}

  /// Never waits. An error ends the queue: it is handed out after the items before it, again and again.
  void push(base::Result<T> item) {
    const std::lock_guard lock(mutex_);
    if (ended_) return;
    if (!item) {
      ended_ = std::move(item).error();
    } else {
      if (items_.size() == capacity_) {
        items_.pop_front();
        ++dropped_;
      }
      items_.push_back(*std::move(item));
    }
    changed_.notify_all();
  }

  /// The oldest item; nothing where none came within `timeout_s`.
  [[nodiscard]] base::Result<std::optional<T>> pop(double timeout_s) {
    std::unique_lock lock(mutex_);
    changed_.wait_until(lock, host_now() + to_nanoseconds(timeout_s), [this] { return !items_.empty() || ended_.has_value(); });
    if (!items_.empty()) {
      std::optional<T> item(std::move(items_.front()));
      items_.pop_front();
      return item;
    }
    if (ended_) return tl::unexpected(*ended_);
    return std::nullopt;
  }

  [[nodiscard]] std::uint64_t dropped() const {
    const std::lock_guard lock(mutex_);
    return dropped_;
  }

 private:
  std::size_t capacity_;
  mutable std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<T> items_;
  std::optional<base::Error> ended_;
  std::uint64_t dropped_ = 0;
};

}  // namespace crosstie::devices
