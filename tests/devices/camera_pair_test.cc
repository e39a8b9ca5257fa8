#include "devices/camera_pair.h"

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <random>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "devices/newest_queue.h"
#include "devices/simulated_camera.h"
#include "tests/devices/manual_clock.h"

namespace crosstie::devices {
namespace {

using base::ErrorCode;
using std::chrono::microseconds;
using std::chrono::milliseconds;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

/// A frame of trigger `trigger`, whose id is the trigger's number plus a number that differs between the cameras. The true pairing is
/// therefore known: equal triggers.
Frame frame_of(int trigger, std::uint64_t first_id, microseconds host, microseconds device) {
  return {{first_id + static_cast<std::uint64_t>(trigger), device, HostTime(host)}, {}, {}};
}

TEST(FramePairing, PairsTheFramesOfOneTriggerAlthoughIdsAndClocksDiffer) {
  FramePairing pairing;
  std::mt19937 random(3);
  std::uniform_int_distribution<int> transfer_us(1000, 15'000);
  int pairs = 0;
  for (int trigger = 0; trigger < 500; ++trigger) {
    const microseconds time = milliseconds(50) * (trigger + 1);
    Frame left = frame_of(trigger, 65'000, time + microseconds(transfer_us(random)), time + milliseconds(777));
    Frame right = frame_of(trigger, 12, time + microseconds(transfer_us(random)), time * 1000001 / 1000000);  // 1 ppm faster
    const bool left_first = left.header.host_time < right.header.host_time;
    EXPECT_FALSE(left_first ? pairing.add(Side::kLeft, left) : pairing.add(Side::kRight, right));
    const auto pair = left_first ? pairing.add(Side::kRight, right) : pairing.add(Side::kLeft, left);
    ASSERT_TRUE(pair) << trigger;
    EXPECT_EQ(pair->left.header.id - 65'000, pair->right.header.id - 12);
    ++pairs;
  }
  EXPECT_EQ(pairing.counts().pairs, static_cast<std::uint64_t>(pairs));
  EXPECT_THAT(pairing.counts().unmatched, ElementsAre(0u, 0u));
}

TEST(FramePairing, NoPairIsFalseWhereFramesAreLost) {
  FramePairing pairing;
  std::mt19937 random(5);
  std::uniform_int_distribution<int> transfer_us(1000, 15'000);
  std::bernoulli_distribution lost(0.2);
  std::array<std::uint64_t, 2> single = {};
  std::uint64_t both = 0;
  for (int trigger = 0; trigger < 2000; ++trigger) {
    const microseconds time = milliseconds(50) * (trigger + 1);
    std::vector<std::pair<Side, Frame>> arrived;
    if (!lost(random)) {
      arrived.emplace_back(Side::kLeft, frame_of(trigger, 0, time + microseconds(transfer_us(random)), time));
    }
    if (!lost(random)) {
      arrived.emplace_back(Side::kRight,
                           frame_of(trigger, 0, time + microseconds(transfer_us(random)), time + milliseconds(9)));
    }
    if (arrived.size() == 1) ++single[static_cast<std::size_t>(arrived[0].first)];
    if (arrived.size() == 2) ++both;
    std::sort(arrived.begin(), arrived.end(),
              [](const auto& a, const auto& b) { return a.second.header.host_time < b.second.header.host_time; });
    for (auto& [side, frame] : arrived) {
      if (const auto pair = pairing.add(side, std::move(frame))) {
        EXPECT_EQ(pair->left.header.id, pair->right.header.id);
      }
    }
  }
  EXPECT_EQ(pairing.counts().pairs, both);
  // Those of the last triggers may wait still.
  EXPECT_NEAR(static_cast<double>(pairing.counts().unmatched[0]), static_cast<double>(single[0]), 4.0);
  EXPECT_NEAR(static_cast<double>(pairing.counts().unmatched[1]), static_cast<double>(single[1]), 4.0);
  EXPECT_GT(single[0], 200u);
}

TEST(FramePairing, ABusyHostDoesNotPairNeighbouringTriggers) {
  FramePairing pairing;
  const auto add = [&](Side side, int trigger, int host_ms) {
    return pairing.add(side, frame_of(trigger, 0, milliseconds(host_ms), milliseconds(50 * (trigger + 1))));
  };
  EXPECT_FALSE(add(Side::kLeft, 0, 51));
  EXPECT_TRUE(add(Side::kRight, 0, 52));
  // The right frame of trigger 1 is lost, the left one held up until the right one of trigger 2 comes.
  EXPECT_FALSE(add(Side::kLeft, 1, 149));
  EXPECT_FALSE(add(Side::kRight, 2, 151));
  EXPECT_EQ(pairing.counts().contradicted, 1u);
  EXPECT_FALSE(add(Side::kLeft, 3, 201));
  EXPECT_TRUE(add(Side::kRight, 3, 202));
  EXPECT_EQ(pairing.counts().pairs, 2u);
}

TEST(FramePairing, AFalseBeginIsGivenUp) {
  FramePairing pairing;
  const auto add = [&](Side side, int trigger, int host_ms) {
    return pairing.add(side, frame_of(trigger, 0, milliseconds(host_ms), milliseconds(50 * (trigger + 1))));
  };
  (void)add(Side::kLeft, 0, 99);
  EXPECT_TRUE(add(Side::kRight, 1, 101));  // nothing speaks against it yet
  int pairs = 0;
  for (int trigger = 2; trigger < 10; ++trigger) {
    (void)add(Side::kLeft, trigger, 50 * (trigger + 1) + 1);
    if (add(Side::kRight, trigger, 50 * (trigger + 1) + 2)) ++pairs;
  }
  EXPECT_EQ(pairs, 6);  // of 8: two are refused, the third one is believed
  EXPECT_EQ(pairing.counts().contradicted, 3u);
}

TEST(FramePairing, WhatWaitsIsBounded) {
  FramePairing pairing;
  for (int trigger = 0; trigger < 1000; ++trigger) {
    EXPECT_FALSE(pairing.add(Side::kLeft, frame_of(trigger, 0, milliseconds(50 * trigger), milliseconds(0))));
  }
  EXPECT_THAT(pairing.counts().unmatched, ElementsAre(996u, 0u));
}

class CameraPairTest : public ::testing::Test {
 protected:
  static base::Result<base::Image> black(const SimulatedExposure&) { return base::Image(4, 3, 8); }

  tests::ManualClock clock_;
  SimulatedCamera left_{"left", black, clock_.clock()};
  SimulatedCamera right_{"right", black, clock_.clock(), milliseconds(5)};
};

TEST_F(CameraPairTest, OneTriggerIsOnePair) {
  NewestQueue<FramePair> queue(8);
  CameraPair cameras(left_, right_);
  ASSERT_TRUE(
      cameras.start({.trigger = TriggerMode::kSoftware}, [&](base::Result<FramePair> pair) { queue.push(std::move(pair)); }));
  for (int i = 1; i <= 3; ++i) {
    clock_.advance(milliseconds(100));
    ASSERT_TRUE(cameras.trigger());
    const auto pair = queue.pop(0.0);
    ASSERT_TRUE(pair && *pair);
    EXPECT_EQ((*pair)->left.header.id, static_cast<std::uint64_t>(i));
    EXPECT_EQ((*pair)->right.header.id, static_cast<std::uint64_t>(i));
    EXPECT_EQ((*pair)->right.header.device_time - (*pair)->left.header.device_time, milliseconds(5));
  }
  EXPECT_EQ(cameras.counts().pairs, 3u);
  EXPECT_EQ(cameras.states()[1].frames, 3u);
}

TEST_F(CameraPairTest, ALostCameraEndsThePair) {
  NewestQueue<FramePair> queue(8);
  CameraPair cameras(left_, right_);
  ASSERT_TRUE(
      cameras.start({.trigger = TriggerMode::kSoftware}, [&](base::Result<FramePair> pair) { queue.push(std::move(pair)); }));
  right_.unplug();
  const auto ended = queue.pop(0.0);
  ASSERT_FALSE(ended);
  EXPECT_EQ(ended.error().code, ErrorCode::kDevice);
  EXPECT_THAT(ended.error().message, HasSubstr("right"));
  EXPECT_EQ(cameras.trigger().error().code, ErrorCode::kDevice);
  cameras.stop();
  EXPECT_FALSE(left_.state().running);
}

TEST_F(CameraPairTest, WhereOneCameraDoesNotStartNeitherRuns) {
  CameraPair cameras(left_, right_);
  ASSERT_TRUE(right_.start({.trigger = TriggerMode::kSoftware}, [](const base::Result<Frame>&) {}));
  const auto refused = cameras.start({.trigger = TriggerMode::kSoftware}, [](const base::Result<FramePair>&) {});
  ASSERT_FALSE(refused);
  EXPECT_THAT(refused.error().message, HasSubstr("right is running already"));
  EXPECT_FALSE(left_.state().running);
}

TEST_F(CameraPairTest, SkewsOutOfTheirDomain) {
  CameraPair cameras(left_, right_, {.max_host_skew_s = 0.0});
  EXPECT_EQ(cameras.start({.trigger = TriggerMode::kSoftware}, [](const base::Result<FramePair>&) {}).error().code,
            ErrorCode::kUsage);
}

}  // namespace
}  // namespace crosstie::devices
