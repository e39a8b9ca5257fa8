#pragma once

#include <condition_variable>
#include <functional>
#include <mutex>
#include <stop_token>
#include <thread>
#include <utility>

#include "devices/host_time.h"

namespace crosstie::devices::detail {

/// Does its work again and again in a thread of its own, with a pause in between; destroying it ends the pause and waits for the work.
class Poller {
 public:
  Poller(std::function<void()> work, double pause_s)
      : thread_([this, work = std::move(work), pause = to_nanoseconds(pause_s)](const std::stop_token& stop) {
          std::unique_lock lock(mutex_);
          while (!stop.stop_requested()) {
            work();
            pause_.wait_for(lock, stop, pause, [] { return false; });
          }
        }) {}

 private:
  std::mutex mutex_;
  std::condition_variable_any pause_;
  std::jthread thread_;  ///< last: it ends before what it uses
};

}  // namespace crosstie::devices::detail
