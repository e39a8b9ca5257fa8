#include "live/detail/listener.h"

#include <cerrno>
#include <memory>
#include <utility>

#include <netdb.h>
#include <netinet/in.h>
#include <sys/socket.h>

#include <fmt/format.h>

#include "base/file.h"

namespace crosstie::live::detail {
namespace {

using base::ErrorCode;
using base::FileDescriptor;

constexpr int kBacklog = 64;

std::string what_to_do(int error) {
  switch (error) {
    case EADDRINUSE:
      return "it is taken: end the program that listens there (another crosstie live?), or choose another port (0: any free "
             "one)";
    case EACCES:
      return "ports below 1024 are the administrator's: choose one above";
    case EADDRNOTAVAIL:
      return "this computer does not have this address: 127.0.0.1 is reached from itself only, 0.0.0.0 from everywhere";
    default:
      return std::generic_category().message(error);
  }
}

int port_of(const FileDescriptor& socket) {
  sockaddr_storage address{};
  socklen_t size = sizeof address;
  ::getsockname(socket.number(), reinterpret_cast<sockaddr*>(&address), &size);
  // The port stands at the same place for IPv4 and IPv6.
  return ntohs(reinterpret_cast<const sockaddr_in*>(&address)->sin_port);
}

}  // namespace

std::string host_and_port(const std::string& address, int port) {
  return address.find(':') == std::string::npos ? fmt::format("{}:{}", address, port) : fmt::format("[{}]:{}", address, port);
}

base::Result<Listener> listen_at(const std::string& address, int port) {
  addrinfo hints{};
  hints.ai_family = AF_UNSPEC;
  hints.ai_socktype = SOCK_STREAM;
  hints.ai_flags = AI_PASSIVE;
  addrinfo* list = nullptr;
  if (const int failed = ::getaddrinfo(address.c_str(), std::to_string(port).c_str(), &hints, &list); failed != 0) {
    return base::fail(ErrorCode::kDevice, fmt::format("the page's address \"{}\" is not known: {}; 127.0.0.1 is this computer",
                                                      base::shown(address), ::gai_strerror(failed)));
  }
  const std::unique_ptr<addrinfo, void (*)(addrinfo*)> found(list, ::freeaddrinfo);
  int error = EADDRNOTAVAIL;
  for (const addrinfo* one = found.get(); one != nullptr; one = one->ai_next) {
    FileDescriptor socket(::socket(one->ai_family, SOCK_STREAM | SOCK_CLOEXEC, 0));
    // So that connections of a server before, which the kernel still remembers, do not hold the port. Unlike SO_REUSEPORT it never
    // lets two programs listen there at once.
    const int reuse = 1;
    if (socket.valid() && ::setsockopt(socket.number(), SOL_SOCKET, SO_REUSEADDR, &reuse, sizeof reuse) == 0 &&
        ::bind(socket.number(), one->ai_addr, one->ai_addrlen) == 0 && ::listen(socket.number(), kBacklog) == 0) {
      const int taken = port_of(socket);
      return Listener{std::move(socket), taken};
    }
    error = errno;
    if (error == EADDRINUSE) break;  // the same name at another address would be a surprise
  }
  return base::fail(ErrorCode::kDevice,
                    fmt::format("the page cannot be served at {}: {}", host_and_port(address, port), what_to_do(error)));
}

}  // namespace crosstie::live::detail
