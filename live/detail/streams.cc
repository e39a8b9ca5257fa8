#include "live/detail/streams.h"

#include <algorithm>
#include <condition_variable>
#include <mutex>

#include <fmt/format.h>

#include "devices/host_time.h"

namespace crosstie::live::detail {
namespace {

using devices::host_now;
using devices::seconds_between;

/// How long a client that has gone keeps its place while there is nothing to send.
constexpr double kLook_s = 0.1;

void pause(double seconds, const std::stop_token& stop) {
  std::mutex mutex;
  std::unique_lock lock(mutex);
  std::condition_variable_any never;
  never.wait_for(lock, stop, devices::to_nanoseconds(seconds), [] { return false; });
}

}  // namespace

std::string event_text(std::uint64_t version, std::string_view json) {
  std::string text = fmt::format("event: state\nid: {}\ndata: {}", version, json);
  std::replace_if(
      text.end() - static_cast<std::ptrdiff_t>(json.size()), text.end(), [](char one) { return one == '\n' || one == '\r'; },
      ' ');
  return text + "\n\n";
}

std::string part_begin(std::size_t bytes) {
  return fmt::format("Content-Type: image/jpeg\r\nContent-Length: {}\r\n\r\n", bytes);
}

std::string_view part_end() { return "\r\n--crosstie-picture\r\n"; }

void send_events(Newest<std::string>& state, const StreamPace& pace, const std::stop_token& stop, const StreamSink& sink) {
  std::uint64_t seen = 0;
  auto sent = host_now();
  if (!sink.write("retry: 1000\n\n")) return;
  while (!stop.stop_requested() && sink.alive()) {
    const double silent_s = seconds_between(sent, host_now());
    if (const auto newer = state.wait_newer(seen, std::clamp(pace.heartbeat_s - silent_s, 0.0, kLook_s), stop)) {
      seen = newer->version;
      sent = host_now();
      if (!sink.write(event_text(newer->version, newer->value))) return;
      pause(pace.min_event_interval_s - seconds_between(sent, host_now()), stop);
    } else if (seconds_between(sent, host_now()) >= pace.heartbeat_s) {
      sent = host_now();
      if (!sink.write(": here\n\n")) return;
    }
  }
}

void send_pictures(Newest<std::string>& pictures, const std::stop_token& stop, const StreamSink& sink) {
  std::uint64_t seen = 0;
  if (!sink.write(part_end().substr(2))) return;
  while (!stop.stop_requested() && sink.alive()) {
    const auto newer = pictures.wait_newer(seen, kLook_s, stop);
    if (!newer) continue;
    seen = newer->version;
    if (!sink.write(part_begin(newer->value.size())) || !sink.write(newer->value) || !sink.write(part_end())) return;
  }
}

}  // namespace crosstie::live::detail
