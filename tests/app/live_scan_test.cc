// The operator's session with a projector: a station's fringe images, what they take along, and what a second session finds.
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
#include "base/file.h"
#include "base/image.h"
#include "devices/simulated_camera.h"
#include "scan/patterns.h"
#include "tests/app/live_cameras.h"
#include "tests/app/live_job.h"
#include "tests/devices/eventually.h"
#include "tests/support/temporary_folder.h"

namespace crosstie::app {
namespace {

namespace fs = std::filesystem;
using base::ErrorCode;
using base::Result;
using testing::HasSubstr;
using tests::eventually;
using tests::grey_level;

const std::string kJob = tests::live_job(R"([[station]]
name = "x0"
axis_mm = 0.0  # planned
cross = { left = "cross/x0_l.png", right = "cross/x0_r.png" }
scan = { left = "scan/x0/left", right = "scan/x0/right", manifest = "scan/patterns.json" }

[[station]]
name = "x500"
axis_mm = 500.0  # planned
scan = { left = "scan/x500/left", right = "scan/x500/right", manifest = "scan/patterns.json" }
)");

/// A result that says nothing but that it is there.
constexpr const char* kEmptyResult =
    R"({"format":"crosstie-result/1","verb":"VERB","version":"0","unit":"mm","frame":"rig","inputs":[],"options":{},)"
    R"("verdicts":[{"name":"rms_px","value":0.1,"limit":0.3,"unit":"px","source":"test","level":"OK"}],"warnings":[]})";

std::vector<std::pair<std::string, std::string>> contents(const fs::path& folder) {
  std::vector<std::pair<std::string, std::string>> files;
  for (const auto& entry : fs::recursive_directory_iterator(folder)) {
    if (entry.is_regular_file())
      files.emplace_back(entry.path().lexically_relative(folder).string(), tests::read_all(entry.path()));
  }
  std::sort(files.begin(), files.end());
  return files;
}

class LiveScanTest : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_.write("job.toml", kJob);
    sequence_ = *scan::make_patterns({.width_px = 64, .height_px = 32, .periods_px = {16.0}, .steps = 3, .y = false});
    ASSERT_TRUE(base::make_folder(folder_ / "scan"));
    ASSERT_TRUE(base::write_pattern_manifest(folder_ / "scan/patterns.json", sequence_));
    result("calibrate");
    result("commission");
    begin();
  }
  void TearDown() override { held_at_ = -1; }
  void result(const std::string& verb) const {
    std::string text = kEmptyResult;
    text.replace(text.find("VERB"), 4, verb);
    folder_.write(fs::path("results") / verb / "result.json", text);
    folder_.write(fs::path("results") / verb / "report.html", "<html>");
  }
  void begin() {
    session_.reset();
    LiveDevices devices;
    devices.pairs = &pair_;
    devices.axis = &axis_;
    devices.projector = &projector_;
    devices.pattern_images = [](const base::PatternSequence& wanted) -> Result<std::vector<base::Image>> {
      std::vector<base::Image> images;
      for (std::size_t i = 0; i < wanted.patterns.size(); ++i) images.emplace_back(wanted.width_px, wanted.height_px, 8);
      return images;
    };
    devices.preview.trigger = devices::TriggerMode::kSoftware;
    devices.preview.exposure_s = 0.001;
    devices.capture.settings = devices.preview;
    devices.preview_hz = 100.0;
    auto session = LiveSession::begin(folder_.path(), devices, feed_, 1);
    ASSERT_TRUE(session) << session.error().message;
    session_ = *std::move(session);
    ASSERT_TRUE(eventually([&] { return state()["work"].is_null() && state()["cameras"][0]["frames"] > 0; }));
  }
  nlohmann::json state() {
    const auto newest = feed_.state.wait_newer(0, 5.0);
    return newest ? nlohmann::json::parse(newest->value) : nlohmann::json();
  }
  Result<> command(const std::string& json) { return session_->command(json); }
  /// Once what runs has ended.
  testing::AssertionResult commanded(const std::string& json) {
    std::string why_not;
    const bool done = eventually([&] {
      const auto outcome = command(json);
      why_not = outcome ? "" : outcome.error().message;
      return outcome.has_value();
    });
    return done ? testing::AssertionSuccess() : testing::AssertionFailure() << why_not << "\n" << state()["log"].dump();
  }
  testing::AssertionResult logged(const std::string& text) {
    std::string log;
    const bool found = eventually([&] {
      log = state()["log"].dump();
      return log.find(text) != std::string::npos;
    });
    return found ? testing::AssertionSuccess() : testing::AssertionFailure() << log;
  }
  Result<base::Image> exposed(int more) const { return tests::grey_image(64, 48, light_ + more); }

