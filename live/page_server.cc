#include "live/page_server.h"

#include <chrono>
#include <cmath>
#include <cstddef>
#include <string_view>
#include <utility>

#include <fmt/format.h>

#include "live/detail/answer.h"
#include "live/detail/exchange.h"
#include "live/detail/listener.h"
#include "live/detail/page.h"
#include "live/detail/token.h"
#include "live/detail/workers.h"

namespace crosstie::live {
namespace {

using base::ErrorCode;
using detail::Connection;

/// Threads that tell those who come too many so.
constexpr std::size_t kRefusers = 4;
constexpr std::chrono::milliseconds kLinger{1000};
constexpr std::chrono::milliseconds kShortLinger{300};

/// An address at which a browser on this computer finds the page.
std::string shown_address(const std::string& address) {
  return address == "0.0.0.0" ? "127.0.0.1" : address == "::" ? "::1" : address;
}

}  // namespace

base::Result<> PageServerOptions::validate() const {
  const auto wrong = [](std::string text) { return base::fail(ErrorCode::kUsage, std::move(text)); };
  if (address.empty()) return wrong("the page needs an address to be served at: 127.0.0.1 is this computer");
  if (port < 0 || port > 65535) return wrong(fmt::format("port {}: ports are 1 to 65535, and 0 is any free one", port));
  if (!detail::valid_token(token)) return wrong("the token needs 16 to 128 letters, digits, - or _");
  if (max_clients < 1 || max_clients > 64) return wrong(fmt::format("{} clients: 1 to 64 are possible", max_clients));
  for (const auto& [name, value, low, high] :
       {std::tuple{"time-out", timeout_s, 0.01, 60.0}, std::tuple{"heartbeat", heartbeat_s, 0.01, 60.0},
        std::tuple{"interval of events", min_event_interval_s, 0.0, 10.0}}) {
    if (!(value >= low && value <= high))
      return wrong(fmt::format("{} of {} s: {} to {} s are possible", name, value, low, high));
  }
  return {};
}

class PageServer::Impl {
 public:
  Impl(PageServerOptions options, Feed& feed, CommandHandler handler, detail::Listener listener)
      : options_(std::move(options)),
        port_(listener.port),
        requests_(options_.max_clients),
        site_{.feed = feed,
              .handler = std::move(handler),
              .handling = {},
              .guard = detail::Guard(options_.address, port_, options_.token),
              .results = options_.results,
              .page = detail::index_html(),
              .page_policy = detail::page_policy(detail::index_html()),
              .scene_tag = make_token(),
              .pace = {options_.heartbeat_s, options_.min_event_interval_s},
              .streams = detail::Slots(options_.max_clients),
              .stop = stop_.get_token()},
        workers_(std::move(listener.socket), 2 * static_cast<std::size_t>(options_.max_clients) + kRefusers,
                 devices::to_nanoseconds(options_.timeout_s), [this](Connection& connection) { serve(connection); }) {}
  ~Impl() { stop_.request_stop(); }
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;

  [[nodiscard]] std::string url() const {
    return fmt::format("http://{}/#{}", detail::host_and_port(shown_address(options_.address), port_), options_.token);
  }
  [[nodiscard]] int port() const { return port_; }

 private:
  void serve(Connection& connection) {
    detail::Slot slot = requests_.take();
    if (!slot.taken()) {
      connection.write(detail::refusal_text({503, "too many connections: close a window that shows this page"}));
      connection.end(kShortLinger);
      return;
    }
    detail::exchange(connection, site_, slot);
    connection.end(kLinger);
  }

  PageServerOptions options_;
  int port_;
  std::stop_source stop_;
  detail::Slots requests_;
  detail::Site site_;
  detail::Workers workers_;  ///< last: its threads end before what they use
};

base::Result<std::unique_ptr<PageServer>> PageServer::start(PageServerOptions options, Feed& feed, CommandHandler handler) {
  if (auto valid = options.validate(); !valid) return base::fail(std::move(valid));
  auto listener = detail::listen_at(options.address, options.port);
  if (!listener) return base::fail(std::move(listener));
  auto impl = std::make_unique<Impl>(std::move(options), feed, std::move(handler), std::move(*listener));
  return std::unique_ptr<PageServer>(new PageServer(std::move(impl)));
}

PageServer::PageServer(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
PageServer::~PageServer() = default;

std::string PageServer::url() const { return impl_->url(); }
int PageServer::port() const { return impl_->port(); }

}  // namespace crosstie::live
