#pragma once

#include <cstddef>
#include <stdexcept>
#include <string>
#include <string_view>

#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

namespace crosstie::tests {

/// A control's side of a connection on a free port of 127.0.0.1. What does not happen within 30 s throws.
class LineServer {
 public:
  enum class Listens { kYes, kNo };  ///< kNo: the port is taken, but connections are refused

  explicit LineServer(Listens listens = Listens::kYes) : listener_(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t size = sizeof address;
    auto* bytes = reinterpret_cast<sockaddr*>(&address);
    if (::bind(listener_, bytes, size) != 0 || (listens == Listens::kYes && ::listen(listener_, 4) != 0) ||
        ::getsockname(listener_, bytes, &size) != 0) {
      throw std::runtime_error("no port to listen on");
    }
    port_ = ntohs(address.sin_port);
  }
  LineServer(const LineServer&) = delete;
  LineServer& operator=(const LineServer&) = delete;
  ~LineServer() {
    hang_up();
    ::close(listener_);
  }

  [[nodiscard]] int port() const { return port_; }
  void accept() {
    hang_up();
    await(listener_);
    connection_ = ::accept(listener_, nullptr, nullptr);
  }
  void send(std::string_view bytes) const {
    while (!bytes.empty()) {
      const ssize_t sent = ::send(connection_, bytes.data(), bytes.size(), MSG_NOSIGNAL);
      if (sent <= 0) throw std::runtime_error("the reader is gone");
      bytes.remove_prefix(static_cast<std::size_t>(sent));
    }
  }
  /// As many bytes as `size` says.
  [[nodiscard]] std::string receive(std::size_t size) const {
    std::string bytes;
    while (bytes.size() < size) {
      char byte = 0;
      await(connection_);
      if (::recv(connection_, &byte, 1, 0) != 1) throw std::runtime_error("the reader is gone");
      bytes += byte;
    }
    return bytes;
  }
  /// Whether the reader closes the connection.
  [[nodiscard]] bool closed_by_reader() const {
    char byte = 0;
    await(connection_);
    return ::recv(connection_, &byte, 1, 0) <= 0;
  }
  void hang_up() {
    if (connection_ >= 0) ::close(connection_);
    connection_ = -1;
  }

 private:
  static void await(int descriptor) {
    pollfd watched{descriptor, POLLIN, 0};
    if (::poll(&watched, 1, 30'000) != 1) throw std::runtime_error("the reader does not answer");
  }

  int listener_;
  int connection_ = -1;
  int port_ = 0;
};

}  // namespace crosstie::tests
