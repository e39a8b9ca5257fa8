#pragma once

#include <cstdio>
#include <cstring>
#include <fstream>
#include <memory>
#include <mutex>
#include <string>
#include <string_view>
#include <vector>

#include <gtest/gtest.h>

#include "live/page_server.h"
#include "tests/live/raw_client.h"
#include "tests/support/temporary_folder.h"

namespace crosstie::live {

inline constexpr std::string_view kToken = "0123456789abcdef";

/// A server at a free port, its feed and its results folder.
class ServerTest : public testing::Test {
 protected:
  void start(PageServerOptions options = {}) {
    options.port = 0;
    if (options.token.empty()) options.token = kToken;
    if (options.results.empty()) options.results = folder.path();
    auto made = PageServer::start(std::move(options), feed, [this](const std::string& body) -> base::Result<> {
      const std::lock_guard lock(mutex_);
      commands_.push_back(body);
      return reply;
    });
    ASSERT_TRUE(made) << made.error().message;
    server = std::move(*made);
  }

  [[nodiscard]] tests::RawClient connect(int receive_buffer = 0) const {
    return tests::RawClient(server->port(), receive_buffer);
  }
  [[nodiscard]] std::string own_host() const { return "127.0.0.1:" + std::to_string(server->port()); }

  /// A request with our own Host; `fields` are whole lines.
  [[nodiscard]] std::string request(std::string_view method, std::string_view path, std::string_view fields = "") const {
    return fmt::format("{} {} HTTP/1.1\r\nHost: {}\r\n{}\r\n", method, path, own_host(), fields);
  }
  [[nodiscard]] tests::RawAnswer ask(std::string_view text) const {
    auto client = connect();
    client.send(text);
    return client.answer();
  }
  [[nodiscard]] tests::RawAnswer get(std::string_view path, std::string_view fields = "") const {
    return ask(request("GET", path, fields));
  }
  [[nodiscard]] tests::RawAnswer post(std::string_view body, std::string_view fields) const {
    return ask(request("POST", "/command", fmt::format("{}Content-Length: {}\r\n", fields, body.size())) + std::string(body));
  }
  [[nodiscard]] static std::string token_field(std::string_view token = kToken) {
    return fmt::format("X-Crosstie-Token: {}\r\n", token);
  }

  /// Opens a stream and reads the head of its answer; 200 is expected.
  [[nodiscard]] tests::RawClient open_stream(std::string_view path, int receive_buffer = 0) const {
    auto client = connect(receive_buffer);
    client.send(request("GET", path));
    const std::string head = client.take_until("\r\n\r\n");
    EXPECT_TRUE(head.starts_with("HTTP/1.1 200 ")) << head;
    return client;
  }

  [[nodiscard]] std::vector<std::string> commands() {
    const std::lock_guard lock(mutex_);
    return commands_;
  }

  Feed feed;
  tests::TemporaryFolder folder;
  base::Result<> reply;  ///< of the command handler
  std::unique_ptr<PageServer> server;

 private:
  std::mutex mutex_;
  std::vector<std::string> commands_;
};

/// Largest memory that the process ever had, KiB; 0 under the address sanitizer, which keeps what is freed.
inline long peak_kib() {
#ifdef __SANITIZE_ADDRESS__
  return 0;
#endif
  std::ifstream status("/proc/self/status");
  for (std::string line; std::getline(status, line);) {
    if (line.starts_with("VmHWM:")) return std::atol(line.c_str() + 6);
  }
  return 0;
}
/// Lets peak_kib() begin anew at what the process has now.
inline void reset_peak() { std::ofstream("/proc/self/clear_refs") << "5"; }

}  // namespace crosstie::live
