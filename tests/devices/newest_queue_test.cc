#include "devices/newest_queue.h"

#include <memory>
#include <thread>

#include <gtest/gtest.h>

namespace crosstie::devices {
namespace {

using base::ErrorCode;

constexpr double kLong_s = 30.0;

TEST(NewestQueue, KeepsTheNewestAndCountsWhatItDropped) {
  NewestQueue<int> queue(3);
  for (int i = 0; i < 10; ++i) queue.push(i);
  EXPECT_EQ(queue.dropped(), 7u);
  for (const int expected : {7, 8, 9}) EXPECT_EQ(**queue.pop(kLong_s), expected);
  EXPECT_FALSE(queue.pop(0.0)->has_value());
}

TEST(NewestQueue, AnErrorComesAfterTheItemsBeforeItAndStays) {
  NewestQueue<int> queue(2);
  queue.push(1);
  queue.push(base::fail(ErrorCode::kDevice, "lost"));
  queue.push(2);  // nothing comes after the end
  EXPECT_EQ(**queue.pop(kLong_s), 1);
  for (int i = 0; i < 2; ++i) {
    const auto ended = queue.pop(kLong_s);
    ASSERT_FALSE(ended);
    EXPECT_EQ(ended.error().message, "lost");
  }
}

TEST(NewestQueue, HandsOverBetweenThreads) {
  NewestQueue<std::unique_ptr<int>> queue(8);
  constexpr int kCount = 20'000;
  std::jthread giver([&] {
    for (int i = 0; i < kCount; ++i) queue.push(std::make_unique<int>(i));
    queue.push(base::fail(ErrorCode::kCancelled, "end"));
  });
  int taken = 0, last = -1;
  while (const auto item = queue.pop(kLong_s)) {
    ASSERT_TRUE(item->has_value());
    EXPECT_GT(***item, last);
    last = ***item;
    ++taken;
  }
  EXPECT_EQ(last, kCount - 1);
  EXPECT_EQ(static_cast<std::uint64_t>(taken) + queue.dropped(), static_cast<std::uint64_t>(kCount));
}

}  // namespace
}  // namespace crosstie::devices
