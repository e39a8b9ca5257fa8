#include "devices/simulated_camera.h"

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "devices/frame_check.h"
#include "devices/newest_queue.h"
#include "tests/devices/manual_clock.h"

namespace crosstie::devices {
namespace {

using base::ErrorCode;
using std::chrono::milliseconds;
using ::testing::HasSubstr;

/// An image whose only grey level is the exposure's id.
base::Result<base::Image> numbered(const SimulatedExposure& exposure) {
  base::Image image(4, 3, storage_bits(exposure.settings.format));
  for (int y = 0; y < 3; ++y) {
    for (int x = 0; x < 4; ++x) {
      if (image.bits() == 8) {
        image.row<std::uint8_t>(y)[x] = static_cast<std::uint8_t>(exposure.id);
      } else {
        image.row<std::uint16_t>(y)[x] = static_cast<std::uint16_t>(exposure.id);
      }
    }
  }
  return image;
}

TEST(SimulatedCamera, ATriggerDeliversOneFrame) {
  tests::ManualClock clock;
  SimulatedCamera camera("left", numbered, clock.clock(), milliseconds(7));
  std::vector<Frame> frames;
  ASSERT_TRUE(camera.start({.format = PixelFormat::kMono12, .trigger = TriggerMode::kSoftware},
                           [&](base::Result<Frame> frame) { frames.push_back(*std::move(frame)); }));
  EXPECT_TRUE(frames.empty());
  for (int i = 1; i <= 3; ++i) {
    clock.advance(milliseconds(50));
    ASSERT_TRUE(camera.trigger());
    ASSERT_EQ(frames.size(), static_cast<std::size_t>(i));
    const Frame& frame = frames.back();
    EXPECT_EQ(frame.header.id, static_cast<std::uint64_t>(i));
    EXPECT_EQ(frame.header.host_time, clock.now());
    EXPECT_EQ(frame.header.device_time, clock.now().time_since_epoch() + milliseconds(7));
    EXPECT_EQ(frame.image.view().row<std::uint16_t>(2)[3], i);
    EXPECT_EQ(frame.image.white_level(), 4095.0);
  }
  EXPECT_EQ(camera.state().frames, 3u);
  camera.stop();
  EXPECT_EQ(camera.trigger().error().code, ErrorCode::kDevice);
  EXPECT_EQ(frames.size(), 3u);
}

TEST(SimulatedCamera, AFrameThatIsNotRenderedIsLost) {
  tests::ManualClock clock;
  SimulatedCamera camera(
      "left",
      [](const SimulatedExposure& exposure) -> base::Result<base::Image> {
        if (exposure.id == 3) return base::fail(ErrorCode::kDevice, "a packet did not arrive");
        return numbered(exposure);
      },
      clock.clock());
  std::vector<FrameHeader> headers;
  ASSERT_TRUE(camera.start({.trigger = TriggerMode::kHardware},
                           [&](const base::Result<Frame>& frame) { headers.push_back(frame->header); }));
  for (int i = 0; i < 5; ++i) {
    clock.advance(milliseconds(50));
    ASSERT_TRUE(camera.trigger());
  }
  EXPECT_EQ(camera.state().frames, 4u);
  EXPECT_EQ(camera.state().incomplete, 1u);
  const auto findings = check_frames(headers, {.period_s = 0.05});
  ASSERT_EQ(findings->size(), 1u);
  EXPECT_EQ(findings->front().fault, FrameFault::kLost);
  EXPECT_EQ(findings->front().index, 2u);
}

TEST(SimulatedCamera, RunsFreelyUntilItIsStopped) {
  NewestQueue<Frame> queue(100'000);
  SimulatedCamera camera("left", numbered);
  ASSERT_TRUE(camera.start({.frame_rate_hz = 1000.0}, [&](base::Result<Frame> frame) { queue.push(std::move(frame)); }));
  std::vector<FrameHeader> headers;
  for (int i = 0; i < 20; ++i) headers.push_back((**queue.pop(30.0)).header);
  camera.stop();
  EXPECT_EQ(headers.back().id, 20u);
  EXPECT_TRUE(check_frames(headers)->empty());
  // Nothing comes after stop().
  const std::uint64_t frames = camera.state().frames;
  std::uint64_t taken = headers.size();
  while (queue.pop(0.0)->has_value()) ++taken;
  EXPECT_EQ(taken, frames);
  EXPECT_FALSE(camera.state().running);
}

TEST(SimulatedCamera, ALostCameraSaysSoOnceAndStartsAgain) {
  NewestQueue<Frame> queue(4);
  NewestQueue<Frame> again(4);
  SimulatedCamera camera("left", numbered);
  ASSERT_TRUE(camera.start({.frame_rate_hz = 500.0}, [&](base::Result<Frame> frame) { queue.push(std::move(frame)); }));
  ASSERT_TRUE((*queue.pop(30.0)).has_value());
  camera.unplug();
  base::Result<std::optional<Frame>> ended = queue.pop(30.0);
  while (ended) ended = queue.pop(30.0);  // those before it
  EXPECT_EQ(ended.error().code, ErrorCode::kDevice);
  EXPECT_THAT(ended.error().message, HasSubstr("left"));
  EXPECT_THAT(camera.state().trouble, HasSubstr("lost"));
  EXPECT_FALSE(camera.state().running);

  ASSERT_TRUE(camera.start({.frame_rate_hz = 500.0}, [&](base::Result<Frame> frame) { again.push(std::move(frame)); }));
  EXPECT_TRUE((*again.pop(30.0)).has_value());
  EXPECT_EQ(camera.state().trouble, "");
}

TEST(SimulatedCamera, TellsItsTemperatureWhereItHasOne) {
  SimulatedCamera camera("left", numbered);
  EXPECT_FALSE(camera.state().temperature_c);
  camera.set_temperature(41.25);
  EXPECT_EQ(camera.state().temperature_c, 41.25);
  ASSERT_TRUE(camera.start({.trigger = TriggerMode::kSoftware}, [](const base::Result<Frame>&) {}));
  EXPECT_EQ(camera.state().temperature_c, 41.25) << "also after start()";
  camera.set_temperature({});
  EXPECT_FALSE(camera.state().temperature_c);
}

TEST(SimulatedCamera, SettingsOutOfTheirDomain) {
  SimulatedCamera camera("left", numbered);
  const FrameSink nowhere = [](const base::Result<Frame>&) {};
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (const CameraSettings& settings :
       {CameraSettings{.exposure_s = 0.0}, CameraSettings{.exposure_s = nan}, CameraSettings{.gain = nan},
        CameraSettings{.frame_rate_hz = -1.0}, CameraSettings{.trigger = TriggerMode::kHardware, .trigger_line = ""},
        CameraSettings{.width_px = 100}, CameraSettings{}}) {  // the last one: no frame rate
    const auto refused = camera.start(settings, nowhere);
    ASSERT_FALSE(refused);
    EXPECT_EQ(refused.error().code, ErrorCode::kUsage);
  }
  ASSERT_TRUE(camera.start({.trigger = TriggerMode::kSoftware}, nowhere));
  EXPECT_EQ(camera.start({.trigger = TriggerMode::kSoftware}, nowhere).error().code, ErrorCode::kUsage);
}

TEST(SimulatedCamera, ARenderedImageOfOtherBitsIsADefect) {
  SimulatedCamera camera("left", [](const SimulatedExposure&) { return base::Result<base::Image>(base::Image(4, 3, 8)); });
  base::Result<Frame> last;
  ASSERT_TRUE(camera.start({.format = PixelFormat::kMono16, .trigger = TriggerMode::kSoftware},
                           [&](base::Result<Frame> frame) { last = std::move(frame); }));
  ASSERT_TRUE(camera.trigger());
  ASSERT_FALSE(last);
  EXPECT_EQ(last.error().code, ErrorCode::kInternal);
}

}  // namespace
}  // namespace crosstie::devices
