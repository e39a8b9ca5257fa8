#pragma once

#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <deque>
#include <functional>
#include <mutex>
#include <set>
#include <thread>
#include <vector>

#include "base/file_descriptor.h"
#include "live/detail/connection.h"

namespace crosstie::live::detail {

/// Accepts connections and serves each on one of a fixed number of threads; where all are busy, clients wait in the kernel's queue.
/// Destroying it ends all connections and waits for `serve` to return.
class Workers {
 public:
  Workers(base::FileDescriptor listener, std::size_t threads, std::chrono::nanoseconds patience,
          std::function<void(Connection&)> serve);
  ~Workers();

 private:
  void accept();
  void work();

  base::FileDescriptor listener_;
  std::chrono::nanoseconds patience_;
  std::function<void(Connection&)> serve_;
  std::mutex mutex_;
  std::condition_variable changed_;
  bool stopping_ = false;
  std::size_t idle_ = 0;                       ///< threads that wait for a connection
  std::deque<base::FileDescriptor> accepted_;  ///< never more than idle_
  std::set<const Connection*> served_;
  std::vector<std::jthread> threads_;  ///< last: they end before what they use
};

}  // namespace crosstie::live::detail
