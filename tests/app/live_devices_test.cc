// What devices.toml says of a machine's cameras, axis and projector, and what is refused of it.
#include <filesystem>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "app/live/devices_file.h"
#include "base/file.h"
#include "base/image.h"
#include "devices/axis_reader.h"
#include "scan/patterns.h"
#include "tests/support/temporary_folder.h"

namespace crosstie::app {
namespace {

namespace fs = std::filesystem;
using base::ErrorCode;
using testing::AllOf;
using testing::HasSubstr;

constexpr const char* kFolders =
    "format = \"crosstie-devices/1\"\n[cameras]\nkind = \"folders\"\nleft = \"in/l_*.png\"\nright = \"in/r_*.png\"\n";

class DevicesFileTest : public ::testing::Test {
 protected:
  void SetUp() override {
    ASSERT_TRUE(base::make_folder(folder_ / "in"));
    ASSERT_TRUE(base::make_folder(folder_ / "patterns"));
  }
  [[nodiscard]] fs::path file(const std::string& text) const { return folder_.write("devices.toml", text); }

  tests::TemporaryFolder folder_;
};

TEST_F(DevicesFileTest, LittleIsNeededAndTheRestHasItsDefaults) {
  const auto open = open_devices(file(kFolders));
  ASSERT_TRUE(open) << open.error().message;
  EXPECT_NE(open->live.pairs, nullptr);
  EXPECT_NE(open->live.typed, nullptr) << "the axis is typed in";
  EXPECT_EQ(open->live.axis, open->live.typed);
  EXPECT_EQ(open->live.axis_max_age_s, 120.0);
  EXPECT_EQ(open->live.projector, nullptr);
  EXPECT_EQ(open->live.preview_hz, 10.0);
  EXPECT_EQ(open->live.capture.timeout_s, 5.0);
  EXPECT_EQ(open->live.capture.settings.trigger, devices::TriggerMode::kFreeRunning) << "other software triggers them";
  EXPECT_EQ(open->live.preview.exposure_s, 0.010);
}

TEST_F(DevicesFileTest, EverythingThatIsDocumentedIsRead) {
  ASSERT_TRUE(base::write_file_atomically(folder_ / "axis.txt", "X -1.5 in\n"));
  const auto open = open_devices(file(R"(format = "crosstie-devices/1"
[cameras]
kind = "folders"
left = "in/l_*.png"
right = "in/r_*.png"
exposure_s = 0.02
gain = 3.5
format = "Mono12"
trigger = "none"
trigger_line = "Line3"
preview_hz = 4
width_px = 640
height_px = 480
timeout_s = 7
[axis]
kind = "file"
path = "axis.txt"
label = "X"
unit = "in"
mm_per_unit = -25.4
zero_mm = 1000.0
min_mm = 0.0
max_mm = 2000.0
request = "?"
period_s = 0.2
max_age_s = 33
[projector]
kind = "files"
folder = "show"
patterns = "patterns"
)"));
  ASSERT_TRUE(open) << open.error().message;
  for (const devices::CameraSettings& settings : {open->live.preview, open->live.capture.settings}) {
    EXPECT_EQ(settings.exposure_s, 0.02);
    EXPECT_EQ(settings.gain, 3.5);
    EXPECT_EQ(settings.format, devices::PixelFormat::kMono12);
    EXPECT_EQ(settings.trigger, devices::TriggerMode::kFreeRunning);
    EXPECT_EQ(settings.trigger_line, "Line3");
    EXPECT_EQ(settings.frame_rate_hz, 4.0) << "cameras that run freely keep the rate themselves";
    EXPECT_EQ(settings.width_px, 640);
    EXPECT_EQ(settings.height_px, 480);
  }
  EXPECT_EQ(open->live.preview_hz, 4.0);
  EXPECT_EQ(open->live.capture.timeout_s, 7.0);
  EXPECT_EQ(open->live.typed, nullptr);
  EXPECT_EQ(open->live.axis_max_age_s, 33.0);
  ASSERT_NE(open->live.axis, nullptr);
  const devices::AxisState axis = open->live.axis->state();
  ASSERT_TRUE(axis.latest) << axis.trouble;
  EXPECT_NEAR(axis.latest->position_mm, 1038.1, 1e-9) << "-1.5 in of -25.4 mm each, from 1000 mm";
  EXPECT_NE(open->live.projector, nullptr);
  EXPECT_TRUE(open->live.pattern_images);
}

TEST_F(DevicesFileTest, WhatIsWrongIsToldWithFileAndLine) {
  const std::string folders = kFolders;  // five lines
  struct Case {
    std::string text;
    int line;
    const char* words;
  };
  const Case cases[] = {
      {"format = \"crosstie-devices/1\"\n[cameras\n", 2, ""},
      {"[cameras]\nleft = \"a\"\nright = \"b\"\n", 0, "crosstie-devices/1"},
      {"format = \"crosstie-job/1\"\n[cameras]\nleft = \"a\"\nright = \"b\"\n", 1, "crosstie-devices/1"},
      {"format = \"crosstie-devices/1\"\n", 0, "[cameras] is needed"},
      {"format = \"crosstie-devices/1\"\n[cameras]\nleft = \"a\"\n", 2, "left and right"},
      {"format = \"crosstie-devices/1\"\n[camera]\nleft = \"a\"\n", 2, "camera"},
      {folders + "exposure = 1\n", 6, "exposure"},
      {folders + "exposure_s = 0\n", 6, "exposure_s"},
      {folders + "exposure_s = \"fast\"\n", 6, "exposure_s"},
      {folders + "gain = -1\n", 6, "gain"},
      {folders + "format = \"RGB8\"\n", 6, "Mono16"},
      {folders + "trigger = \"magic\"\n", 6, "software"},
      {folders + "trigger = \"hardware\"\n", 6, "other software"},
      {folders + "preview_hz = 0\n", 6, "preview_hz"},
      {folders + "width_px = 1.5\n", 6, "whole number"},
      {folders + "frame_rate_hz = 5\n", 6, "frame_rate_hz"},
      {folders + "timeout_s = -5\n", 6, "timeout_s"},
      {folders + "[axis]\nkind = \"guess\"\n", 7, "typed"},
      {folders + "[axis]\nkind = \"file\"\n", 7, "path"},
      {folders + "[axis]\nkind = \"tcp\"\nhost = \"127.0.0.1\"\n", 7, "port"},
      {folders + "[axis]\nkind = \"tcp\"\nhost = \"127.0.0.1\"\nport = 99.5\n", 9, "whole number"},
      {folders + "[axis]\nkind = \"tcp\"\nhost = \"127.0.0.1\"\nport = 65536\n", 9, "65535"},
      {folders + "[axis]\nkind = \"serial\"\n", 7, "device"},
      {folders + "[axis]\nkind = \"serial\"\ndevice = \"/dev/ttyS0\"\nparity = \"some\"\n", 9, "parity"},
      {folders + "[axis]\nspeed = 3\n", 7, "speed"},
      {folders + "[axis]\nmax_age_s = 0\n", 7, "max_age_s"},
      {folders + "[projector]\nkind = \"window\"\n", 7, "patterns"},
      {folders + "[projector]\nkind = \"files\"\npatterns = \"patterns\"\n", 7, "folder"},
      {folders + "[projector]\nscreen = -1\n", 7, "screen"},
  };
  for (const Case& one : cases) {
    const auto open = open_devices(file(one.text));
    ASSERT_FALSE(open) << one.text;
    EXPECT_EQ(open.error().code, ErrorCode::kBadInput) << one.text;
    const std::string place = one.line > 0 ? "devices.toml:" + std::to_string(one.line) + ":" : "devices.toml";
    EXPECT_THAT(open.error().message, AllOf(HasSubstr(place), HasSubstr(one.words))) << one.text;
  }
  EXPECT_EQ(open_devices(folder_ / "none.toml").error().code, ErrorCode::kFileSystem);
}

TEST_F(DevicesFileTest, PatternsAreShownForTheirManifestAlone) {
  const scan::PatternOptions options{.width_px = 64, .height_px = 32, .periods_px = {16.0}, .steps = 4};
  const auto sequence = scan::make_patterns(options);
  ASSERT_TRUE(sequence);
  const fs::path patterns = folder_ / "patterns";
  ASSERT_TRUE(base::write_pattern_manifest(patterns / "patterns.json", *sequence));
  const PatternImages images = patterns_in(patterns);
  EXPECT_FALSE(images(*sequence)) << "no images yet";
  for (const base::Pattern& pattern : sequence->patterns)
    ASSERT_TRUE(base::write_image(patterns / pattern.files[0], scan::render_pattern(options, *sequence, pattern).view()));
  // A job names the cameras' images as it likes.
  base::PatternSequence renamed = *sequence;
  for (base::Pattern& pattern : renamed.patterns) pattern.files = {"l_" + pattern.files[0], "r_" + pattern.files[1]};
  const auto shown = images(renamed);
  ASSERT_TRUE(shown) << shown.error().message;
  ASSERT_EQ(shown->size(), sequence->patterns.size());
  for (std::size_t i = 0; i < shown->size(); ++i) {
    const base::Image drawn = scan::render_pattern(options, *sequence, sequence->patterns[i]);
    for (int x : {0, 5, 31, 63})
      EXPECT_EQ((*shown)[i].view().row<std::uint8_t>(17)[x], drawn.view().row<std::uint8_t>(17)[x]) << i << " at " << x;
  }
  const auto other = [&](auto change) {
    scan::PatternOptions changed = options;
    change(changed);
    return *scan::make_patterns(changed);
  };
  const base::PatternSequence others[] = {
      other([](auto& o) { o.steps = 5; }),       other([](auto& o) { o.periods_px = {8.0}; }),
      other([](auto& o) { o.width_px = 128; }),  other([](auto& o) { o.y = false; }),
      other([](auto& o) { o.inverse = false; }), other([](auto& o) { o.complementary = false; }),
      other([](auto& o) { o.repeat = false; }),  other([](auto& o) { o.exposures = {1.0, 4.0}; })};
  for (const base::PatternSequence& one : others) {
    const auto refused = images(one);
    ASSERT_FALSE(refused);
    EXPECT_EQ(refused.error().code, ErrorCode::kBadInput);
    EXPECT_THAT(refused.error().message, HasSubstr("not those of the job's manifest"));
  }
  base::PatternSequence swapped = *sequence;
  std::swap(swapped.patterns[0], swapped.patterns[1]);
  EXPECT_FALSE(images(swapped)) << "white where black is shown";
  EXPECT_FALSE(patterns_in(folder_ / "nowhere")(*sequence));
}

}  // namespace
}  // namespace crosstie::app
