#include "devices/detail/axis_link.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <cstddef>
#include <utility>

#include <poll.h>
#include <sys/socket.h>

#include <fmt/format.h>

#include "devices/detail/shown_line.h"

namespace crosstie::devices {

using base::ErrorCode;

base::Result<> AxisDialogue::validate() const {
  if (auto valid = line.validate(); !valid) return valid;
  for (const auto& [name, value_s] : {std::pair{"period_s", period_s}, {"silence_s", silence_s}, {"retry_s", retry_s}}) {
    if (!(value_s > 0.0) || value_s > 3600.0) {
      return base::fail(ErrorCode::kUsage, fmt::format("axis: {} = {} must lie above 0 and within 3600 s", name, value_s));
    }
  }
  if (request.size() > kMaxAxisLineBytes)
    return base::fail(ErrorCode::kUsage, "axis: the request is longer than a line may be");
  return {};
}

namespace detail {

using std::chrono::steady_clock;

AxisLink::AxisLink(Transport transport, AxisDialogue dialogue, Clock clock)
    : transport_(std::move(transport)),
      dialogue_(std::move(dialogue)),
      clock_(std::move(clock)),
      thread_([this](const std::stop_token& stop) { run(stop); }) {}

AxisLink::~AxisLink() {
  thread_.request_stop();
  wake_.call();
}

AxisState AxisLink::state() {
  const std::lock_guard lock(mutex_);
  return {transport_.source, latest_, trouble_};
}

void AxisLink::run(const std::stop_token& stop) {
  while (!stop.stop_requested()) {
    const base::Result<base::FileDescriptor> connection = transport_.open(wake_);
    if (connection) {
      note("connected, nothing received yet");
      note(receive(*connection, stop));
    } else {
      note("not connected: " + connection.error().message);
    }
    (void)wake_.wait({}, 0, to_nanoseconds(dialogue_.retry_s));
  }
}

std::string AxisLink::receive(const base::FileDescriptor& connection, const std::stop_token& stop) {
  LineSplitter lines(kMaxAxisLineBytes);
  if (transport_.begins_within_a_line) lines.skip_to_line_end();
  auto heard = steady_clock::now();
  auto next_request = heard;
  while (!stop.stop_requested()) {
    if (!dialogue_.request.empty() && steady_clock::now() >= next_request) {
      if (const auto sent = send_request(connection); !sent) return "connection lost: " + sent.error().message;
      next_request = steady_clock::now() + to_nanoseconds(dialogue_.period_s);
    }
    const auto silent_at = heard + to_nanoseconds(dialogue_.silence_s);
    const auto until = dialogue_.request.empty() ? silent_at : std::min(silent_at, next_request);
    const Wake::Event event = wake_.wait(connection, POLLIN, until - steady_clock::now());
    if (event == Wake::Event::kReady) {
      if (const auto read = read_available(connection, lines); !read) return "connection lost: " + read.error().message;
      heard = steady_clock::now();
    } else if (event == Wake::Event::kTimeout && steady_clock::now() >= silent_at) {
      return fmt::format("connection given up: nothing received for {} s", dialogue_.silence_s);
    }
  }
  return "closed";
}

base::Result<> AxisLink::read_available(const base::FileDescriptor& connection, LineSplitter& lines) {
  std::array<char, 4096> bytes{};
  const ssize_t count = ::read(connection.number(), bytes.data(), bytes.size());
  if (count < 0 && (errno == EAGAIN || errno == EINTR)) return {};
  if (count < 0) return base::fail(ErrorCode::kDevice, base::last_system_error());
  if (count == 0) return base::fail(ErrorCode::kDevice, "the other side closed it");
  const HostTime time = clock_();
  lines.push(
      {bytes.data(), static_cast<std::size_t>(count)}, [&](std::string_view line) { take_line(line, time); },
      [&](std::string_view begin) {
        note(fmt::format("a line of more than {} bytes was dropped: \"{}\"", kMaxAxisLineBytes, shown_line(begin)));
      });
  return {};
}

base::Result<> AxisLink::send_request(const base::FileDescriptor& connection) const {
  // A full buffer takes no more: the control does not read, and its silence ends the connection.
  const std::string& request = dialogue_.request;
  ssize_t written = ::send(connection.number(), request.data(), request.size(), MSG_NOSIGNAL);
  if (written < 0 && errno == ENOTSOCK) written = ::write(connection.number(), request.data(), request.size());
  if (written < 0 && errno != EAGAIN && errno != EINTR) return base::fail(ErrorCode::kDevice, base::last_system_error());
  return {};
}

void AxisLink::take_line(std::string_view line, HostTime time) {
  const base::Result<double> position_mm = parse_axis_line(line, dialogue_.line);
  if (!position_mm) return note(position_mm.error().message);
  const std::lock_guard lock(mutex_);
  latest_ = AxisReading{*position_mm, time};
  trouble_.clear();
}

void AxisLink::note(std::string trouble) {
  const std::lock_guard lock(mutex_);
  trouble_ = std::move(trouble);
}

}  // namespace detail
}  // namespace crosstie::devices
