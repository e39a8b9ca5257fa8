#include "base/parallel.h"

#include <algorithm>
#include <atomic>
#include <exception>
#include <mutex>
#include <new>
#include <optional>
#include <string>
#include <system_error>
#include <thread>
#include <vector>

namespace crosstie::base {
namespace {

Result<> run_guarded(const std::function<Result<>(std::size_t)>& work, std::size_t i) {
  try {
    return work(i);
  } catch (const std::bad_alloc&) {
    return fail(ErrorCode::kFileSystem, "not enough memory");
  } catch (const std::exception& e) {
    return fail(ErrorCode::kInternal, std::string("an exception left item ") + std::to_string(i) + ": " + e.what());
  } catch (...) {
    return fail(ErrorCode::kInternal, "an unknown exception left item " + std::to_string(i));
  }
}

/// The state that the threads of one call share. Items are handed out in ascending order and each one handed out is finished,
/// so the smallest failing item has always been run, whichever failure was noticed first.
class Run {
 public:
  Run(std::size_t count, std::string_view stage, const Progress& progress, const std::function<Result<>(std::size_t)>& work)
      : count_(count), stage_(stage), progress_(progress), work_(work) {}

  void work_off() {
    while (!stopped_.load()) {
      if (progress_.cancelled()) return;
      const std::size_t i = next_.fetch_add(1);
      if (i >= count_) return;
      finish(i, run_guarded(work_, i));
    }
  }

  Result<> outcome() const {
    if (error_) return tl::unexpected<Error>(*error_);
    if (done_ < count_) return cancelled(stage_);
    return {};
  }

 private:
  void finish(std::size_t i, const Result<>& result) {
    const std::lock_guard lock(mutex_);
    ++done_;
    if (!result) {
      if (!error_ || i < failed_) {
        error_ = result.error();
        failed_ = i;
      }
      stopped_.store(true);
      return;
    }
    progress_(stage_, done_, count_);
  }

  const std::size_t count_;
  const std::string_view stage_;
  const Progress& progress_;
  const std::function<Result<>(std::size_t)>& work_;
  std::atomic<std::size_t> next_{0};
  std::atomic<bool> stopped_{false};
  std::mutex mutex_;
  std::size_t done_ = 0;
  std::size_t failed_ = 0;
  std::optional<Error> error_;
};

}  // namespace

Result<> parallel_for(std::size_t count, int threads, std::string_view stage, const Progress& progress,
                      const std::function<Result<>(std::size_t)>& work) {
  if (count == 0) return {};
  const std::size_t wanted =
      threads > 0 ? static_cast<std::size_t>(threads) : std::max(1U, std::thread::hardware_concurrency());
  progress(stage, 0, count);
  Run run(count, stage, progress, work);
  {
    std::vector<std::jthread> helpers;
    for (std::size_t t = 1; t < std::min(wanted, count); ++t) {
      try {
        helpers.emplace_back([&run] { run.work_off(); });
      } catch (const std::system_error&) {
        break;  // the machine gives no more threads: those that run do the work
      }
    }
    run.work_off();
  }
  return run.outcome();
}

}  // namespace crosstie::base
