#include "devices/detail/sdl_thread.h"

#include <chrono>
#include <utility>

#include <SDL.h>

namespace crosstie::devices::detail {
namespace {

constexpr std::chrono::milliseconds kPause{16};

}  // namespace

base::Result<std::shared_ptr<SdlThread>> SdlThread::acquire() {
  static std::mutex mutex;
  static std::weak_ptr<SdlThread> current;
  const std::lock_guard lock(mutex);
  if (auto alive = current.lock()) return alive;
  const std::shared_ptr<SdlThread> thread(new SdlThread);
  if (auto begun = thread->begin(); !begun) return base::fail(std::move(begun));
  current = thread;
  return thread;
}

base::Result<> SdlThread::begin() {
  thread_ = std::jthread([this](const std::stop_token& stop) { serve(stop); });
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [this] { return started_; });
  if (failure_.empty()) return {};
  return base::fail(base::ErrorCode::kDevice, "projector: no desktop to open a window on: " + failure_);
}

SdlThread::~SdlThread() {
  thread_.request_stop();
  if (thread_.joinable()) thread_.join();
}

void SdlThread::run(const std::function<void()>& work) {
  const std::lock_guard one(asking_);
  std::unique_lock lock(mutex_);
  work_ = &work;
  changed_.notify_all();
  changed_.wait(lock, [this] { return work_ == nullptr; });
}

void SdlThread::set_idle(std::function<void()> idle) {
  run([this, &idle] { idle_ = std::move(idle); });
}

void SdlThread::serve(const std::stop_token& stop) {
  // A thread that is ending may still hold SDL while the next one begins.
  static std::mutex owner;
  const std::lock_guard owning(owner);
  SDL_SetHint(SDL_HINT_NO_SIGNAL_HANDLERS, "1");  // Ctrl-C is the program's
  SDL_SetHint(SDL_HINT_VIDEO_MINIMIZE_ON_FOCUS_LOSS, "0");
  SDL_SetHint(SDL_HINT_RENDER_SCALE_QUALITY, "nearest");
  SDL_SetMainReady();
  const bool ready = SDL_InitSubSystem(SDL_INIT_VIDEO) == 0;
  std::unique_lock lock(mutex_);
  if (!ready) failure_ = SDL_GetError();
  started_ = true;
  changed_.notify_all();
  while (ready && !stop.stop_requested()) {
    changed_.wait_for(lock, stop, kPause, [this] { return work_ != nullptr; });
    if (work_ != nullptr) {
      const std::function<void()>& work = *work_;
      work();  // under the lock: who asked is waiting, and nobody else may ask meanwhile
      work_ = nullptr;
      changed_.notify_all();
    } else if (idle_) {
      idle_();
    } else {
      SDL_PumpEvents();
    }
  }
  lock.unlock();
  if (ready) SDL_QuitSubSystem(SDL_INIT_VIDEO);
}

}  // namespace crosstie::devices::detail