  tests::TemporaryFolder folder_;
  base::PatternSequence sequence_;
  std::atomic<int> light_ = 0;
  std::atomic<int> held_at_ = -1;  ///< the projector hangs at this pattern
  std::atomic<double> x_mm_ = 0.002;
  devices::SimulatedCamera left_{"left", [this](const auto&) { return exposed(1); }};
  devices::SimulatedCamera right_{"right", [this](const auto&) { return exposed(101); }};
  devices::CameraPair pair_{left_, right_, {.max_host_skew_s = 0.5, .max_device_skew_s = 1.0}};
  devices::SimulatedSequencer projector_{[this](std::size_t index, const auto&, const auto&) -> Result<> {
    light_ = static_cast<int>(index);
    while (held_at_ == static_cast<int>(index)) std::this_thread::sleep_for(std::chrono::milliseconds(1));
    return {};
  }};
  devices::SimulatedAxis axis_{[this](devices::HostTime) -> Result<double> { return x_mm_.load(); }};
  live::Feed feed_;
  std::unique_ptr<LiveSession> session_;
};

TEST_F(LiveScanTest, TheWorkGoesOnWhereItStopped) {
  EXPECT_EQ(state()["stage"], "scan") << "calibrated and commissioned";
  EXPECT_EQ(state()["stages"][0]["state"], "done");
  EXPECT_EQ(state()["stages"][0]["report"], "results/calibrate/report.html");
  EXPECT_EQ(state()["stages"][0]["summary"], "OK: all 1 checks");
}

TEST_F(LiveScanTest, AScanHasEachPatternAndItsReadingAndIsTakenAnewAsAWhole) {
  ASSERT_TRUE(command(R"({"command": "next"})"));
  ASSERT_TRUE(logged("scan x0 taken at X = 0.002 mm"));
  for (std::size_t i = 0; i < sequence_.patterns.size(); ++i) {
    EXPECT_EQ(grey_level(folder_ / "scan/x0/left" / sequence_.patterns[i].files[0]), 1 + static_cast<int>(i));
    EXPECT_EQ(grey_level(folder_ / "scan/x0/right" / sequence_.patterns[i].files[1]), 101 + static_cast<int>(i));
  }
  EXPECT_THAT(tests::read_all(folder_ / "job.toml"), HasSubstr("axis_mm = 0.002  # planned"));
  EXPECT_FALSE(fs::exists(folder_ / "scan/x0/.taking"));
  EXPECT_TRUE(eventually([&] { return state()["stations"][0]["scan"] == "taken"; }));
  EXPECT_EQ(state()["stations"][0]["measured_mm"], 0.002);
  EXPECT_EQ(state()["stations"][1]["current"], true);
  // Its cloud cannot be computed here, which is told; the images stay.
  ASSERT_TRUE(logged("\"error\""));
  folder_.write("results/scan/x0/result.json", "{}");
  ASSERT_TRUE(commanded(R"({"command": "repeat"})"));
  ASSERT_TRUE(eventually([&] { return fs::exists(folder_ / "undone/001/scan/x0/right/00.png"); }));
  ASSERT_TRUE(eventually([&] { return fs::exists(folder_ / "scan/x0/right/00.png"); }));
  EXPECT_TRUE(fs::exists(folder_ / "undone/001/results/scan/x0/result.json")) << "the cloud of other images";
  EXPECT_FALSE(fs::exists(folder_ / "results/scan/x0"));
  ASSERT_TRUE(commanded(R"({"command": "undo"})"));
  EXPECT_FALSE(fs::exists(folder_ / "scan/x0/left"));
  EXPECT_EQ(grey_level(folder_ / "undone/002/scan/x0/left/00.png"), 1);
  EXPECT_FALSE(command(R"({"command": "undo"})")) << "one shot back";
}

TEST_F(LiveScanTest, AStopThatWasPhotographedKeepsItsReading) {
  for (const char* name : {"cross/x0_l.png", "cross/x0_r.png"}) {
    ASSERT_TRUE(base::make_folder(folder_ / "cross"));
    ASSERT_TRUE(base::write_image(folder_ / name, exposed(9)->view()));
  }
  begin();
  x_mm_ = 0.1;
  const auto off = command(R"({"command": "next"})");
  ASSERT_FALSE(off);
  EXPECT_THAT(off.error().message, HasSubstr("0.100 mm from where station x0 was photographed already"));
  x_mm_ = 0.015;
  ASSERT_TRUE(command(R"({"command": "next"})"));
  ASSERT_TRUE(logged("scan x0 taken"));
  EXPECT_THAT(tests::read_all(folder_ / "job.toml"), HasSubstr("axis_mm = 0.0  # planned"));
}

