#pragma once

#include <functional>
#include <mutex>
#include <optional>
#include <stop_token>
#include <string>
#include <string_view>
#include <thread>

#include "base/file_descriptor.h"
#include "base/result.h"
#include "devices/axis_reader.h"
#include "devices/axis_stream.h"
#include "devices/detail/line_splitter.h"
#include "devices/detail/wake.h"

namespace crosstie::devices::detail {

/// What tells one kind of connection from another.
struct Transport {
  std::string source;                                                   ///< AxisState::source
  std::function<base::Result<base::FileDescriptor>(const Wake&)> open;  ///< not blocking; gives up when woken
  bool begins_within_a_line = false;
};

/// Receives lines over one transport in a thread of its own and keeps the latest position.
class AxisLink : public AxisReader {
 public:
  AxisLink(Transport transport, AxisDialogue dialogue, Clock clock);
  ~AxisLink() override;
  [[nodiscard]] AxisState state() override;

 private:
  void run(const std::stop_token& stop);
  /// Until the connection ends; what ended it.
  std::string receive(const base::FileDescriptor& connection, const std::stop_token& stop);
  /// Error: the connection is over.
  base::Result<> read_available(const base::FileDescriptor& connection, LineSplitter& lines);
  base::Result<> send_request(const base::FileDescriptor& connection) const;
  void take_line(std::string_view line, HostTime time);
  void note(std::string trouble);

  Transport transport_;
  AxisDialogue dialogue_;
  Clock clock_;
  std::mutex mutex_;  ///< of the two below
  std::optional<AxisReading> latest_;
  std::string trouble_ = "not connected yet";
  Wake wake_;
  std::jthread thread_;  ///< last: it ends before what it uses
};

}  // namespace crosstie::devices::detail
