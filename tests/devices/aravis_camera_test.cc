#include "devices/aravis_camera.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <arv.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "devices/frame_check.h"
#include "devices/gige_simulator.h"
#include "devices/newest_queue.h"
#include "tests/devices/gige_turn.h"
#include "tests/support/temporary_folder.h"

namespace crosstie::devices {
namespace {

using base::ErrorCode;
using ::testing::HasSubstr;

constexpr const char* kAddress = "127.0.0.1";
constexpr int kWidth = 96, kHeight = 64;  // a few packets: they fit into any socket's buffer

/// The grey level of a pixel of exposure `number`: no two neighbours, rows or exposures are alike.
int grey(int x, int y, int number) { return (7 * x + 13 * y + 29 * number) % 251; }

/// Whether frames came in the order of their ids and times; a busy machine may lose some.
bool in_order(const std::vector<FrameHeader>& headers) {
  const auto findings = check_frames(headers, {.id_bits = 16});
  return findings && std::all_of(findings->begin(), findings->end(),
                                 [](const FrameFinding& finding) { return finding.fault == FrameFault::kLost; });
}

constexpr double kTemperature_c = 41.25;

/// Aravis's simulated camera describes itself as this file says, once for all tests: as by itself, and with a temperature.
void describe_with_temperature(const tests::TemporaryFolder& folder) {
  GBytes* const own = g_resources_lookup_data("/org/aravis/arv-fake-camera.xml", G_RESOURCE_LOOKUP_FLAGS_NONE, nullptr);
  if (own == nullptr) return;
  gsize size = 0;
  const void* const data = g_bytes_get_data(own, &size);
  std::string xml(static_cast<const char*>(data), size);
  g_bytes_unref(own);
  const auto end = xml.rfind("</RegisterDescription>");
  if (end == std::string::npos) return;
  xml.insert(end, "<Float Name=\"DeviceTemperature\" NameSpace=\"Standard\"><Value>" + std::to_string(kTemperature_c) +
                      "</Value></Float>\n");
  arv_set_fake_camera_genicam_filename(folder.write("camera.xml", xml).c_str());
}

class AravisCameraTest : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    static const tests::TemporaryFolder kFolder;
    describe_with_temperature(kFolder);
  }

  void SetUp() override {
    plug_in();
    if (!simulator_) GTEST_SKIP() << "no GigE camera can be simulated here: " << why_not_;
  }

  void plug_in() {
    auto simulator = simulate_gige_camera(
        kAddress, "SIM0", [this](const GigeExposure& exposure, std::span<std::byte> pixels) { fill(exposure, pixels); });
    if (!simulator) {
      why_not_ = simulator.error().message;
      return;
    }
    simulator_ = *std::move(simulator);
  }

  void fill(const GigeExposure& exposure, std::span<std::byte> pixels) {
    const int number = exposures_++;
    exposure_us_ = static_cast<int>(std::lround(1e6 * exposure.exposure_s));
    gain_ = static_cast<int>(exposure.gain);
    const std::size_t sample_bytes = exposure.format == PixelFormat::kMono8 ? 1 : 2;
    for (int y = 0; y < exposure.height_px; ++y) {
      for (int x = 0; x < exposure.width_px; ++x) {
        const auto i = sample_bytes * static_cast<std::size_t>(y * exposure.width_px + x);
        pixels[i] = static_cast<std::byte>(grey(x, y, number));
        if (sample_bytes == 2) pixels[i + 1] = static_cast<std::byte>(y);
      }
    }
  }

  static CameraSettings triggered(PixelFormat format = PixelFormat::kMono8) {
    return {.exposure_s = 0.005,
            .gain = 3.0,
            .format = format,
            .trigger = TriggerMode::kSoftware,
            .width_px = kWidth,
            .height_px = kHeight};
  }

