#pragma once

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <cstdlib>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>

#include <fmt/format.h>

#include "base/file_descriptor.h"

namespace crosstie::tests {

/// An answer as it stands on the wire.
struct RawAnswer {
  int status = 0;  ///< 0: the connection ended without an answer
  std::vector<std::pair<std::string, std::string>> fields;
  std::string body;

  /// The field's value; fails where it does not come exactly once.
  [[nodiscard]] std::string field(std::string_view name) const {
    std::string value;
    int count = 0;
    for (const auto& [one, text] : fields) {
      if (one != name) continue;
      value = text;
      ++count;
    }
    return count == 1 ? value : fmt::format("(field {} comes {} times)", name, count);
  }
  [[nodiscard]] bool has(std::string_view name) const {
    return std::any_of(fields.begin(), fields.end(), [&](const auto& one) { return one.first == name; });
  }
};

/// A TCP client of 127.0.0.1 that writes what it is told, polite or not. What does not happen within 10 s throws.
class RawClient {
 public:
  /// `receive_buffer`: bytes that the kernel keeps for us; 0 leaves it to the kernel.
  explicit RawClient(int port, int receive_buffer = 0) : socket_(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
    if (receive_buffer > 0) {
      ::setsockopt(socket_.number(), SOL_SOCKET, SO_RCVBUF, &receive_buffer, sizeof receive_buffer);
    }
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    address.sin_port = htons(static_cast<std::uint16_t>(port));
    if (::connect(socket_.number(), reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) {
      throw std::runtime_error("no connection: " + base::last_system_error());
    }
  }

  /// False where the server does not take it any more.
  bool send(std::string_view text) {
    while (!text.empty()) {
      const ssize_t sent = ::send(socket_.number(), text.data(), text.size(), MSG_NOSIGNAL);
      if (sent <= 0) return false;
      text.remove_prefix(static_cast<std::size_t>(sent));
    }
    return true;
  }

  /// Reads until `bytes` holds `text`; false where the connection ends before.
  bool read_until(std::string_view text) {
    std::size_t from = 0;
    while (bytes.find(text, from) == std::string::npos) {
      from = bytes.size() < text.size() ? 0 : bytes.size() - text.size() + 1;
      if (!read_some()) return false;
    }
    return true;
  }
  bool read_size(std::size_t size) {
    while (bytes.size() < size) {
      if (!read_some()) return false;
    }
    return true;
  }
  /// To the end of the connection.
  void read_all() {
    while (read_some()) {
    }
  }
  /// Takes what `read_until` found, with the text.
  [[nodiscard]] std::string take_until(std::string_view text) {
    if (!read_until(text)) throw std::runtime_error("the connection ended early");
    return take_size(bytes.find(text) + text.size());
  }
  [[nodiscard]] std::string take_size(std::size_t size) {
    if (!read_size(size)) throw std::runtime_error("the connection ended early");
    std::string taken = bytes.substr(0, size);
    bytes.erase(0, size);
    return taken;
  }

  /// Reads to the end of the connection.
  [[nodiscard]] RawAnswer answer() {
    read_all();
    RawAnswer answer;
    if (bytes.empty()) return answer;
    const std::size_t end = bytes.find("\r\n\r\n");
    if (end == std::string::npos || !bytes.starts_with("HTTP/1.1 ")) throw std::runtime_error("no HTTP: " + bytes);
    answer.status = std::atoi(bytes.substr(9, 3).c_str());
    for (std::size_t begin = bytes.find("\r\n") + 2; begin < end + 2;) {
      const std::size_t line_end = bytes.find("\r\n", begin), colon = bytes.find(": ", begin);
      if (colon >= line_end) throw std::runtime_error("no field: " + bytes);
      answer.fields.emplace_back(bytes.substr(begin, colon - begin), bytes.substr(colon + 2, line_end - colon - 2));
      begin = line_end + 2;
    }
    answer.body = bytes.substr(end + 4);
    return answer;
  }

  void hang_up() { socket_.close(); }
  void finish_sending() { ::shutdown(socket_.number(), SHUT_WR); }

  std::string bytes;  ///< read and not yet taken

 private:
  bool read_some() {
    pollfd watched{socket_.number(), POLLIN, 0};
    if (::poll(&watched, 1, 10'000) != 1) throw std::runtime_error("the server is silent");
    std::string some(65'536, '\0');
    const ssize_t count = ::recv(socket_.number(), some.data(), some.size(), 0);
    if (count <= 0) return false;
    bytes.append(some, 0, static_cast<std::size_t>(count));
    return true;
  }

  base::FileDescriptor socket_;
};

}  // namespace crosstie::tests
