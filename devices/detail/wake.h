#pragma once

#include <chrono>

#include "base/file_descriptor.h"

namespace crosstie::devices::detail {

/// Ends the waiting of a thread for a device.
class Wake {
 public:
  Wake();
  void call() const;

  /// What ended a wait.
  enum class Event { kWoken, kReady, kTimeout };
  /// Waits until `device` has one of poll()'s `events` (or an error), until woken or until the time is over. An invalid `device`
  /// is never ready.
  [[nodiscard]] Event wait(const base::FileDescriptor& device, short events, std::chrono::nanoseconds timeout) const;

 private:
  base::FileDescriptor event_;
};

}  // namespace crosstie::devices::detail
