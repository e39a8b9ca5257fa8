// How measuring images are taken: which exposure counts as the one that was asked for, and what lies on the disk when something fails.
#include <atomic>
#include <chrono>
#include <filesystem>
#include <functional>
#include <future>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "app/live/capture.h"
#include "app/live/tapped_pairs.h"
#include "base/file.h"
#include "base/image.h"
#include "devices/simulated_camera.h"
#include "scan/patterns.h"
#include "tests/app/live_cameras.h"
#include "tests/devices/eventually.h"
#include "tests/support/temporary_folder.h"

namespace crosstie::app {
namespace {

namespace fs = std::filesystem;
using base::ErrorCode;
using base::Progress;
using base::Result;
using devices::CameraSettings;
using devices::FramePair;
using devices::HostTime;
using testing::HasSubstr;
using tests::eventually;
using tests::grey_level;
using tests::GreyCameras;

CameraSettings triggered(double exposure_s) {
  CameraSettings settings;
  settings.exposure_s = exposure_s;
  settings.trigger = devices::TriggerMode::kSoftware;
  return settings;
}

template <typename T>
bool is_ready(const std::future<T>& future, int milliseconds = 0) {
  return future.wait_for(std::chrono::milliseconds(milliseconds)) == std::future_status::ready;
}

/// A source whose pairs arrive when the test says so.
class PairsByHand : public devices::PairSource {
 public:
  Result<CameraSettings> start(const CameraSettings& settings, devices::PairSink sink) override {
    const std::lock_guard lock(mutex_);
    sink_ = std::move(sink);
    return settings;
  }
  void stop() override {
    const std::lock_guard lock(mutex_);
    sink_ = nullptr;
  }
  Result<> trigger() override {
    ++triggers;
    return {};
  }
  std::array<devices::CameraState, 2> states() override { return {}; }
  devices::FramePairingCounts counts() override { return {}; }

  void arrive(int level, HostTime at) {
    const std::lock_guard lock(mutex_);
    if (!sink_) return;
    FramePair pair{{{1, {}, at}, tests::grey_image(8, 6, level), {}}, {{1, {}, at}, tests::grey_image(8, 6, level), {}}};
    sink_(std::move(pair));
  }
  void arrive(int level) { arrive(level, devices::host_now()); }

  std::atomic<int> triggers = 0;

