#pragma once

#include <atomic>
#include <memory>
#include <utility>

namespace crosstie::live::detail {

/// A place among a bounded number of clients; given back when it is destroyed or released.
class Slot {
 public:
  Slot() = default;
  explicit Slot(std::shared_ptr<std::atomic<int>> free) : free_(std::move(free)) {}
  Slot(Slot&& other) noexcept = default;
  Slot& operator=(Slot&& other) noexcept {
    std::swap(free_, other.free_);
    return *this;
  }
  ~Slot() { release(); }

  [[nodiscard]] bool taken() const { return free_ != nullptr; }
  void release() {
    if (const auto free = std::exchange(free_, nullptr)) ++*free;
  }

 private:
  std::shared_ptr<std::atomic<int>> free_;
};

class Slots {
 public:
  explicit Slots(int count) : free_(std::make_shared<std::atomic<int>>(count)) {}

  /// Without waiting; not taken() where all are.
  [[nodiscard]] Slot take() {
    int free = *free_;
    while (free > 0) {
      if (free_->compare_exchange_weak(free, free - 1)) return Slot(free_);
    }
    return {};
  }

 private:
  std::shared_ptr<std::atomic<int>> free_;
};

}  // namespace crosstie::live::detail
