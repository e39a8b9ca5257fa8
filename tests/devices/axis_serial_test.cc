#include <filesystem>
#include <memory>
#include <stdexcept>
#include <string>
#include <string_view>

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <stdlib.h>
#include <termios.h>
#include <unistd.h>

#include "devices/axis_stream.h"
#include "tests/devices/eventually.h"
#include "tests/devices/manual_clock.h"
#include "tests/support/temporary_folder.h"

namespace crosstie::devices {
namespace {

using base::ErrorCode;
using tests::eventually;

/// The control's end of a pseudo-terminal, whose other end is a serial port to the reader.
class PseudoPort {
 public:
  PseudoPort() : control_(::posix_openpt(O_RDWR | O_NOCTTY | O_CLOEXEC)) {
    if (control_ < 0 || ::grantpt(control_) != 0 || ::unlockpt(control_) != 0) throw std::runtime_error("no pseudo-terminal");
  }
  PseudoPort(const PseudoPort&) = delete;
  PseudoPort& operator=(const PseudoPort&) = delete;
  ~PseudoPort() { ::close(control_); }

  [[nodiscard]] std::filesystem::path path() const { return ::ptsname(control_); }
  void send(std::string_view bytes) const {
    if (::write(control_, bytes.data(), bytes.size()) != static_cast<ssize_t>(bytes.size())) throw std::runtime_error("write");
  }
  [[nodiscard]] termios line() const {
    termios line{};
    ::tcgetattr(control_, &line);
    return line;
  }

 private:
  int control_;
};

bool connected(AxisReader& axis) {
  return eventually([&] { return axis.state().trouble.starts_with("connected"); });
}

bool reads(AxisReader& axis, double position_mm) {
  return eventually([&] { return axis.state().latest && axis.state().latest->position_mm == position_mm; });
}

TEST(AxisSerial, ReadsLinesAndDropsTheFirst) {
  const PseudoPort port;
  tests::ManualClock clock;
  const auto axis = open_serial_axis({.device = port.path()}, clock.clock());
  ASSERT_TRUE(axis);
  ASSERT_TRUE(connected(**axis));
  port.send("0.04\r\n");  // may be the end of 850.04
  port.send("+  850.05 mm\r\n");
  ASSERT_TRUE(reads(**axis, 850.05));
  EXPECT_EQ((*axis)->state().latest->time, clock.now());
  EXPECT_EQ((*axis)->state().source, "axis at " + port.path().string());
}

TEST(AxisSerial, NeverTakesTheFirstLine) {
  const PseudoPort port;
  const auto axis = open_serial_axis({.device = port.path()});
  ASSERT_TRUE(connected(**axis));
  port.send("0.04\nERROR 7\n");
  ASSERT_TRUE(eventually([&] { return (*axis)->state().trouble.find("ERROR 7") != std::string::npos; }));
  EXPECT_FALSE((*axis)->state().latest);
}

TEST(AxisSerial, SetsTheLine) {
  const PseudoPort port;
  const auto axis = open_serial_axis({.device = port.path(), .baud = 19200, .stop_bits = 2});
  ASSERT_TRUE(connected(**axis));
  const termios line = port.line();
  EXPECT_EQ(::cfgetispeed(&line), static_cast<speed_t>(B19200));
  EXPECT_EQ(line.c_cflag & CSTOPB, static_cast<tcflag_t>(CSTOPB));
  EXPECT_EQ(line.c_cflag & CSIZE, static_cast<tcflag_t>(CS8));
  EXPECT_EQ(line.c_lflag & (ICANON | ECHO | ISIG), 0u);
  EXPECT_EQ(line.c_iflag & (ICRNL | IXON), 0u);
}

TEST(AxisSerial, APortThatIsPluggedInAgainIsOpenedAgain) {
  const tests::TemporaryFolder folder;
  const auto link = folder / "by-id";
  auto port = std::make_unique<PseudoPort>();
  std::filesystem::create_symlink(port->path(), link);
  const auto axis = open_serial_axis({.device = link, .dialogue = {.retry_s = 0.01}});
  ASSERT_TRUE(connected(**axis));
  port->send("\n1.0\n");
  ASSERT_TRUE(reads(**axis, 1.0));

  std::filesystem::remove(link);
  port.reset();
  ASSERT_TRUE(eventually([&] { return (*axis)->state().trouble.starts_with("not connected"); }));
  EXPECT_EQ((*axis)->state().latest->position_mm, 1.0);

  port = std::make_unique<PseudoPort>();
  std::filesystem::create_symlink(port->path(), link);
  ASSERT_TRUE(connected(**axis));
  port->send("\n2.0\n");
  EXPECT_TRUE(reads(**axis, 2.0));
}

TEST(AxisSerial, WhatIsNoSerialPortIsTrouble) {
  const tests::TemporaryFolder folder;
  const auto axis = open_serial_axis({.device = folder.write("file", "850.04\n850.05\n")});
  ASSERT_TRUE(axis);
  EXPECT_TRUE(eventually([&] { return (*axis)->state().trouble.find("no serial port") != std::string::npos; }));
  EXPECT_FALSE((*axis)->state().latest);
}

TEST(AxisSerial, OptionsOutOfTheirDomain) {
  EXPECT_EQ(open_serial_axis({.device = "/dev/ttyS0", .baud = 9601}).error().code, ErrorCode::kUsage);
  EXPECT_EQ(open_serial_axis({.device = "/dev/ttyS0", .data_bits = 9}).error().code, ErrorCode::kUsage);
  EXPECT_EQ(open_serial_axis({.device = "/dev/ttyS0", .stop_bits = 0}).error().code, ErrorCode::kUsage);
  EXPECT_EQ(open_serial_axis({.device = "/dev/ttyS0", .dialogue = {.retry_s = -1.0}}).error().code, ErrorCode::kUsage);
}

}  // namespace
}  // namespace crosstie::devices
