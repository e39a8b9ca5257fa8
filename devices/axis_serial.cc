#include <algorithm>
#include <array>
#include <memory>
#include <optional>
#include <utility>

#include <fcntl.h>
#include <sys/ioctl.h>
#include <termios.h>

#include <fmt/format.h>

#include "base/file.h"
#include "devices/axis_stream.h"
#include "devices/detail/axis_link.h"

namespace crosstie::devices {
namespace {

using base::ErrorCode;
using base::FileDescriptor;

constexpr std::array<std::pair<int, speed_t>, 9> kRates = {{{1200, B1200},
                                                            {2400, B2400},
                                                            {4800, B4800},
                                                            {9600, B9600},
                                                            {19200, B19200},
                                                            {38400, B38400},
                                                            {57600, B57600},
                                                            {115200, B115200},
                                                            {230400, B230400}}};

std::optional<speed_t> rate_of(int baud) {
  const auto found = std::find_if(kRates.begin(), kRates.end(), [&](const auto& rate) { return rate.first == baud; });
  return found == kRates.end() ? std::nullopt : std::optional(found->second);
}

/// Bytes as they come: no echo, no signals, no translation of line ends, modem lines ignored. Damaged bytes are passed on as NUL,
/// which makes their line refused instead of one digit shorter.
void set_line(termios& line, const SerialAxisOptions& options, speed_t rate) {
  ::cfmakeraw(&line);
  line.c_iflag &= ~static_cast<tcflag_t>(IGNPAR | IXON | IXOFF | IXANY);
  if (options.parity != Parity::kNone) line.c_iflag |= INPCK;
  line.c_cflag &= ~static_cast<tcflag_t>(CSIZE | PARENB | PARODD | CSTOPB | CRTSCTS);
  line.c_cflag |= CLOCAL | CREAD | (options.data_bits == 7 ? CS7 : CS8);
  if (options.parity != Parity::kNone) line.c_cflag |= PARENB;
  if (options.parity == Parity::kOdd) line.c_cflag |= PARODD;
  if (options.stop_bits == 2) line.c_cflag |= CSTOPB;
  line.c_cc[VMIN] = 1;
  line.c_cc[VTIME] = 0;
  ::cfsetispeed(&line, rate);
  ::cfsetospeed(&line, rate);
}

base::Result<FileDescriptor> open_port(const SerialAxisOptions& options, speed_t rate) {
  FileDescriptor port(::open(options.device.c_str(), O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC));
  if (!port.valid()) return base::fail(ErrorCode::kDevice, base::last_system_error());
  termios line{};
  if (::tcgetattr(port.number(), &line) != 0) return base::fail(ErrorCode::kDevice, "it is no serial port");
  set_line(line, options, rate);
  // tcsetattr() succeeds when any of the changes could be made: what was taken over is read back.
  termios taken{};
  if (::tcsetattr(port.number(), TCSANOW, &line) != 0 || ::tcgetattr(port.number(), &taken) != 0) {
    return base::fail(ErrorCode::kDevice, base::last_system_error());
  }
  constexpr tcflag_t kFrame = CSIZE | PARENB | PARODD | CSTOPB;
  if (::cfgetispeed(&taken) != rate || (taken.c_cflag & kFrame) != (line.c_cflag & kFrame)) {
    return base::fail(ErrorCode::kDevice,
                      fmt::format("the port does not do {} baud with {} data bits, {} stop bits and this parity", options.baud,
                                  options.data_bits, options.stop_bits));
  }
  if (::ioctl(port.number(), TIOCEXCL) != 0) return base::fail(ErrorCode::kDevice, base::last_system_error());
  ::tcflush(port.number(), TCIFLUSH);
  return port;
}

}  // namespace

base::Result<std::unique_ptr<AxisReader>> open_serial_axis(SerialAxisOptions options, Clock clock) {
  if (auto valid = options.dialogue.validate(); !valid) return base::fail(std::move(valid));
  const std::optional<speed_t> rate = rate_of(options.baud);
  if (!rate)
    return base::fail(ErrorCode::kUsage, fmt::format("axis: {} baud is no standard rate from 1200 to 230400", options.baud));
  if (options.data_bits < 7 || options.data_bits > 8 || options.stop_bits < 1 || options.stop_bits > 2) {
    return base::fail(ErrorCode::kUsage, "axis: a serial port has 7 or 8 data bits and 1 or 2 stop bits");
  }
  AxisDialogue dialogue = std::move(options.dialogue);
  detail::Transport transport{
      .source = "axis at " + base::shown(options.device),
      .open = [options = std::move(options), rate = *rate](const detail::Wake&) { return open_port(options, rate); },
      .begins_within_a_line = true,
  };
  return std::make_unique<detail::AxisLink>(std::move(transport), std::move(dialogue), std::move(clock));
}

}  // namespace crosstie::devices
