#pragma once

#include <cstdint>
#include <functional>
#include <stop_token>
#include <string>
#include <string_view>

#include "live/feed.h"

namespace crosstie::live::detail {

inline constexpr std::string_view kEventsType = "text/event-stream";
inline constexpr std::string_view kPicturesType = "multipart/x-mixed-replace; boundary=crosstie-picture";

/// The client's end of a stream.
struct StreamSink {
  std::function<bool(std::string_view)> write;  ///< false: the client is gone or does not read
  std::function<bool()> alive;                  ///< false: the client is gone
};

struct StreamPace {
  double heartbeat_s = 5.0;
  double min_event_interval_s = 0.1;
};

/// One server-sent event "state". Its data is one line: line ends of JSON text, which stand between its words only, become blanks.
[[nodiscard]] std::string event_text(std::uint64_t version, std::string_view json);

/// What stands before a picture of so many bytes, and after it. The boundary that begins the next part follows its picture at once, since
/// browsers show a part when it has ended.
[[nodiscard]] std::string part_begin(std::size_t bytes);
[[nodiscard]] std::string_view part_end();

/// Sends the newest state whenever there is a newer one, a comment as sign of life; until the client is gone or asked to stop.
void send_events(Newest<std::string>& state, const StreamPace& pace, const std::stop_token& stop, const StreamSink& sink);

/// Sends the newest picture whenever there is a newer one.
void send_pictures(Newest<std::string>& pictures, const std::stop_token& stop, const StreamSink& sink);

}  // namespace crosstie::live::detail
