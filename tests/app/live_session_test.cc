// The operator's session with simulated cameras: what it takes, where it puts it, and what it refuses.
#include <atomic>
#include <chrono>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "app/live/live_session.h"
#include "app/live/tapped_pairs.h"
#include "app/live/worker.h"
#include "base/file.h"
#include "base/image.h"
#include "devices/simulated_camera.h"
#include "tests/support/temporary_folder.h"

namespace crosstie::app {
namespace {

namespace fs = std::filesystem;
using base::ErrorCode;
using base::Progress;
using base::Result;
using testing::HasSubstr;

constexpr int kWidth = 64;
constexpr int kHeight = 48;

bool eventually(const std::function<bool()>& holds, double timeout_s = 10.0) {
  const auto end = std::chrono::steady_clock::now() + std::chrono::duration<double>(timeout_s);
  while (std::chrono::steady_clock::now() < end) {
    if (holds()) return true;
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  return holds();
}

/// Two cameras that see one grey level each, which the test sets; held ones do not finish their exposures.
struct Cameras {
  std::atomic<int> level = 50;
  std::atomic<bool> held = false;
  std::atomic<int> losses = 0;  ///< of the right camera's next frames
  devices::SimulatedCamera left{"left", [this](const auto&) { return exposed(0); }};
  devices::SimulatedCamera right{"right", [this](const auto&) { return exposed(1); }};
  devices::CameraPair pair{left, right, {.max_host_skew_s = 0.5, .max_device_skew_s = 1.0}};

  Result<base::Image> exposed(int more) {
    while (held) std::this_thread::sleep_for(std::chrono::milliseconds(1));
    if (more == 1 && losses > 0) {
      --losses;
      return base::fail(ErrorCode::kDevice, "lost on its way");
    }
    base::Image image(kWidth, kHeight, 8);
    for (int y = 0; y < kHeight; ++y) std::fill_n(image.row<std::uint8_t>(y), kWidth, static_cast<std::uint8_t>(level + more));
    return image;
  }
};

const devices::CameraSettings kTriggered = {.exposure_s = 0.001, .trigger = devices::TriggerMode::kSoftware};

int level_of(const fs::path& path) {
  const auto image = base::read_image(path);
  return image ? image->view().row<std::uint8_t>(0)[0] : -1;
}

TEST(TappedPairs, APairIsNeverOlderThanTheRequest) {
  Cameras cameras;
  TappedPairs pairs(cameras.pair, 200.0);
  std::atomic<int> seen = 0;
  ASSERT_TRUE(pairs.start(kTriggered, [&](const auto& pair) { seen += pair ? 1 : 0; }));
  ASSERT_TRUE(eventually([&] { return seen > 5; })) << "the preview triggers by itself";
  for (int level = 60; level < 90; ++level) {
    ASSERT_TRUE(pairs.measure(kTriggered));
    cameras.level = level;
    const auto pair = pairs.take(devices::host_now(), 5.0);
    ASSERT_TRUE(pair) << pair.error().message;
    EXPECT_EQ(pair->left.image.view().row<std::uint8_t>(0)[0], level);
    EXPECT_EQ(pair->right.image.view().row<std::uint8_t>(0)[0], level + 1);
    ASSERT_TRUE(pairs.preview());
  }
  const int before = seen;
  EXPECT_TRUE(eventually([&] { return seen > before + 3; })) << "the preview goes on";
}

TEST(TappedPairs, ALostCameraEndsTheWaitAndMayBeStartedAgain) {
  Cameras cameras;
  TappedPairs pairs(cameras.pair, 50.0);
  ASSERT_TRUE(pairs.start(kTriggered, {}));
  cameras.left.unplug();
  const auto lost = pairs.take(devices::host_now(), 5.0);
  ASSERT_FALSE(lost);
  EXPECT_EQ(lost.error().code, ErrorCode::kDevice);
  EXPECT_FALSE(pairs.measure(kTriggered));
  ASSERT_TRUE(pairs.start(kTriggered, {}));
  ASSERT_TRUE(pairs.measure(kTriggered));
  EXPECT_TRUE(pairs.take(devices::host_now(), 5.0));
}

TEST(TappedPairs, ALostFrameIsExposedAgain) {
  Cameras cameras;
  TappedPairs pairs(cameras.pair, 50.0);
  ASSERT_TRUE(pairs.start(kTriggered, {}));
  ASSERT_TRUE(pairs.measure(kTriggered));
  cameras.losses = 1;
  const auto pair = pairs.take(devices::host_now(), 10.0);
  ASSERT_TRUE(pair) << pair.error().message;
  cameras.losses = 100;
  EXPECT_FALSE(pairs.take(devices::host_now(), 1.5)) << "but not for ever";
}

TEST(Worker, DoesOneAfterTheOtherAndForgetsWhatIsCancelled) {
  std::mutex mutex;
  std::vector<std::string> told;
  Worker worker([&](const std::string& what, const Result<>& outcome) {
    const std::lock_guard lock(mutex);
    told.push_back(what + (outcome ? " done" : " " + outcome.error().message));
  });
  worker.add("one", [](const Progress& progress) {
    progress("stage", 1, 2);
    return Result<>();
  });
  worker.add("two", [](const Progress&) -> Result<> { throw std::runtime_error("broken"); });
  ASSERT_TRUE(eventually([&] { return worker.idle(); }));
  std::atomic<bool> begun = false;
  worker.add("three", [&](const Progress& progress) {
    begun = true;
    while (!progress.cancelled()) std::this_thread::sleep_for(std::chrono::milliseconds(1));
    return Result<>(base::cancelled("three"));
  });
  worker.add("four", [](const Progress&) { return Result<>(); });
  ASSERT_TRUE(eventually([&] { return begun.load(); }));
  EXPECT_EQ(worker.status()->what, "three");
  worker.cancel();
  ASSERT_TRUE(eventually([&] { return worker.idle(); }));
  const std::lock_guard lock(mutex);
  EXPECT_THAT(told, testing::ElementsAre("one done", "two a defect of crosstie: broken", "three three was cancelled"));
}

class LiveSessionTest : public ::testing::Test {
 protected:
  void SetUp() override {
    ASSERT_TRUE(base::write_file_atomically(folder_ / "job.toml", R"(format = "crosstie-job/1"
name = "door"
[board]
corners = [5, 4]
pitch_mm = 30.0
[camera.left]
board_images = "board/left/*.png"
[camera.right]
board_images = "board/right/*.png"
[rig]
cameras = ["left", "right"]
[cross]
points = "cross/points.csv"
spheres = "cross/spheres.csv"
[machine]
probed_spheres = "machine/probe.csv"
axis_sigma_mm = 0.005

[[station]]
name = "x850"
axis_mm = 850.0  # planned
cross = { left = "cross/x850_l.png", right = "cross/x850_r.png" }
)"));
    begin();
  }
  void begin() {
    session_.reset();
    LiveDevices devices;
    devices.pairs = &cameras_.pair;
    devices.axis = devices.typed = &axis_;
    devices.preview = devices.capture.settings = kTriggered;
    devices.preview_hz = 50.0;
    auto session = LiveSession::begin(folder_.path(), devices, feed_, 1);
    ASSERT_TRUE(session) << session.error().message;
    session_ = *std::move(session);
  }
  nlohmann::json state() {
    const auto newest = feed_.state.wait_newer(0, 5.0);
    return newest ? nlohmann::json::parse(newest->value) : nlohmann::json();
  }
  Result<> command(const std::string& json) { return session_->command(json); }
  bool idle() {
    return eventually([&] {
      const auto now = state();
      return now["work"].is_null() && now["cameras"][0]["frames"] > 0;
    });
  }

  tests::TemporaryFolder folder_;
  Cameras cameras_;
  devices::TypedAxis axis_;
  live::Feed feed_;
  std::unique_ptr<LiveSession> session_;
};

TEST_F(LiveSessionTest, PairsOfTheBoardAreTakenRepeatedAndUndone) {
  ASSERT_TRUE(idle());
  cameras_.level = 70;
  ASSERT_TRUE(command(R"({"command": "next"})"));
  ASSERT_TRUE(eventually([&] { return level_of(folder_ / "board/right/01.png") == 71; }));
  EXPECT_EQ(level_of(folder_ / "board/left/01.png"), 70);
  ASSERT_TRUE(eventually([&] { return state()["can"]["repeat"] == true; }));
  EXPECT_EQ(state()["stages"][0]["have"], 1);
  cameras_.level = 80;
  ASSERT_TRUE(eventually([&] { return command(R"({"command": "repeat"})").has_value(); }));
  ASSERT_TRUE(eventually([&] { return level_of(folder_ / "board/right/01.png") == 81; }));
  EXPECT_EQ(level_of(folder_ / "undone/001/board/left/01.png"), 70) << "what was taken before is kept";
  // The state is up to a tenth of a second old, and refuses nothing: the session does, as long as the pair is looked at.
  ASSERT_TRUE(eventually([&] { return command(R"({"command": "undo"})").has_value(); }));
  EXPECT_FALSE(fs::exists(folder_ / "board/left/01.png"));
  EXPECT_EQ(level_of(folder_ / "undone/002/board/right/01.png"), 81);
  EXPECT_TRUE(eventually([&] { return state()["stages"][0]["have"] == 0; }));
}

TEST_F(LiveSessionTest, AStationTakesAFreshReadingIntoTheJob) {
  ASSERT_TRUE(command(R"({"command": "stage", "name": "commission"})"));
  auto refused = command(R"({"command": "next"})");
  ASSERT_FALSE(refused) << "nobody typed a position";
  ASSERT_TRUE(command(R"({"command": "axis", "position_mm": 700.0})"));
  refused = command(R"({"command": "next"})");
  ASSERT_FALSE(refused);
  EXPECT_THAT(refused.error().message, HasSubstr("station x850 is at 850.0 mm"));
  ASSERT_TRUE(command(R"({"command": "axis", "position_mm": 850.04})"));
  ASSERT_TRUE(idle());
  ASSERT_TRUE(command(R"({"command": "next"})"));
  ASSERT_TRUE(eventually([&] { return fs::exists(folder_ / "cross/x850_r.png"); }));
  EXPECT_THAT(*base::read_file(folder_ / "job.toml"), HasSubstr("axis_mm = 850.04  # planned"));
  ASSERT_TRUE(eventually([&] { return state()["stations"][0]["cross"] == "taken"; }));
  EXPECT_EQ(state()["stations"][0]["measured_mm"], 850.04);
  EXPECT_FALSE(axis_.state().latest) << "the next station needs a reading of its own";
  const auto before = state();
  begin();  // as after a kill
  ASSERT_TRUE(command(R"({"command": "stage", "name": "commission"})"));
  ASSERT_TRUE(eventually([&] { return state()["stage"] == "commission" && state()["stations"] == before["stations"]; }));
}

TEST_F(LiveSessionTest, ABeamThatMovedMeanwhileLeavesNothing) {
  ASSERT_TRUE(command(R"({"command": "stage", "name": "commission"})"));
  ASSERT_TRUE(idle());
  ASSERT_TRUE(command(R"({"command": "axis", "position_mm": 850.0})"));
  cameras_.held = true;
  ASSERT_TRUE(command(R"({"command": "next"})"));
  ASSERT_TRUE(axis_.enter(851.0));
  cameras_.held = false;
  ASSERT_TRUE(eventually([&] { return state()["log"].dump().find("the beam moved by 1.000 mm") != std::string::npos; }));
  EXPECT_FALSE(fs::exists(folder_ / "cross/x850_l.png"));
  EXPECT_THAT(*base::read_file(folder_ / "job.toml"), HasSubstr("axis_mm = 850.0  # planned"));
}

TEST_F(LiveSessionTest, WhatIsNoCommandIsRefusedInWords) {
  const std::pair<const char*, const char*> cases[] = {{"", "JSON object"},
                                                       {"[1]", "JSON object"},
                                                       {"{}", "\"command\""},
                                                       {R"({"command": 3})", "\"command\""},
                                                       {R"({"command": "dance"})", "no such command"},
                                                       {R"({"command": "stage", "name": "lunch"})", "no stage 'lunch'"},
                                                       {R"({"command": "select", "station": "x1"})", "no station 'x1'"},
                                                       {R"({"command": "axis", "position_mm": "1"})", "number \"position_mm\""},
                                                       {R"({"command": "exposure", "exposure_s": -1, "gain": 0})", "exposure"},
                                                       {R"({"command": "cancel"})", "nothing is running"},
                                                       {R"({"command": "check"})", "not commissioned"}};
  ASSERT_TRUE(idle());
  for (const auto& [text, words] : cases) {
    const auto refused = command(text);
    ASSERT_FALSE(refused) << text;
    EXPECT_THAT(refused.error().message, HasSubstr(words)) << text;
  }
}

TEST_F(LiveSessionTest, ALostCameraIsToldAndConnectedAgain) {
  ASSERT_TRUE(idle());
  cameras_.right.unplug();
  ASSERT_TRUE(eventually([&] { return state()["can"]["next"] == false; }));
  EXPECT_FALSE(command(R"({"command": "next"})"));
  ASSERT_TRUE(command(R"({"command": "reconnect"})"));
  EXPECT_TRUE(eventually([&] { return state()["can"]["next"] == true; }));
}

}  // namespace
}  // namespace crosstie::app
