#include "base/parallel.h"

#include <atomic>
#include <stdexcept>
#include <thread>
#include <vector>

#include <gtest/gtest.h>

namespace crosstie::base {
namespace {

TEST(Parallel, FillsEverySlotForAnyNumberOfThreads) {
  for (const int threads : {0, 1, 2, 8, 100}) {
    std::vector<int> slots(1000, 0);
    ASSERT_TRUE(parallel_for(slots.size(), threads, "test", {}, [&](std::size_t i) -> Result<> {
      slots[i] += static_cast<int>(i) + 1;
      return {};
    }));
    for (std::size_t i = 0; i < slots.size(); ++i) ASSERT_EQ(slots[i], static_cast<int>(i) + 1);
  }
  EXPECT_TRUE(parallel_for(0, 4, "none", {}, [](std::size_t) -> Result<> { return fail(ErrorCode::kInternal, "called"); }));
}

TEST(Parallel, ReportsTheSmallestFailure) {
  for (int round = 0; round < 50; ++round) {
    // 40 fails at once, 30 after a while: 30 is the answer in any order.
    const auto result = parallel_for(200, 8, "test", {}, [](std::size_t i) -> Result<> {
      if (i == 30) std::this_thread::sleep_for(std::chrono::milliseconds(2));
      if (i == 30 || i == 40 || i > 100) return fail(ErrorCode::kBadInput, std::to_string(i));
      return {};
    });
    ASSERT_FALSE(result);
    ASSERT_EQ(result.error().message, "30");
    ASSERT_EQ(result.error().code, ErrorCode::kBadInput);
  }
}

TEST(Parallel, TurnsExceptionsIntoErrors) {
  for (const int threads : {1, 4}) {
    const auto result = parallel_for(10, threads, "test", {}, [](std::size_t i) -> Result<> {
      if (i == 3) throw std::runtime_error("broken");
      if (i == 5) throw 5;
      return {};
    });
    ASSERT_FALSE(result);
    EXPECT_EQ(result.error().code, ErrorCode::kInternal);
    EXPECT_NE(result.error().message.find("broken"), std::string::npos);
  }
}

TEST(Parallel, StopsWhenAsked) {
  std::stop_source source;
  std::atomic<int> run = 0;
  Progress progress;
  progress.stop = source.get_token();
  const auto result = parallel_for(100000, 4, "searching", progress, [&](std::size_t) -> Result<> {
    if (++run == 10) source.request_stop();
    return {};
  });
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().code, ErrorCode::kCancelled);
  EXPECT_NE(result.error().message.find("searching"), std::string::npos);
  EXPECT_LT(run.load(), 20);
}

TEST(Parallel, ReportsProgressInOrderFromOneThreadAtATime) {
  std::vector<std::size_t> seen;
  std::atomic<int> inside = 0;
  Progress progress;
  progress.report = [&](std::string_view stage, std::size_t done, std::size_t total) {
    EXPECT_EQ(++inside, 1);
    EXPECT_EQ(stage, "test");
    EXPECT_EQ(total, 300U);
    seen.push_back(done);
    --inside;
  };
  ASSERT_TRUE(parallel_for(300, 8, "test", progress, [](std::size_t) -> Result<> { return {}; }));
  ASSERT_EQ(seen.size(), 301U);
  for (std::size_t i = 0; i < seen.size(); ++i) EXPECT_EQ(seen[i], i);
}

}  // namespace
}  // namespace crosstie::base
