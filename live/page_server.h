#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <string>

#include "base/result.h"
#include "live/feed.h"

namespace crosstie::live {

struct PageServerOptions {
  /// The numeric address or the name to listen at. The default is reached from this computer only; with any other, everyone in that
  /// network may watch, and whoever has the token may command: there is no encryption.
  std::string address = "127.0.0.1";
  int port = 8137;                ///< 1 to 65535; 0: any free one
  std::string token;              ///< what commands must carry: 16 to 128 letters, digits, - or _ (make_token)
  std::filesystem::path results;  ///< folder that /results/ shows; it may come later. Empty: none is shown
  int max_clients = 12;           ///< event and picture streams at a time, 1 to 64; as many short requests beside them

  double timeout_s = 5.0;             ///< for the head of a request, for its body, and for 64 KiB of an answer, 0.01 to 60
  double heartbeat_s = 5.0;           ///< after that long without an event a comment is sent, 0.01 to 60
  double min_event_interval_s = 0.1;  ///< events come no faster, 0 to 10

  /// kUsage, naming the option.
  [[nodiscard]] base::Result<> validate() const;
};

/// 128 bits of the system's random source, in hexadecimal digits.
std::string make_token();

/// Takes the body of a command as it came (at most 64 KiB, not yet known to be JSON). It must answer soon: long work belongs to another
/// thread. It is called on a connection's thread, for one command at a time. An error goes to the page with its message and the status
/// 400 for kUsage, 422 for kBadInput, 409 for kNoUniqueSolution and kCancelled, 502 for kDevice, and 500 for the others.
using CommandHandler = std::function<base::Result<>(const std::string& body_json)>;

/// The HTTP server of the operator's page (docs/live.md has the protocol). It answers on threads of its own until it is destroyed, which
/// ends all connections at once; a command that is being handled is waited for.
class PageServer {
 public:
  /// The feed must outlive the server. Errors: kUsage for options out of their domain; kDevice where the address or the port cannot be
  /// had, saying what to do.
  static base::Result<std::unique_ptr<PageServer>> start(PageServerOptions options, Feed& feed, CommandHandler handler);
  ~PageServer();
  PageServer(const PageServer&) = delete;
  PageServer& operator=(const PageServer&) = delete;

  /// With the token in its fragment, which a browser sends nowhere: what the program prints.
  [[nodiscard]] std::string url() const;
  [[nodiscard]] int port() const;

 private:
  class Impl;
  explicit PageServer(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace crosstie::live