 private:
  std::mutex mutex_;
  devices::PairSink sink_;
};

TEST(TappedPairs, APairIsNeverOlderThanTheRequest) {
  GreyCameras cameras;
  TappedPairs pairs(cameras.pair, 200.0);
  std::atomic<int> seen = 0;
  ASSERT_TRUE(pairs.start(triggered(0.001), [&](const auto& pair) { seen += pair ? 1 : 0; }));
  ASSERT_TRUE(eventually([&] { return seen > 5; })) << "the preview triggers by itself";
  for (int level = 60; level < 90; ++level) {
    ASSERT_TRUE(pairs.measure(triggered(0.001)));
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
  GreyCameras cameras;
  TappedPairs pairs(cameras.pair, 50.0);
  ASSERT_TRUE(pairs.start(triggered(0.001), {}));
  cameras.left.unplug();
  const auto lost = pairs.take(devices::host_now(), 5.0);
  ASSERT_FALSE(lost);
  EXPECT_EQ(lost.error().code, ErrorCode::kDevice);
  EXPECT_FALSE(pairs.measure(triggered(0.001)));
  ASSERT_TRUE(pairs.start(triggered(0.001), {}));
  ASSERT_TRUE(pairs.measure(triggered(0.001)));
  EXPECT_TRUE(pairs.take(devices::host_now(), 5.0));
}

TEST(TappedPairs, ALostFrameIsExposedAgain) {
  GreyCameras cameras;
  TappedPairs pairs(cameras.pair, 50.0);
  ASSERT_TRUE(pairs.start(triggered(0.001), {}));
  ASSERT_TRUE(pairs.measure(triggered(0.001)));
  cameras.losses = 1;
  const auto pair = pairs.take(devices::host_now(), 10.0);
  ASSERT_TRUE(pair) << pair.error().message;
  cameras.losses = 100;
  EXPECT_FALSE(pairs.take(devices::host_now(), 1.5)) << "but not for ever";
}

TEST(TappedPairs, APairThatThePreviewTriggeredIsNoMeasurement) {
  PairsByHand source;
  TappedPairs pairs(source, 100.0);
  ASSERT_TRUE(pairs.start(triggered(0.01), {}));
  ASSERT_TRUE(eventually([&] { return source.triggers == 1; }));
  auto measuring = std::async(std::launch::async, [&] { return pairs.measure(triggered(0.01)); });
  EXPECT_FALSE(is_ready(measuring, 100)) << "the preview's pair is under way";
  source.arrive(10);
  ASSERT_TRUE(measuring.get());
  auto taking = std::async(std::launch::async, [&] { return pairs.take(devices::host_now(), 5.0); });
  ASSERT_TRUE(eventually([&] { return source.triggers == 2; }));
  source.arrive(20);
  const auto pair = taking.get();
  ASSERT_TRUE(pair) << pair.error().message;
  EXPECT_EQ(grey_level(pair->left.image), 20);
}

TEST(TappedPairs, APairThatWasTriggeredTwiceIsNotTakenForTheNextOne) {
  PairsByHand source;
  TappedPairs pairs(source, 100.0);
  ASSERT_TRUE(pairs.start(triggered(0.01), {}));
  ASSERT_TRUE(eventually([&] { return source.triggers == 1; }));
  source.arrive(1);
  auto measuring = std::async(std::launch::async, [&] { return pairs.measure(triggered(0.01)); });
  while (!is_ready(measuring, 5)) source.arrive(1);
  ASSERT_TRUE(measuring.get());
  const int before = source.triggers;
  auto first = std::async(std::launch::async, [&] { return pairs.take(devices::host_now(), 5.0); });
  ASSERT_TRUE(eventually([&] { return source.triggers == before + 2; })) << "one that does not come is triggered again";
  source.arrive(30);
  ASSERT_EQ(grey_level(first.get()->left.image), 30);
  // The second trigger's pair shows what was there before, however late it arrives.
  auto second = std::async(std::launch::async, [&] { return pairs.take(devices::host_now(), 5.0); });
  EXPECT_FALSE(is_ready(second, 50));
  source.arrive(31);
  ASSERT_TRUE(eventually([&] { return source.triggers == before + 3; }));
  EXPECT_FALSE(is_ready(second, 50)) << "31 was exposed before it was asked for";
  source.arrive(40);
  EXPECT_EQ(grey_level(second.get()->left.image), 40);
}

TEST(TappedPairs, OfCamerasThatRunFreelyAnExposureThatBeganBeforeIsNotTaken) {
  PairsByHand source;
  TappedPairs pairs(source, 100.0);
  CameraSettings free;
  free.exposure_s = 0.2;
  ASSERT_TRUE(pairs.start(free, {}));
  ASSERT_TRUE(pairs.measure(free));
  const HostTime asked = devices::host_now();
  auto taking = std::async(std::launch::async, [&] { return pairs.take(asked, 5.0); });
  for (const double late_s : {-0.1, 0.0, 0.1, 0.199}) {
    for (int i = 0; i < 5; ++i) {  // take() may only begin now
      source.arrive(10, asked + devices::to_nanoseconds(late_s));
      EXPECT_FALSE(is_ready(taking, 5)) << "complete " << late_s << " s after the request: its exposure began before";
    }
  }
  source.arrive(20, asked + devices::to_nanoseconds(0.21));
  while (!is_ready(taking, 5)) source.arrive(20, asked + devices::to_nanoseconds(0.21));
  EXPECT_EQ(grey_level(taking.get()->left.image), 20);
  EXPECT_EQ(source.triggers, 0);
}

TEST(TappedPairs, WhatDoesNotComeIsToldAndACancelledWaitEnds) {
  PairsByHand source;
  TappedPairs pairs(source, 100.0);
  EXPECT_EQ(pairs.take(devices::host_now(), 1.0).error().code, ErrorCode::kDevice) << "not started";
  CameraSettings free;
  ASSERT_TRUE(pairs.start(free, {}));
  const auto none = pairs.take(devices::host_now(), 0.1);
  ASSERT_FALSE(none);
  EXPECT_EQ(none.error().code, ErrorCode::kDevice);
  EXPECT_THAT(none.error().message, HasSubstr("no pair of images came within 0.1 s"));
  std::stop_source stop;
  auto waiting = std::async(std::launch::async, [&] {
    return pairs.take(devices::host_now(), 60.0, Progress{.report = {}, .stop = stop.get_token()});
  });
  EXPECT_FALSE(is_ready(waiting, 20));
  stop.request_stop();
  ASSERT_TRUE(is_ready(waiting, 5000));
  EXPECT_EQ(waiting.get().error().code, ErrorCode::kCancelled);
}

constexpr double kPreview_s = 0.001;
constexpr double kMeasure_s = 0.002;

/// Two cameras before a projector; a pattern's light is its index, and the exposure that it got is written down.
class CaptureTest : public ::testing::Test {
 protected:
  void SetUp() override {
    sequence_ = *scan::make_patterns(
        {.width_px = 64, .height_px = 32, .periods_px = {16.0}, .steps = 3, .y = false, .exposures = {1.0, 3.0}});
    std::vector<base::Image> images;
    for (std::size_t i = 0; i < sequence_.patterns.size(); ++i) images.emplace_back(64, 32, 8);
    ASSERT_TRUE(projector_.upload(sequence_, std::move(images)));
    exposures_s_.resize(sequence_.patterns.size());
    ASSERT_TRUE(pairs_.start(triggered(kPreview_s), [this](const auto& pair) { seen_ += pair ? 1 : 0; }));
    ASSERT_TRUE(eventually([&] { return seen_ > 2; }));
  }
  Result<base::Image> exposed(const devices::SimulatedExposure& exposure, int more) {
    if (blind_) return base::fail(ErrorCode::kDevice, "lost on its way");
    const int light = light_;
    if (light >= 0) {
      const std::lock_guard lock(mutex_);
      exposures_s_[static_cast<std::size_t>(light)] = exposure.settings.exposure_s;
    }
    return tests::grey_image(8, 6, 10 + light + more);
  }
  Result<> take(const Progress& progress = {}) {
    return take_sequence(pairs_, projector_, sequence_, options_, places_, progress);
  }
  /// The cameras are with the preview again, and nothing was put into its place.
  void expect_as_before() {
    EXPECT_FALSE(fs::exists(places_[0]));
    EXPECT_FALSE(fs::exists(places_[1]));
    ASSERT_TRUE(pairs_.settings());
    EXPECT_EQ(pairs_.settings()->exposure_s, kPreview_s);
    const int before = seen_;
    EXPECT_TRUE(eventually([&] { return seen_ > before; }));
  }
  [[nodiscard]] fs::path file(std::size_t side, std::size_t pattern) const {
    return places_[side] / sequence_.patterns[pattern].files[side];
  }

  tests::TemporaryFolder folder_;
  PairOfFiles places_ = {folder_ / "scan/a/left", folder_ / "scan/a/right"};
  std::atomic<int> light_ = -1;
  std::atomic<bool> blind_ = false;
  std::atomic<int> broken_at_ = -1;
  std::atomic<int> seen_ = 0;
  std::mutex mutex_;
  std::vector<double> exposures_s_;
  base::PatternSequence sequence_;
  CaptureOptions options_ = {.settings = triggered(kMeasure_s), .timeout_s = 5.0};
  devices::SimulatedCamera left_{"left", [this](const auto& exposure) { return exposed(exposure, 0); }};
  devices::SimulatedCamera right_{"right", [this](const auto& exposure) { return exposed(exposure, 100); }};
  devices::CameraPair cameras_{left_, right_, {.max_host_skew_s = 0.5, .max_device_skew_s = 1.0}};
  devices::SimulatedSequencer projector_{[this](std::size_t index, const auto&, const auto&) -> Result<> {
    if (static_cast<int>(index) == broken_at_) return base::fail(ErrorCode::kDevice, "the lamp is broken");
    light_ = static_cast<int>(index);
    return {};
  }};
  TappedPairs pairs_{cameras_, 500.0};
};

TEST_F(CaptureTest, EachImageIsOfItsPatternAndItsExposure) {
  const auto taken = take();
  ASSERT_TRUE(taken) << taken.error().message;
  EXPECT_EQ(pairs_.settings()->exposure_s, kPreview_s);
  const PairOfFiles staging = staged(places_);
  EXPECT_EQ(staging[0], folder_ / "scan/a/.taking/left");
  EXPECT_TRUE(fs::exists(staging[0] / sequence_.patterns.back().files[0]));
  EXPECT_FALSE(fs::exists(places_[0])) << "not before it is placed";
  ASSERT_TRUE(place(places_));
  EXPECT_FALSE(fs::exists(folder_ / "scan/a/.taking"));
  const std::lock_guard lock(mutex_);
  for (std::size_t i = 0; i < sequence_.patterns.size(); ++i) {
    EXPECT_EQ(grey_level(file(0, i)), 10 + static_cast<int>(i));
    EXPECT_EQ(grey_level(file(1, i)), 110 + static_cast<int>(i));
    // The preview may see the last pattern once more.
    if (i + 1 < sequence_.patterns.size()) {
      EXPECT_DOUBLE_EQ(exposures_s_[i], kMeasure_s * sequence_.patterns[i].exposure) << "pattern " << i;
    }
  }
}

TEST_F(CaptureTest, AProjectorThatFailsLeavesNothingInPlace) {
  broken_at_ = 3;
  const auto taken = take();
  ASSERT_FALSE(taken);
  EXPECT_THAT(taken.error().message, HasSubstr("the lamp is broken"));
  expect_as_before();
  broken_at_ = -1;
  ASSERT_TRUE(take()) << "and is begun anew";
  ASSERT_TRUE(place(places_));
  EXPECT_EQ(grey_level(file(1, 3)), 113);
}

TEST_F(CaptureTest, ACameraThatIsLostIsToldWithThePattern) {
  Progress progress;
  progress.report = [&](std::string_view, std::size_t done, std::size_t) {
    if (done == 2) right_.unplug();
  };
  const auto taken = take(progress);
  ASSERT_FALSE(taken);
  EXPECT_EQ(taken.error().code, ErrorCode::kDevice);
  EXPECT_THAT(taken.error().message, HasSubstr("pattern 3 of "));
  EXPECT_FALSE(fs::exists(places_[0]));
  EXPECT_FALSE(take()) << "the cameras are to be connected first";
  ASSERT_TRUE(pairs_.start(triggered(kPreview_s), [this](const auto& pair) { seen_ += pair ? 1 : 0; }));
  EXPECT_TRUE(take());
}

TEST_F(CaptureTest, ACancelledSequenceLeavesNothingInPlace) {
  std::stop_source stop;
  Progress progress;
  progress.stop = stop.get_token();
  progress.report = [&](std::string_view, std::size_t done, std::size_t) {
    if (done == 2) stop.request_stop();
  };
  const auto taken = take(progress);
  ASSERT_FALSE(taken);
  EXPECT_EQ(taken.error().code, ErrorCode::kCancelled);
  expect_as_before();
}

TEST_F(CaptureTest, WhatAKillLeftIsRemovedByTheNextAttempt) {
  // As it lies there when the process is killed between two patterns.
  const PairOfFiles staging = staged(places_);
  for (const fs::path& one : staging) {
    ASSERT_TRUE(base::make_folder(one));
    ASSERT_TRUE(base::write_file_atomically(one / "99.png", "half an im"));
  }
  ASSERT_TRUE(take());
  ASSERT_TRUE(place(places_));
  EXPECT_TRUE(fs::exists(file(0, 0)));
  EXPECT_FALSE(fs::exists(places_[0] / "99.png"));
  EXPECT_FALSE(fs::exists(places_[1] / "99.png"));
}

TEST_F(CaptureTest, APairIsTakenWithItsSettingsAndThePreviewGoesOn) {
  light_ = 0;
  const PairOfFiles pair = {folder_ / "board/left/01.png", folder_ / "board/right/01.png"};
  const auto taken = take_pair(pairs_, options_, pair);
  ASSERT_TRUE(taken) << taken.error().message;
  EXPECT_FALSE(fs::exists(pair[0]));
  ASSERT_TRUE(place(pair));
  EXPECT_EQ(grey_level(pair[0]), 10);
  EXPECT_EQ(grey_level(pair[1]), 110);
  expect_as_before();
}

TEST_F(CaptureTest, APairThatDoesNotComeIsToldInTime) {
  blind_ = true;
  options_.timeout_s = 0.2;
  const auto begin = std::chrono::steady_clock::now();
  const auto taken = take_pair(pairs_, options_, {folder_ / "l.png", folder_ / "r.png"});
  ASSERT_FALSE(taken);
  EXPECT_EQ(taken.error().code, ErrorCode::kDevice);
  EXPECT_LT(std::chrono::steady_clock::now() - begin, std::chrono::seconds(4));
  blind_ = false;
  expect_as_before();
}

TEST_F(CaptureTest, WhatIsTakenIsNotReplacedNotEvenHalfOfIt) {
  const PairOfFiles pair = {folder_ / "l.png", folder_ / "r.png"};
  ASSERT_TRUE(take_pair(pairs_, options_, pair));
  ASSERT_TRUE(base::write_file_atomically(pair[1], "mine"));
  const auto placed = place(pair);
  ASSERT_FALSE(placed);
  EXPECT_EQ(placed.error().code, ErrorCode::kFileSystem);
  EXPECT_THAT(placed.error().message, HasSubstr("r.png"));
  EXPECT_EQ(*base::read_file(pair[1]), "mine");
  EXPECT_FALSE(fs::exists(pair[0])) << "a left image beside a right one of another moment would seem to be a pair";
  fs::remove(pair[1]);
  EXPECT_TRUE(place(pair)) << "nothing was lost";
}

TEST_F(CaptureTest, AFolderThatIsEmptyIsFreeAndAFullOneIsNot) {
  ASSERT_TRUE(take());
  ASSERT_TRUE(base::make_folder(places_[0]));
  ASSERT_TRUE(base::make_folder(places_[1]));
  ASSERT_TRUE(place(places_)) << "as git or a script made them";
  ASSERT_TRUE(take());
  EXPECT_FALSE(place(places_));
  EXPECT_FALSE(place({folder_ / "no/left", folder_ / "no/right"})) << "nothing was taken for it";
}

}  // namespace
}  // namespace crosstie::app
