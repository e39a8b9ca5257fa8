#include <cerrno>
#include <chrono>
#include <cstring>
#include <memory>
#include <utility>
#include <vector>

#include <netdb.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/socket.h>

#include <fmt/format.h>

#include "devices/axis_stream.h"
#include "devices/detail/axis_link.h"
#include "devices/detail/shown_line.h"

namespace crosstie::devices {
namespace {

using base::ErrorCode;
using base::FileDescriptor;
using detail::Wake;

constexpr std::chrono::seconds kConnectTimeout{3};

struct Address {
  sockaddr_storage bytes{};
  socklen_t size = 0;
  int family = AF_UNSPEC;
};

base::Result<std::vector<Address>> resolve(const TcpAxisOptions& options) {
  addrinfo hints{};
  hints.ai_family = AF_UNSPEC;
  hints.ai_socktype = SOCK_STREAM;
  addrinfo* found = nullptr;
  const int failed = ::getaddrinfo(options.host.c_str(), std::to_string(options.port).c_str(), &hints, &found);
  if (failed != 0) {
    return base::fail(ErrorCode::kDevice, fmt::format("axis host \"{}\" has no address: {}", detail::shown_line(options.host),
                                                      ::gai_strerror(failed)));
  }
  std::vector<Address> addresses;
  for (const addrinfo* one = found; one != nullptr; one = one->ai_next) {
    Address address{{}, one->ai_addrlen, one->ai_family};
    std::memcpy(&address.bytes, one->ai_addr, one->ai_addrlen);
    addresses.push_back(address);
  }
  ::freeaddrinfo(found);
  return addresses;
}

base::Result<FileDescriptor> connect(const Address& address, const Wake& wake) {
  FileDescriptor socket(::socket(address.family, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
  if (!socket.valid()) return base::fail(ErrorCode::kDevice, base::last_system_error());
  if (::connect(socket.number(), reinterpret_cast<const sockaddr*>(&address.bytes), address.size) != 0 &&
      errno != EINPROGRESS) {
    return base::fail(ErrorCode::kDevice, base::last_system_error());
  }
  switch (wake.wait(socket, POLLOUT, kConnectTimeout)) {
    case Wake::Event::kWoken:
      return base::fail(ErrorCode::kCancelled, "closed");
    case Wake::Event::kTimeout:
      return base::fail(ErrorCode::kDevice, fmt::format("no answer within {} s", kConnectTimeout.count()));
    case Wake::Event::kReady:
      break;
  }
  int error = 0;
  socklen_t size = sizeof error;
  ::getsockopt(socket.number(), SOL_SOCKET, SO_ERROR, &error, &size);
  if (error != 0) return base::fail(ErrorCode::kDevice, std::generic_category().message(error));
  const int at_once = 1;  // requests are small and wanted now
  ::setsockopt(socket.number(), IPPROTO_TCP, TCP_NODELAY, &at_once, sizeof at_once);
  return socket;
}

/// The first address that answers; a name may stand for IPv4 and IPv6.
base::Result<FileDescriptor> connect_any(const std::vector<Address>& addresses, const Wake& wake) {
  base::Result<FileDescriptor> connection = base::fail(ErrorCode::kDevice, "no address");
  for (const Address& address : addresses) {
    connection = connect(address, wake);
    if (connection) break;
  }
  return connection;
}

}  // namespace

base::Result<std::unique_ptr<AxisReader>> connect_tcp_axis(TcpAxisOptions options, Clock clock) {
  if (auto valid = options.dialogue.validate(); !valid) return base::fail(std::move(valid));
  if (options.port < 1 || options.port > 65535) {
    return base::fail(ErrorCode::kUsage, fmt::format("axis port {}: ports are 1 to 65535", options.port));
  }
  auto addresses = resolve(options);
  if (!addresses) return base::fail(std::move(addresses));
  detail::Transport transport{
      .source = fmt::format("axis {}:{}", options.host, options.port),
      .open = [addresses = std::move(*addresses)](const Wake& wake) { return connect_any(addresses, wake); },
  };
  return std::make_unique<detail::AxisLink>(std::move(transport), std::move(options.dialogue), std::move(clock));
}

}  // namespace crosstie::devices