  /// Triggers until a frame comes: the network may lose one on a busy machine.
  static std::optional<Frame> next_frame(CameraDevice& camera, NewestQueue<Frame>& queue) {
    for (int attempt = 0; attempt < 15; ++attempt) {
      if (const auto triggered = camera.trigger(); !triggered) {
        ADD_FAILURE() << triggered.error().message;
        return std::nullopt;
      }
      auto frame = queue.pop(2.0);
      if (!frame) {
        ADD_FAILURE() << frame.error().message;
        return std::nullopt;
      }
      if (*frame) return std::move(*frame);
    }
    ADD_FAILURE() << "no frame came";
    return std::nullopt;
  }
  static FrameSink into(NewestQueue<Frame>& queue) {
    return [&queue](base::Result<Frame> frame) { queue.push(std::move(frame)); };
  }

  tests::GigeTurn turn_;
  std::string why_not_;
  std::atomic<int> exposures_ = 0, exposure_us_ = 0, gain_ = 0;
  std::unique_ptr<GigeSimulator> simulator_;
};

TEST_F(AravisCameraTest, FramesArriveWithTheirPixelsIdsAndTimes) {
  NewestQueue<Frame> queue(4);
  const auto camera = open_aravis_camera(kAddress);
  ASSERT_TRUE(camera) << camera.error().message;
  const auto taken = (*camera)->start(triggered(), into(queue));
  ASSERT_TRUE(taken) << taken.error().message;
  EXPECT_EQ(taken->exposure_s, 0.005);
  EXPECT_EQ(taken->width_px, kWidth);
  EXPECT_EQ((*camera)->state().id_bits, 16);
  const HostTime begin = host_now();
  std::vector<FrameHeader> headers;
  std::optional<std::uint64_t> id_of_exposure_0;
  for (int i = 0; i < 5; ++i) {
    const auto frame = next_frame(**camera, queue);
    ASSERT_TRUE(frame);
    headers.push_back(frame->header);
    // The simulator numbers its exposures, the camera its frames: both advance together.
    if (!id_of_exposure_0) id_of_exposure_0 = frame->header.id - static_cast<std::uint64_t>(exposures_ - 1);
    const int number = static_cast<int>(frame->header.id - *id_of_exposure_0);
    ASSERT_EQ(frame->image.width(), kWidth);
    ASSERT_EQ(frame->image.height(), kHeight);
    ASSERT_EQ(frame->image.bits(), 8);
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x)
        ASSERT_EQ(frame->image.view().row<std::uint8_t>(y)[x], grey(x, y, number)) << x << ", " << y;
    }
    EXPECT_GT(frame->header.host_time, begin);
    EXPECT_LE(frame->header.host_time, host_now());
  }
  EXPECT_EQ(exposure_us_, 5000);  // what the camera was told
  EXPECT_EQ(gain_, 3);
  EXPECT_TRUE(in_order(headers));
  EXPECT_EQ((*camera)->state().frames, 5u);
  (*camera)->stop();
  EXPECT_EQ((*camera)->trigger().error().code, ErrorCode::kDevice);
}

TEST_F(AravisCameraTest, ItsTemperatureIsReadWhileItRuns) {
  NewestQueue<Frame> queue(8);
  auto camera = open_aravis_camera(kAddress);
  ASSERT_TRUE(camera) << camera.error().message;
  EXPECT_FALSE((*camera)->state().temperature_c);
  ASSERT_TRUE((*camera)->start(triggered(), [&](base::Result<Frame> frame) { queue.push(std::move(frame)); }));
  ASSERT_TRUE(next_frame(**camera, queue));
  for (int wait = 0; wait < 200 && !(*camera)->state().temperature_c; ++wait) {
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
  }
  ASSERT_TRUE((*camera)->state().temperature_c);
  EXPECT_EQ(*(*camera)->state().temperature_c, kTemperature_c);
  (*camera)->stop();
}

TEST_F(AravisCameraTest, GreyLevelsOf16BitsArriveWhole) {
  NewestQueue<Frame> queue(4);
  const auto camera = open_aravis_camera(kAddress);
  ASSERT_TRUE(camera) << camera.error().message;
  ASSERT_TRUE((*camera)->start(triggered(PixelFormat::kMono16), into(queue)));
  const auto frame = next_frame(**camera, queue);
  ASSERT_TRUE(frame);
  ASSERT_EQ(frame->image.bits(), 16);
  EXPECT_EQ(frame->image.white_level(), 65535.0);
  const int number = exposures_ - 1;
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) ASSERT_EQ(frame->image.view().row<std::uint16_t>(y)[x], 256 * y + grey(x, y, number));
  }
}

