#include "devices/detail/wake.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <stdexcept>

#include <poll.h>
#include <sys/eventfd.h>

namespace crosstie::devices::detail {

using std::chrono::steady_clock;

Wake::Wake() : event_(::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)) {
  if (!event_.valid()) throw std::runtime_error("no event descriptor: " + base::last_system_error());
}

void Wake::call() const {
  const std::uint64_t one = 1;
  // Fails only where the counter is full, and then the waiting thread is woken already.
  [[maybe_unused]] const ssize_t written = ::write(event_.number(), &one, sizeof one);
}

Wake::Event Wake::wait(const base::FileDescriptor& device, short events, std::chrono::nanoseconds timeout) const {
  const auto end = steady_clock::now() + timeout;
  while (true) {
    std::array<pollfd, 2> watched = {pollfd{event_.number(), POLLIN, 0}, pollfd{device.number(), events, 0}};
    const auto left = std::max(std::chrono::nanoseconds(0), std::chrono::nanoseconds(end - steady_clock::now()));
    const auto left_ms = std::chrono::ceil<std::chrono::milliseconds>(left).count();
    const int ready = ::poll(watched.data(), watched.size(), static_cast<int>(std::min<std::int64_t>(left_ms, 60'000)));
    if (ready > 0) return watched[0].revents != 0 ? Event::kWoken : Event::kReady;
    if (steady_clock::now() >= end) return Event::kTimeout;
  }
}

}  // namespace crosstie::devices::detail
