#pragma once

#include <algorithm>
#include <chrono>
#include <stdexcept>
#include <string_view>
#include <thread>

#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

namespace crosstie::tests {

/// GigE Vision has one port for all cameras of an address: tests that run at the same time take turns. A name in the abstract namespace of
/// local sockets belongs to one process of the host, like the port, and is free again when that ends.
class GigeTurn {
 public:
  GigeTurn() : socket_(::socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0)) {
    sockaddr_un name{};
    name.sun_family = AF_UNIX;
    constexpr std::string_view kName = "crosstie-gige-tests";
    std::copy(kName.begin(), kName.end(), name.sun_path + 1);
    const auto end = std::chrono::steady_clock::now() + std::chrono::minutes(5);
    while (::bind(socket_, reinterpret_cast<const sockaddr*>(&name), sizeof name) != 0) {
      if (std::chrono::steady_clock::now() > end) throw std::runtime_error("other tests keep the port of GigE cameras");
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
  }
  GigeTurn(const GigeTurn&) = delete;
  GigeTurn& operator=(const GigeTurn&) = delete;
  ~GigeTurn() { ::close(socket_); }

 private:
  int socket_;
};

}  // namespace crosstie::tests
