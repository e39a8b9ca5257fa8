// The operator's session with simulated cameras: what it takes, where it puts it, and what it refuses.
#include <filesystem>
#include <memory>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "app/live/live_session.h"
#include "base/file.h"
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

const devices::CameraSettings kTriggered = {.exposure_s = 0.001, .trigger = devices::TriggerMode::kSoftware};

class LiveSessionTest : public ::testing::Test {
 protected:
  void SetUp() override {
    ASSERT_TRUE(base::write_file_atomically(folder_ / "job.toml", tests::live_job(R"([[station]]
name = "x850"
axis_mm = 850.0  # planned
cross = { left = "cross/x850_l.png", right = "cross/x850_r.png" }
)")));
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
  tests::GreyCameras cameras_;
  devices::TypedAxis axis_;
  live::Feed feed_;
  std::unique_ptr<LiveSession> session_;
};

TEST_F(LiveSessionTest, PairsOfTheBoardAreTakenRepeatedAndUndone) {
  ASSERT_TRUE(idle());
  cameras_.level = 70;
  ASSERT_TRUE(command(R"({"command": "next"})"));
  ASSERT_TRUE(eventually([&] { return grey_level(folder_ / "board/right/01.png") == 71; }));
  EXPECT_EQ(grey_level(folder_ / "board/left/01.png"), 70);
  ASSERT_TRUE(eventually([&] { return state()["can"]["repeat"] == true; }));
  EXPECT_EQ(state()["stages"][0]["have"], 1);
  cameras_.level = 80;
  ASSERT_TRUE(eventually([&] { return command(R"({"command": "repeat"})").has_value(); }));
  ASSERT_TRUE(eventually([&] { return grey_level(folder_ / "board/right/01.png") == 81; }));
  EXPECT_EQ(grey_level(folder_ / "undone/001/board/left/01.png"), 70) << "what was taken before is kept";
  // The state is up to a tenth of a second old, and refuses nothing: the session does, as long as the pair is looked at.
  ASSERT_TRUE(eventually([&] { return command(R"({"command": "undo"})").has_value(); }));
  EXPECT_FALSE(fs::exists(folder_ / "board/left/01.png"));
  EXPECT_EQ(grey_level(folder_ / "undone/002/board/right/01.png"), 81);
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

TEST_F(LiveSessionTest, AStationIsChosenOnlyWhereItHasWork) {
  ASSERT_TRUE(command(R"({"command": "stage", "name": "commission"})"));
  ASSERT_TRUE(idle());
  ASSERT_TRUE(eventually([&] { return !state()["stations"].empty(); }));
  EXPECT_TRUE(command(R"({"command": "select", "station": "x850"})"));
  ASSERT_TRUE(command(R"({"command": "stage", "name": "scan"})"));
  const auto refused = command(R"({"command": "select", "station": "x850"})");
  ASSERT_FALSE(refused) << "the job scans nothing there";
  EXPECT_THAT(refused.error().message, HasSubstr("no scan at station 'x850'"));
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