TEST_F(LiveScanTest, ABeamThatMovesOrACancelledScanLeavesNothing) {
  const auto before = contents(folder_.path());
  const auto attempt = [&](const std::function<void()>& meanwhile, const std::string& told) {
    held_at_ = 2;
    ASSERT_TRUE(commanded(R"({"command": "next"})"));
    ASSERT_TRUE(eventually([&] { return light_ == 2; }));
    const auto twice = command(R"({"command": "next"})");
    ASSERT_FALSE(twice);
    EXPECT_THAT(twice.error().message, HasSubstr("scan x0 is being taken"));
    meanwhile();
    held_at_ = -1;
    ASSERT_TRUE(logged(told)) << state()["log"].dump();
    ASSERT_TRUE(eventually([&] { return state()["work"].is_null(); }));
    fs::remove_all(folder_ / "scan/x0/.taking");  // the next attempt does so
    EXPECT_EQ(contents(folder_.path()), before);
  };
  attempt([&] { x_mm_ = 0.05; }, "the beam moved by 0.048 mm meanwhile; nothing was kept");
  x_mm_ = 0.002;
  attempt([&] { ASSERT_TRUE(command(R"({"command": "cancel"})")); }, "cancelled");
}

TEST_F(LiveScanTest, ASessionThatEndsWhileItScansLeavesWhatTheNextOneTakesUp) {
  const auto before = contents(folder_.path());
  held_at_ = 3;
  ASSERT_TRUE(command(R"({"command": "next"})"));
  ASSERT_TRUE(eventually([&] { return light_ == 3; }));
  std::jthread release([&] {
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
    held_at_ = -1;
  });
  begin();
  EXPECT_EQ(tests::read_all(folder_ / "job.toml"), kJob);
  EXPECT_EQ(state()["stations"][0]["scan"], "missing");
  ASSERT_TRUE(command(R"({"command": "next"})"));
  ASSERT_TRUE(logged("scan x0 taken"));
  EXPECT_FALSE(fs::exists(folder_ / "scan/x0/.taking"));
  const auto after = contents(folder_.path());
  EXPECT_EQ(after.size(), before.size() + 2 * sequence_.patterns.size());
}

TEST_F(LiveScanTest, UndoIsAboutThePairThatWasTakenLastWhateverItsName) {
  for (const char* side : {"left", "right"}) {
    ASSERT_TRUE(base::make_folder(folder_ / "board" / side));
    ASSERT_TRUE(base::write_image(folder_ / "board" / side / "05.png", exposed(5)->view()));
  }
  begin();
  ASSERT_TRUE(command(R"({"command": "stage", "name": "calibrate"})"));
  ASSERT_TRUE(commanded(R"({"command": "next"})"));
  ASSERT_TRUE(logged("board 01 taken; no camera sees the board"));
  ASSERT_TRUE(commanded(R"({"command": "repeat"})"));
  ASSERT_TRUE(eventually([&] { return fs::exists(folder_ / "undone/001/board/left/01.png"); })) << "not 05";
  ASSERT_TRUE(commanded(R"({"command": "undo"})"));
  EXPECT_FALSE(fs::exists(folder_ / "board/left/01.png"));
  EXPECT_TRUE(fs::exists(folder_ / "board/left/05.png"));
  ASSERT_TRUE(commanded(R"({"command": "undo"})")) << "then the last one in the folder";
  EXPECT_FALSE(fs::exists(folder_ / "board/left/05.png"));
  EXPECT_FALSE(command(R"({"command": "undo"})"));
}

TEST_F(LiveScanTest, AnAxisThatIsReadTakesNoTypedPositionAndAnOldReadingIsRefused) {
  const auto typed = command(R"({"command": "axis", "position_mm": 1.0})");
  ASSERT_FALSE(typed);
  EXPECT_THAT(typed.error().message, HasSubstr("read from the machine"));
  session_.reset();
  LiveDevices devices;
  devices::SimulatedAxis silent{
      [](devices::HostTime) -> Result<double> { return base::fail(ErrorCode::kDevice, "the control is off"); }};
  devices.pairs = &pair_;
  devices.axis = &silent;
  devices.projector = &projector_;
  devices.preview.trigger = devices.capture.settings.trigger = devices::TriggerMode::kSoftware;
  auto session = LiveSession::begin(folder_.path(), devices, feed_, 1);
  ASSERT_TRUE(session);
  const auto refused = (*session)->command(R"({"command": "next"})");
  ASSERT_FALSE(refused);
  EXPECT_THAT(refused.error().message, HasSubstr("the control is off"));
}

}  // namespace
}  // namespace crosstie::app
