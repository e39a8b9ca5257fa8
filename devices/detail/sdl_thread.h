#pragma once

#include <condition_variable>
#include <functional>
#include <memory>
#include <mutex>
#include <stop_token>
#include <string>
#include <thread>

#include "base/result.h"

namespace crosstie::devices::detail {

/// The one thread that may speak to SDL: it starts SDL's video, does what others ask it to, and lets SDL handle the desktop's events in
/// between, so that the desktop does not take the program for dead. It lives as long as somebody holds it.
class SdlThread {
 public:
  /// The process's thread, started where there is none. Error kDevice where SDL finds no desktop.
  static base::Result<std::shared_ptr<SdlThread>> acquire();
  SdlThread(const SdlThread&) = delete;
  SdlThread& operator=(const SdlThread&) = delete;
  ~SdlThread();

  /// Runs `work` on the thread and returns when it is done.
  void run(const std::function<void()>& work);
  /// Called on the thread some 60 times a second, for SDL's events; an empty one ends it. Returns when it is in place.
  void set_idle(std::function<void()> idle);

 private:
  SdlThread() = default;
  base::Result<> begin();
  void serve(const std::stop_token& stop);

  std::mutex mutex_;  ///< of the four below
  std::condition_variable_any changed_;
  const std::function<void()>* work_ = nullptr;
  std::function<void()> idle_;
  bool started_ = false;
  std::string failure_;
  std::mutex asking_;  ///< one at a time
  std::jthread thread_;
};

}  // namespace crosstie::devices::detail
