#include "app/live/worker.h"

#include <malloc.h>

#include <exception>
#include <utility>

#include <fmt/core.h>

namespace crosstie::app {

using base::Progress;
using base::Result;

namespace {

/// What a computation leaves free is the system's again: the program runs for a shift, and the C library keeps the most that was ever used.
void give_memory_back() {
#ifdef __GLIBC__
  ::malloc_trim(0);
#endif
}

}  // namespace

Worker::Worker(Done done) : done_(std::move(done)), thread_([this](const std::stop_token& stop) { run(stop); }) {}

Worker::~Worker() {
  thread_.request_stop();
  cancel();
}

void Worker::add(std::string what, Work work) {
  const std::lock_guard lock(mutex_);
  waiting_.push_back({std::move(what), std::move(work)});
  changed_.notify_all();
}

void Worker::cancel() {
  const std::lock_guard lock(mutex_);
  waiting_.clear();
  cancel_.request_stop();
}

bool Worker::idle() const {
  const std::lock_guard lock(mutex_);
  return waiting_.empty() && !running_;
}

std::optional<WorkStatus> Worker::status() const {
  const std::lock_guard lock(mutex_);
  std::optional<WorkStatus> status = running_;
  if (!status && !waiting_.empty()) return WorkStatus{.what = waiting_.front().what};
  if (status) status->seconds = devices::seconds_between(since_, devices::host_now());
  return status;
}

void Worker::run(const std::stop_token& stop) {
  while (!stop.stop_requested()) {
    Piece piece;
    Progress progress;
    {
      std::unique_lock lock(mutex_);
      if (!changed_.wait(lock, stop, [this] { return !waiting_.empty(); })) return;
      piece = std::move(waiting_.front());
      waiting_.pop_front();
      cancel_ = std::stop_source();
      since_ = devices::host_now();
      running_ = WorkStatus{.what = piece.what, .stage = {}};
      progress.stop = cancel_.get_token();
    }
    progress.report = [this](std::string_view stage, std::size_t done, std::size_t total) {
      const std::lock_guard lock(mutex_);
      if (!running_) return;
      running_->stage = stage;
      running_->done = done;
      running_->total = total;
    };
    Result<> outcome;
    try {
      outcome = piece.work(progress);
    } catch (const std::exception& error) {
      outcome = base::fail(base::ErrorCode::kInternal, fmt::format("a defect of crosstie: {}", error.what()));
    } catch (...) {
      outcome = base::fail(base::ErrorCode::kInternal, "a defect of crosstie: something unknown was thrown");
    }
    done_(piece.what, outcome);
    piece = {};
    give_memory_back();
    const std::lock_guard lock(mutex_);
    running_.reset();
  }
}

}  // namespace crosstie::app
