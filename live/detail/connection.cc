#include "live/detail/connection.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdint>
#include <cstring>
#include <utility>

#include <netdb.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/socket.h>

namespace crosstie::live::detail {
namespace {

using std::chrono::nanoseconds;
using std::chrono::steady_clock;

constexpr std::size_t kWriteBytes = std::size_t{64} << 10;
// What waits in the kernel for a slow reader is old already: little of it.
constexpr int kSendBufferBytes = 256 << 10;
// One-byte chunks take six bytes each.
constexpr std::size_t kBodyAllowance = 8 * kMaxBodyBytes;

}  // namespace

Connection::Connection(base::FileDescriptor socket, nanoseconds patience)
    : socket_(std::move(socket)), patience_(patience), body_allowance_(kBodyAllowance) {
  const int at_once = 1;
  ::setsockopt(socket_.number(), IPPROTO_TCP, TCP_NODELAY, &at_once, sizeof at_once);
  ::setsockopt(socket_.number(), SOL_SOCKET, SO_SNDBUF, &kSendBufferBytes, sizeof kSendBufferBytes);
}

bool Connection::wait(short events, steady_clock::time_point end) const {
  while (true) {
    pollfd watched{socket_.number(), events, 0};
    const auto left = std::max(nanoseconds(0), nanoseconds(end - steady_clock::now()));
    const auto left_ms = std::chrono::ceil<std::chrono::milliseconds>(left).count();
    if (::poll(&watched, 1, static_cast<int>(std::min<std::int64_t>(left_ms, 60'000))) > 0) return true;
    if (steady_clock::now() >= end) return false;
  }
}

/// -1 also where nothing is there yet (errno EAGAIN).
std::ptrdiff_t Connection::receive(char* data, std::size_t size) const {
  while (true) {
    const ssize_t count = ::recv(socket_.number(), data, size, 0);
    if (count >= 0 || errno != EINTR) return count;
  }
}

Connection::Head Connection::read_head() {
  const auto end = steady_clock::now() + patience_;
  while (true) {
    std::array<char, 4096> bytes;
    if (!wait(POLLIN, end)) return received_.empty() ? Head::kNone : Head::kSlow;
    const std::ptrdiff_t count = receive(bytes.data(), bytes.size());
    if (count < 0 && errno == EAGAIN) continue;
    if (count <= 0) return Head::kNone;
    const std::size_t from = received_.size() < 3 ? 0 : received_.size() - 3;
    received_.append(bytes.data(), static_cast<std::size_t>(count));
    const std::size_t empty_line = received_.find("\r\n\r\n", from);
    if (std::min(empty_line, received_.size()) > kMaxHeadBytes - 4) return Head::kTooLong;
    if (empty_line != std::string::npos) {
      head_size_ = empty_line + 4;
      body_end_ = steady_clock::now() + patience_;
      return Head::kComplete;
    }
  }
}

std::ptrdiff_t Connection::read(char* data, std::size_t size) {
  if (handed_out_ < received_.size()) {
    const std::size_t count = std::min(size, received_.size() - handed_out_);
    std::memcpy(data, received_.data() + handed_out_, count);
    handed_out_ += count;
    return static_cast<std::ptrdiff_t>(count);
  }
  size = std::min(size, body_allowance_);
  if (size == 0) return -1;
  while (true) {
    if (!wait(POLLIN, body_end_)) {
      body_was_slow_ = true;
      return -1;
    }
    const std::ptrdiff_t count = receive(data, size);
    if (count < 0 && errno == EAGAIN) continue;
    if (count > 0) body_allowance_ -= static_cast<std::size_t>(count);
    return count;
  }
}

bool Connection::write(std::string_view bytes) {
  auto end = steady_clock::now() + patience_;
  std::size_t until_new_end = kWriteBytes;
  while (!broken_ && !bytes.empty()) {
    const ssize_t sent = ::send(socket_.number(), bytes.data(), std::min(bytes.size(), until_new_end), MSG_NOSIGNAL);
    if (sent > 0) {
      bytes.remove_prefix(static_cast<std::size_t>(sent));
      until_new_end -= static_cast<std::size_t>(sent);
      if (until_new_end == 0) {
        until_new_end = kWriteBytes;
        end = steady_clock::now() + patience_;
      }
    } else if (errno == EAGAIN) {
      broken_ = !wait(POLLOUT, end);
    } else if (errno != EINTR) {
      broken_ = true;
    }
  }
  return !broken_;
}

bool Connection::closed_by_client() const {
  pollfd watched{socket_.number(), POLLRDHUP, 0};
  return broken_ || (::poll(&watched, 1, 0) > 0 && watched.revents != 0);
}

void Connection::end(nanoseconds linger) {
  if (broken_) {
    // Nobody reads what is still in the kernel: away with it.
    const ::linger none{1, 0};
    ::setsockopt(socket_.number(), SOL_SOCKET, SO_LINGER, &none, sizeof none);
    return;
  }
  ::shutdown(socket_.number(), SHUT_WR);
  const auto end = steady_clock::now() + linger;
  std::array<char, 16'384> unread;
  while (wait(POLLIN, end)) {
    const std::ptrdiff_t count = receive(unread.data(), unread.size());
    if (count == 0 || (count < 0 && errno != EAGAIN) || steady_clock::now() >= end) return;
  }
}

void Connection::abort() const { ::shutdown(socket_.number(), SHUT_RDWR); }

std::string Connection::local_address() const {
  sockaddr_storage address{};
  socklen_t size = sizeof address;
  auto* bytes = reinterpret_cast<sockaddr*>(&address);
  std::array<char, NI_MAXHOST> text{};
  if (::getsockname(socket_.number(), bytes, &size) != 0 ||
      ::getnameinfo(bytes, size, text.data(), static_cast<socklen_t>(text.size()), nullptr, 0, NI_NUMERICHOST) != 0) {
    return {};
  }
  return text.data();
}

}  // namespace crosstie::live::detail
