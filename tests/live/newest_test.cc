#include <atomic>
#include <chrono>
#include <stop_token>
#include <string>
#include <thread>
#include <vector>

#include <gtest/gtest.h>

#include "live/feed.h"

namespace crosstie::live {
namespace {

constexpr double kLong_s = 30.0;

TEST(Newest, HasNothingBeforeTheFirstAndTheNewestAfterwards) {
  Newest<std::string> newest;
  EXPECT_EQ(newest.version(), 0u);
  EXPECT_FALSE(newest.newest());
  EXPECT_FALSE(newest.wait_newer(0, 0.0));
  newest.publish("a");
  newest.publish("b");
  EXPECT_EQ(newest.version(), 2u);
  EXPECT_EQ(newest.newest()->value, "b");
  const auto found = newest.wait_newer(0, kLong_s);
  ASSERT_TRUE(found);
  EXPECT_EQ(found->version, 2u);
  EXPECT_EQ(found->value, "b");
  EXPECT_FALSE(newest.wait_newer(2, 0.01));
}

TEST(Newest, AReaderSeesVersionsInOrderAndTheLast) {
  Newest<int> newest;
  constexpr int kCount = 20'000;
  std::jthread publisher([&] {
    for (int i = 1; i <= kCount; ++i) newest.publish(i);
  });
  std::uint64_t seen = 0;
  while (seen < kCount) {
    const auto found = newest.wait_newer(seen, kLong_s);
    ASSERT_TRUE(found);
    ASSERT_GT(found->version, seen);
    ASSERT_EQ(found->value, static_cast<int>(found->version));
    seen = found->version;
  }
}

TEST(Newest, AStopEndsTheWaiting) {
  Newest<int> newest;
  std::stop_source stop;
  std::jthread stopper([&] {
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
    stop.request_stop();
  });
  const auto begin = std::chrono::steady_clock::now();
  EXPECT_FALSE(newest.wait_newer(0, kLong_s, stop.get_token()));
  EXPECT_LT(std::chrono::steady_clock::now() - begin, std::chrono::seconds(10));
}

/// Counts its instances.
struct Counted {
  explicit Counted(std::atomic<int>& all) : count(&all) { ++*count; }
  Counted(const Counted& other) : count(other.count) { ++*count; }
  Counted& operator=(const Counted&) = delete;
  ~Counted() { --*count; }
  std::atomic<int>* count;
};

TEST(Newest, KeepsOneValueHoweverManyArePublished) {
  std::atomic<int> count = 0;
  {
    Newest<Counted> newest;
    for (int i = 0; i < 100; ++i) newest.publish(Counted(count));
    EXPECT_EQ(count, 1);
  }
  EXPECT_EQ(count, 0);
}

}  // namespace
}  // namespace crosstie::live