TEST_F(AravisCameraTest, RunningFreelyItsCountStartsOverAndNothingIsOutOfOrder) {
  NewestQueue<Frame> queue(1000);
  const auto camera = open_aravis_camera(kAddress);
  ASSERT_TRUE(camera) << camera.error().message;
  ASSERT_TRUE((*camera)->start({.frame_rate_hz = 500.0, .width_px = kWidth, .height_px = kHeight}, into(queue)));
  std::vector<FrameHeader> headers;
  while (headers.empty() || headers.back().id > 1000) {  // the simulator begins near the end of its 16 bits
    const auto frame = queue.pop(30.0);
    ASSERT_TRUE(frame && *frame);
    headers.push_back((*frame)->header);
    ASSERT_LT(headers.size(), 1000u);
  }
  EXPECT_GT(headers.front().id, 65'000u);
  EXPECT_TRUE(in_order(headers));
}

TEST_F(AravisCameraTest, ALostCameraIsReportedAndConnectedAgain) {
  NewestQueue<Frame> queue(4);
  NewestQueue<Frame> again(4);
  const auto camera = open_aravis_camera(kAddress);
  ASSERT_TRUE(camera) << camera.error().message;
  ASSERT_TRUE((*camera)->start(triggered(), into(queue)));
  ASSERT_TRUE(next_frame(**camera, queue));

  simulator_.reset();
  const auto absent = open_aravis_camera("SIM0");
  ASSERT_FALSE(absent);
  EXPECT_EQ(absent.error().code, ErrorCode::kDevice);
  auto ended = queue.pop(60.0);
  while (ended && *ended) ended = queue.pop(60.0);  // frames before it
  ASSERT_FALSE(ended);
  EXPECT_EQ(ended.error().code, ErrorCode::kDevice);
  EXPECT_THAT(ended.error().message, HasSubstr("does not answer any more"));
  EXPECT_FALSE((*camera)->state().running);
  EXPECT_THAT((*camera)->state().trouble, HasSubstr("does not answer"));
  EXPECT_EQ((*camera)->trigger().error().code, ErrorCode::kDevice);

  plug_in();
  ASSERT_TRUE(simulator_) << why_not_;
  const auto started = (*camera)->start(triggered(), into(again));
  ASSERT_TRUE(started) << started.error().message;
  EXPECT_TRUE(next_frame(**camera, again));
}

TEST_F(AravisCameraTest, WhatTheCameraCannotDoIsRefusedByName) {
  const auto camera = open_aravis_camera(kAddress);
  ASSERT_TRUE(camera) << camera.error().message;
  const FrameSink nowhere = [](const base::Result<Frame>&) {};
  const auto format = (*camera)->start(triggered(PixelFormat::kMono12), nowhere);
  ASSERT_FALSE(format);
  EXPECT_EQ(format.error().code, ErrorCode::kDevice);
  EXPECT_THAT(format.error().message, HasSubstr("Mono12; it offers"));
  EXPECT_THAT(format.error().message, HasSubstr("Mono16"));
  CameraSettings line = triggered();
  line.trigger = TriggerMode::kHardware;
  line.trigger_line = "Line7";
  EXPECT_THAT((*camera)->start(line, nowhere).error().message, HasSubstr("Line7"));
  CameraSettings region = triggered();
  region.width_px = 5000;
  EXPECT_EQ((*camera)->start(region, nowhere).error().code, ErrorCode::kDevice);
  EXPECT_FALSE((*camera)->state().running);
  line.trigger_line = "Line0";
  EXPECT_TRUE((*camera)->start(line, nowhere));
  EXPECT_EQ((*camera)->trigger().error().code, ErrorCode::kUsage);
  EXPECT_EQ((*camera)->start(line, nowhere).error().code, ErrorCode::kUsage);
}

TEST_F(AravisCameraTest, ACameraThatAnotherProgramControlsIsRefusedInWords) {
  NewestQueue<Frame> queue(4);
  auto first = open_aravis_camera(kAddress);
  ASSERT_TRUE(first) << first.error().message;
  for (const bool running : {false, true}) {
    if (running) {
      ASSERT_TRUE((*first)->start(triggered(), into(queue)));
    }
    const auto second = open_aravis_camera(kAddress);
    ASSERT_FALSE(second);
    EXPECT_EQ(second.error().code, ErrorCode::kDevice);
    EXPECT_THAT(second.error().message, HasSubstr(kAddress));
    EXPECT_THAT(second.error().message, HasSubstr("another program controls it"));
  }
  EXPECT_TRUE(next_frame(**first, queue));  // the one that has it is not disturbed
  first->reset();
  const auto after = open_aravis_camera(kAddress);
  EXPECT_TRUE(after) << after.error().message;
}

TEST_F(AravisCameraTest, TwoCamerasOfOneHostHaveAnAddressEach) {
  std::array<std::unique_ptr<GigeSimulator>, 2> simulators;
  std::array<std::unique_ptr<CameraDevice>, 2> cameras;
  std::array<NewestQueue<Frame>, 2> queues = {NewestQueue<Frame>(4), NewestQueue<Frame>(4)};
  const std::array<std::string, 2> addresses = {"127.0.0.2", "127.0.0.3"};
  for (std::size_t i = 0; i < 2; ++i) {
    auto simulator =
        simulate_gige_camera(addresses[i], "TWO" + std::to_string(i), [i](const GigeExposure&, std::span<std::byte> pixels) {
          std::fill(pixels.begin(), pixels.end(), static_cast<std::byte>(50 + i));
        });
    ASSERT_TRUE(simulator) << simulator.error().message;
    simulators[i] = *std::move(simulator);
  }
  for (std::size_t i = 0; i < 2; ++i) {
    auto camera = open_aravis_camera(addresses[i]);
    ASSERT_TRUE(camera) << camera.error().message;
    cameras[i] = *std::move(camera);
    ASSERT_TRUE(cameras[i]->start(triggered(), into(queues[i])));
  }
  for (std::size_t i = 0; i < 2; ++i) {
    const auto frame = next_frame(*cameras[i], queues[i]);
    ASSERT_TRUE(frame);
    EXPECT_EQ(frame->image.view().row<std::uint8_t>(0)[0], 50 + static_cast<int>(i));
  }
  EXPECT_EQ(exposures_, 0);  // that of 127.0.0.1
}

TEST_F(AravisCameraTest, EachTriggerIsOneExposureAtOnce) {
  NewestQueue<Frame> queue(8);
  const auto camera = open_aravis_camera(kAddress);
  ASSERT_TRUE(camera) << camera.error().message;
  ASSERT_TRUE((*camera)->start(triggered(), into(queue)));
  for (int i = 0; i < 5; ++i) {
    ASSERT_TRUE((*camera)->trigger());
    EXPECT_FALSE(exposures_ < i + 1) << "not exposed when the trigger was acknowledged";
  }
  for (int i = 0; i < 5; ++i) {
    const auto frame = queue.pop(10.0);
    ASSERT_TRUE(frame && *frame);
    EXPECT_EQ((*frame)->image.view().row<std::uint8_t>(0)[0], grey(0, 0, i));
  }
  EXPECT_FALSE(*queue.pop(0.3));  // and no other one
  EXPECT_EQ(exposures_, 5);
}

TEST_F(AravisCameraTest, IsFoundByAskingTheNetwork) {
  const std::vector<FoundCamera> found = find_aravis_cameras();
  const auto simulated = std::find_if(found.begin(), found.end(), [](const FoundCamera& one) { return one.serial == "SIM0"; });
  ASSERT_NE(simulated, found.end());
  EXPECT_EQ(simulated->address, kAddress);
  EXPECT_EQ(simulated->protocol, "GigEVision");
  EXPECT_TRUE(open_aravis_camera(simulated->id));
}

TEST_F(AravisCameraTest, APortThatIsTakenIsToldOf) {
  const auto second = simulate_gige_camera(kAddress, "SIM1", [](const GigeExposure&, std::span<std::byte>) {});
  ASSERT_FALSE(second);
  EXPECT_THAT(second.error().message, HasSubstr("3956"));
}

}  // namespace
}  // namespace crosstie::devices
