#include "live/preview_loop.h"

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "devices/simulated_camera.h"

namespace crosstie::live {
namespace {

using base::ErrorCode;
using std::chrono::milliseconds;

constexpr devices::CameraSettings kTriggered{.trigger = devices::TriggerMode::kHardware};

base::Result<base::Image> grey(const devices::SimulatedExposure& exposure) {
  base::Image image(64, 48, 8);
  for (int y = 0; y < 48; ++y) {
    for (int x = 0; x < 64; ++x) image.row<std::uint8_t>(y)[x] = static_cast<std::uint8_t>(50 + exposure.id % 100);
  }
  return image;
}

/// What the loop hands out, in its order.
class Taken {
 public:
  void add(base::Result<PreviewPair> pair) {
    std::unique_lock lock(mutex_);
    if (pair) {
      ids.push_back(pair->frames.left.header.id);
      together = together && pair->frames.right.header.id == pair->pictures[1].header.id &&
                 pair->frames.left.header.id == pair->pictures[0].header.id;
      latency_ms.push_back(pair->pictures[0].latency_ms);
    } else {
      errors.push_back(pair.error());
    }
    changed_.notify_all();
    changed_.wait(lock, [this] { return !held; });
  }
  /// Whether so many pairs came within half a minute.
  bool wait_pairs(std::size_t count) {
    std::unique_lock lock(mutex_);
    return changed_.wait_for(lock, std::chrono::seconds(30), [&] { return ids.size() >= count; });
  }
  bool wait_error() {
    std::unique_lock lock(mutex_);
    return changed_.wait_for(lock, std::chrono::seconds(30), [&] { return !errors.empty(); });
  }
  void hold(bool on) {
    const std::lock_guard lock(mutex_);
    held = on;
    changed_.notify_all();
  }

  std::vector<std::uint64_t> ids;
  std::vector<double> latency_ms;
  std::vector<base::Error> errors;
  bool together = true;

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
  bool held = false;
};

struct Bench {
  devices::SimulatedCamera left{"left", grey};
  devices::SimulatedCamera right{"right", grey};
  devices::CameraPair pair{left, right, {.max_host_skew_s = 10.0, .max_device_skew_s = 10.0}};
  Feed feed;
  Taken taken;
  PreviewLoop loop{pair, feed, [this](base::Result<PreviewPair> seen) { taken.add(std::move(seen)); }};

