#pragma once

#include <condition_variable>
#include <deque>
#include <functional>
#include <mutex>
#include <optional>
#include <stop_token>
#include <string>
#include <thread>

#include "app/live/live_status.h"
#include "base/progress.h"
#include "base/result.h"
#include "devices/host_time.h"

namespace crosstie::app {

/// Does one piece of work after the other in a thread of its own.
class Worker {
 public:
  /// Its outcome is told to `done`, from the worker's thread, before the next piece begins.
  using Work = std::function<base::Result<>(const base::Progress&)>;
  using Done = std::function<void(const std::string& what, const base::Result<>&)>;

  explicit Worker(Done done);
  /// Cancels what runs and forgets what waits.
  ~Worker();
  Worker(const Worker&) = delete;
  Worker& operator=(const Worker&) = delete;

  void add(std::string what, Work work);
  /// Stops what runs and forgets what waits.
  void cancel();
  /// Whether nothing runs and nothing waits.
  [[nodiscard]] bool idle() const;
  /// What runs now, or is about to.
  [[nodiscard]] std::optional<WorkStatus> status() const;

 private:
  struct Piece {
    std::string what;
    Work work;
  };
  void run(const std::stop_token& stop);

  Done done_;
  mutable std::mutex mutex_;  ///< of all below
  std::condition_variable_any changed_;
  std::deque<Piece> waiting_;
  std::optional<WorkStatus> running_;
  devices::HostTime since_;
  std::stop_source cancel_;  ///< of what runs
  std::jthread thread_;      ///< last: ends before the rest
};

}  // namespace crosstie::app
