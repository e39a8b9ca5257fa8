#include <chrono>
#include <memory>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "devices/axis_stream.h"
#include "tests/devices/eventually.h"
#include "tests/devices/line_server.h"
#include "tests/devices/manual_clock.h"

namespace crosstie::devices {
namespace {

using base::ErrorCode;
using ::testing::HasSubstr;
using tests::eventually;

class AxisTcp : public ::testing::Test {
 protected:
  std::unique_ptr<AxisReader> connect(AxisDialogue dialogue = {}) {
    dialogue.retry_s = 0.01;
    auto axis = connect_tcp_axis({"127.0.0.1", server_.port(), dialogue}, clock_.clock());
    if (!axis) throw std::runtime_error(axis.error().message);
    server_.accept();
    return *std::move(axis);
  }
  static bool reads(AxisReader& axis, double position_mm) {
    return eventually([&] {
      const auto latest = axis.state().latest;
      return latest && latest->position_mm == position_mm;
    });
  }
  static bool tells(AxisReader& axis, std::string_view trouble) {
    return eventually([&] { return axis.state().trouble.find(trouble) != std::string::npos; });
  }

  tests::ManualClock clock_;
  tests::LineServer server_;
};

TEST_F(AxisTcp, TheLatestLineIsTheReadingWithTheTimeOfItsArrival) {
  const auto axis = connect();
  server_.send("850.04\r\n850.05\r\n");
  ASSERT_TRUE(reads(*axis, 850.05));
  EXPECT_EQ(axis->state().latest->time, clock_.now());
  EXPECT_EQ(axis->state().trouble, "");
  EXPECT_EQ(axis->state().source, "axis 127.0.0.1:" + std::to_string(server_.port()));
  clock_.advance(std::chrono::seconds(3));
  EXPECT_FALSE(fresh_reading(axis->state(), clock_.now(), 2.0));
  server_.send("850.05\r\n");  // it still stands there
  EXPECT_TRUE(eventually([&] { return fresh_reading(axis->state(), clock_.now(), 2.0).has_value(); }));
}

TEST_F(AxisTcp, ALineThatArrivesInPiecesIsOneReading) {
  const auto axis = connect();
  server_.send("1.0\n85");
  ASSERT_TRUE(reads(*axis, 1.0));
  server_.send("0.0");
  server_.send("4\n");
  EXPECT_TRUE(reads(*axis, 850.04));
}

TEST_F(AxisTcp, RubbishIsToldOfAndLeavesTheReading) {
  const auto axis = connect();
  server_.send("850.04\n");
  ASSERT_TRUE(reads(*axis, 850.04));
  clock_.advance(std::chrono::seconds(3));
  server_.send("\xff\xfe binary\n");
  ASSERT_TRUE(tells(*axis, "\\xff\\xfe binary"));
  const auto stale = fresh_reading(axis->state(), clock_.now(), 2.0);
  ASSERT_FALSE(stale);
  EXPECT_THAT(stale.error().message, HasSubstr("\\xff\\xfe binary"));
  EXPECT_EQ(axis->state().latest->position_mm, 850.04);
  server_.send("850.05\n");
  EXPECT_TRUE(reads(*axis, 850.05));
}

TEST_F(AxisTcp, AMegabyteWithoutALineEndIsDropped) {
  const auto axis = connect();
  server_.send(std::string(1'000'000, '8'));
  ASSERT_TRUE(tells(*axis, "more than 256 bytes"));
  server_.send("9\n850.04\n");
  EXPECT_TRUE(reads(*axis, 850.04));
}

TEST_F(AxisTcp, ConnectsAnewAfterTheControlClosed) {
  const auto axis = connect();
  server_.send("850.04\n85");
  ASSERT_TRUE(reads(*axis, 850.04));
  server_.accept();  // closes the first connection and takes the next one
  server_.send("1.5\n");
  EXPECT_TRUE(reads(*axis, 1.5));  // not 851.5: half a line ends with its connection
}

TEST_F(AxisTcp, ASilentConnectionIsMadeAnew) {
  const auto axis = connect({.silence_s = 0.05});
  EXPECT_TRUE(server_.closed_by_reader());
  server_.accept();
}

TEST_F(AxisTcp, AsksControlsThatOnlyAnswer) {
  const auto axis = connect({.line = {.label = "ABS_ACT_POS"}, .request = "get abs_act_pos\r\n", .period_s = 0.005});
  EXPECT_EQ(server_.receive(17), "get abs_act_pos\r\n");
  server_.send("ABS_ACT_POS 850.04\r\n");
  ASSERT_TRUE(reads(*axis, 850.04));
  EXPECT_EQ(server_.receive(17), "get abs_act_pos\r\n");
}

TEST_F(AxisTcp, AControlThatIsSwitchedOffIsWaitedFor) {
  const tests::LineServer deaf(tests::LineServer::Listens::kNo);
  const auto axis = connect_tcp_axis({"127.0.0.1", deaf.port(), {.retry_s = 0.01}}, clock_.clock());
  ASSERT_TRUE(axis);
  ASSERT_TRUE(tells(**axis, "not connected: "));
  const auto refused = fresh_reading((*axis)->state(), clock_.now(), 2.0);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::kDevice);
}

TEST_F(AxisTcp, ClosingDoesNotWaitForTheControl) {
  auto axis = connect({.silence_s = 3600.0});
  const auto begin = std::chrono::steady_clock::now();
  axis.reset();
  EXPECT_TRUE(server_.closed_by_reader());
  EXPECT_LT(std::chrono::steady_clock::now() - begin, std::chrono::seconds(30));
}

TEST(AxisTcpOptions, OutOfTheirDomain) {
  EXPECT_EQ(connect_tcp_axis({"127.0.0.1", 0}).error().code, ErrorCode::kUsage);
  EXPECT_EQ(connect_tcp_axis({"127.0.0.1", 65536}).error().code, ErrorCode::kUsage);
  EXPECT_EQ(connect_tcp_axis({"127.0.0.1", 5000, {.period_s = 0.0}}).error().code, ErrorCode::kUsage);
  EXPECT_EQ(connect_tcp_axis({"127.0.0.1", 5000, {.line = {.label = "X Y"}}}).error().code, ErrorCode::kUsage);
  EXPECT_EQ(connect_tcp_axis({"no host, \x01", 5000}).error().code, ErrorCode::kDevice);
}

}  // namespace
}  // namespace crosstie::devices
