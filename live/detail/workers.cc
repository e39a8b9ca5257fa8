#include "live/detail/workers.h"

#include <cerrno>
#include <utility>

#include <sys/socket.h>

namespace crosstie::live::detail {

Workers::Workers(base::FileDescriptor listener, std::size_t threads, std::chrono::nanoseconds patience,
                 std::function<void(Connection&)> serve)
    : listener_(std::move(listener)), patience_(patience), serve_(std::move(serve)) {
  threads_.reserve(threads + 1);
  for (std::size_t i = 0; i < threads; ++i) threads_.emplace_back([this] { work(); });
  threads_.emplace_back([this] { accept(); });
}

Workers::~Workers() {
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
    ::shutdown(listener_.number(), SHUT_RDWR);  // ends accept()
    for (const Connection* one : served_) one->abort();
  }
  changed_.notify_all();
}

void Workers::accept() {
  std::unique_lock lock(mutex_);
  while (true) {
    changed_.wait(lock, [this] { return stopping_ || accepted_.size() < idle_; });
    if (stopping_) return;
    lock.unlock();
    base::FileDescriptor socket(::accept4(listener_.number(), nullptr, nullptr, SOCK_CLOEXEC | SOCK_NONBLOCK));
    // A client that went away is none of ours; without descriptors or memory, others may give some back.
    if (!socket.valid() && errno != ECONNABORTED && errno != EINTR) std::this_thread::sleep_for(std::chrono::milliseconds(20));
    lock.lock();
    if (stopping_) return;
    if (!socket.valid()) continue;
    accepted_.push_back(std::move(socket));
    changed_.notify_all();
  }
}

void Workers::work() {
  std::unique_lock lock(mutex_);
  while (true) {
    ++idle_;
    changed_.notify_all();
    changed_.wait(lock, [this] { return stopping_ || !accepted_.empty(); });
    if (stopping_) return;
    --idle_;
    Connection connection(std::move(accepted_.front()), patience_);
    accepted_.pop_front();
    served_.insert(&connection);
    lock.unlock();
    serve_(connection);
    lock.lock();
    served_.erase(&connection);
  }
}

}  // namespace crosstie::live::detail
