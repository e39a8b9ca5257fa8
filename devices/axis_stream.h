#pragma once

#include <filesystem>
#include <memory>
#include <string>

#include "base/result.h"
#include "devices/axis_line.h"
#include "devices/axis_reader.h"

namespace crosstie::devices {

/// How a control is talked to, line by line (docs/devices.md).
struct AxisDialogue {
  AxisLineFormat line = {};
  /// Sent on connecting and every `period_s` where the control answers questions only, e.g. "get abs_act_pos\r\n"; empty: it
  /// sends by itself.
  std::string request = {};
  double period_s = 0.1;
  /// A connection on which nothing arrives for so long is closed and made anew: a cable that was pulled ends no connection by itself.
  double silence_s = 5.0;
  double retry_s = 0.5;  ///< between two attempts to connect

  [[nodiscard]] base::Result<> validate() const;
};

struct TcpAxisOptions {
  std::string host;  ///< a name or an address, resolved once
  int port = 0;      ///< 1 to 65535
  AxisDialogue dialogue = {};
};

enum class Parity { kNone, kEven, kOdd };

struct SerialAxisOptions {
  std::filesystem::path device;  ///< /dev/serial/by-id/... stays the same when others are plugged in
  int baud = 9600;               ///< one of the standard rates from 1200 to 230400
  int data_bits = 8;             ///< 7 or 8
  int stop_bits = 1;             ///< 1 or 2
  Parity parity = Parity::kNone;
  AxisDialogue dialogue = {};
};

/// Both readers receive in a thread of their own that ends with them. A reading's time is that at which its line's end was received.
/// Connections that fail or break are made anew for as long as the reader lives; until then the reading ages. Lines that are no
/// position, binary rubbish and lines over kMaxAxisLineBytes are dropped and told of in `trouble`.
///
/// Errors: kUsage for options out of their domain, kDevice for a host name that has no address. A control that is switched off is
/// none.
base::Result<std::unique_ptr<AxisReader>> connect_tcp_axis(TcpAxisOptions options, Clock clock = host_now);

/// A serial port, opened for this reader alone. The first line after opening is dropped: its begin may be missing.
base::Result<std::unique_ptr<AxisReader>> open_serial_axis(SerialAxisOptions options, Clock clock = host_now);

}  // namespace crosstie::devices