  void expose() {
    ASSERT_TRUE(left.trigger());
    ASSERT_TRUE(right.trigger());
  }
};

TEST(PreviewLoop, EveryPairIsPublishedAndHandedOut) {
  Bench bench;
  ASSERT_TRUE(bench.loop.start(kTriggered));
  EXPECT_TRUE(bench.loop.running());
  for (std::size_t i = 1; i <= 20; ++i) {
    bench.expose();
    ASSERT_TRUE(bench.taken.wait_pairs(i));
  }
  const PreviewStatistics statistics = bench.loop.statistics();
  for (const std::size_t side : {0U, 1U}) {
    EXPECT_EQ(statistics.cameras[side].shown, 20u);
    EXPECT_EQ(statistics.cameras[side].dropped, 0u);
    EXPECT_EQ(statistics.cameras[side].lost, 0u);
    EXPECT_EQ(statistics.cameras[side].swapped, 0u);
    EXPECT_GT(statistics.cameras[side].latency_ms, 0.0);
    EXPECT_GT(statistics.cameras[side].rate_hz, 0.0);
    EXPECT_EQ(bench.feed.pictures[side].version(), 20u);
    EXPECT_EQ(bench.feed.pictures[side].wait_newer(19, 1.0)->value.substr(0, 2), "\xff\xd8");
  }
  EXPECT_EQ(statistics.pairs.pairs, 20u);
  bench.loop.stop();
  EXPECT_FALSE(bench.loop.running());
  EXPECT_TRUE(bench.taken.together);
  EXPECT_EQ(bench.taken.ids.front(), 1u);
  EXPECT_EQ(bench.taken.ids.back(), 20u);
}

TEST(PreviewLoop, WhereItIsTooSlowTheNewestWin) {
  Bench bench;
  ASSERT_TRUE(bench.loop.start(kTriggered));
  bench.taken.hold(true);
  bench.expose();
  ASSERT_TRUE(bench.taken.wait_pairs(1));  // the first one is held in the sink
  for (int i = 0; i < 9; ++i) bench.expose();
  EXPECT_EQ(bench.loop.statistics().cameras[0].dropped, 7u);
  bench.taken.hold(false);
  ASSERT_TRUE(bench.taken.wait_pairs(3));
  bench.loop.stop();
  EXPECT_THAT(bench.taken.ids, ::testing::ElementsAre(1, 9, 10));
  // What is dropped here was not lost on its way.
  EXPECT_EQ(bench.loop.statistics().pairs.pairs, 10u);
}

TEST(PreviewLoop, LostFramesAreThoseThatNoCameraDelivered) {
  std::atomic<bool> fails = false;
  devices::SimulatedCamera left("left", [&](const devices::SimulatedExposure& exposure) -> base::Result<base::Image> {
    if (fails) return base::fail(ErrorCode::kDevice, "a packet did not arrive");
    return grey(exposure);
  });
  devices::SimulatedCamera right("right", grey);
  devices::CameraPair pair(left, right, {.max_host_skew_s = 0.2, .max_device_skew_s = 10.0});
  Feed feed;
  Taken taken;
  PreviewLoop loop(pair, feed, [&](base::Result<PreviewPair> seen) { taken.add(std::move(seen)); });
  ASSERT_TRUE(loop.start(kTriggered));
  std::size_t good = 0;
  for (int i = 0; i < 6; ++i) {
    fails = i == 2 || i == 3;
    ASSERT_TRUE(left.trigger());
    ASSERT_TRUE(right.trigger());
    if (!fails) {
      ASSERT_TRUE(taken.wait_pairs(++good));
    }
    std::this_thread::sleep_for(milliseconds(250));  // frames of different triggers are no pair
  }
  const PreviewStatistics statistics = loop.statistics();
  EXPECT_EQ(statistics.cameras[0].lost, 2u);
  EXPECT_EQ(statistics.cameras[1].lost, 0u) << "they arrived, and had no partner";
  EXPECT_EQ(statistics.pairs.unmatched[1], 2u);
}

TEST(PreviewLoop, ALostCameraIsToldOnceAndItStartsAgain) {
  Bench bench;
  ASSERT_TRUE(bench.loop.start(kTriggered));
  bench.expose();
  ASSERT_TRUE(bench.taken.wait_pairs(1));
  bench.left.unplug();
  ASSERT_TRUE(bench.taken.wait_error());
  EXPECT_FALSE(bench.loop.running());
  EXPECT_THAT(bench.loop.statistics().cameras[0].camera.trouble, ::testing::HasSubstr("lost"));
  ASSERT_TRUE(bench.loop.start(kTriggered));
  bench.expose();
  ASSERT_TRUE(bench.taken.wait_pairs(2));
  EXPECT_EQ(bench.loop.statistics().cameras[0].shown, 1u) << "since start()";
  bench.loop.stop();
  bench.loop.stop();
  ASSERT_EQ(bench.taken.errors.size(), 1u);
  EXPECT_EQ(bench.taken.errors[0].code, ErrorCode::kDevice);
}

TEST(PreviewLoop, OptionsChangeBetweenPairs) {
  Bench bench;
  ASSERT_TRUE(bench.loop.start(kTriggered));
  bench.expose();
  ASSERT_TRUE(bench.taken.wait_pairs(1));
  const std::string fine = bench.feed.pictures[0].wait_newer(0, 1.0)->value;
  EXPECT_EQ(bench.loop.set_options({PreviewOptions{.jpeg_quality = 101}, PreviewOptions{}}).error().code, ErrorCode::kUsage);
  ASSERT_TRUE(bench.loop.set_options({PreviewOptions{.jpeg_quality = 5}, PreviewOptions{}}));
  bench.expose();
  ASSERT_TRUE(bench.taken.wait_pairs(2));
  EXPECT_NE(bench.feed.pictures[0].wait_newer(1, 1.0)->value, fine);
  bench.loop.stop();
}

TEST(PreviewLoop, ASourceThatDoesNotStartIsAnError) {
  Bench bench;
  const auto refused = bench.loop.start({.exposure_s = -1.0});
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::kUsage);
  EXPECT_FALSE(bench.loop.running());
  ASSERT_TRUE(bench.loop.start(kTriggered));  // and destroyed while it runs
}

}  // namespace
}  // namespace crosstie::live
