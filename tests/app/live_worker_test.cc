// Work in the background: its order, how it ends, and that nothing of it outlives the worker.
#include <atomic>
#include <chrono>
#include <future>
#include <memory>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "app/live/worker.h"

namespace crosstie::app {
namespace {

using base::ErrorCode;
using base::Progress;
using base::Result;
using testing::ElementsAre;

void wait_for(const std::function<bool()>& holds) {
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(10);
  while (!holds() && std::chrono::steady_clock::now() < end) std::this_thread::sleep_for(std::chrono::milliseconds(1));
  ASSERT_TRUE(holds());
}

/// Runs until it is cancelled.
Result<> until_cancelled(const Progress& progress) {
  while (!progress.cancelled()) std::this_thread::sleep_for(std::chrono::milliseconds(1));
  return base::cancelled("it");
}

TEST(WorkerThread, OnePieceAfterTheOtherInTheirOrder) {
  std::vector<std::string> told;
  std::atomic<int> at_once = 0;
  std::atomic<int> most_at_once = 0;
  Worker worker([&](const std::string& what, const Result<>&) { told.push_back(what); });
  for (int i = 0; i < 50; ++i) {
    worker.add(std::to_string(i), [&](const Progress&) -> Result<> {
      most_at_once = std::max<int>(most_at_once, ++at_once);
      --at_once;
      return {};
    });
  }
  wait_for([&] { return worker.idle(); });
  ASSERT_EQ(told.size(), 50U);
  for (int i = 0; i < 50; ++i) EXPECT_EQ(told[static_cast<std::size_t>(i)], std::to_string(i));
  EXPECT_EQ(most_at_once, 1);
}

TEST(WorkerThread, TheStatusIsOfWhatRunsElseOfWhatIsNext) {
  Worker worker([](const std::string&, const Result<>&) {});
  EXPECT_FALSE(worker.status());
  std::promise<void> go;
  std::atomic<bool> begun = false;
  worker.add("scan", [&](const Progress& progress) -> Result<> {
    progress("decoding", 3, 18);
    begun = true;
    go.get_future().wait();
    return {};
  });
  EXPECT_FALSE(worker.idle()) << "from the moment it was added";
  ASSERT_TRUE(worker.status());
  EXPECT_EQ(worker.status()->what, "scan");
  wait_for([&] { return begun.load(); });
  std::this_thread::sleep_for(std::chrono::milliseconds(20));
  const auto status = worker.status();
  EXPECT_EQ(status->stage, "decoding");
  EXPECT_EQ(status->done, 3U);
  EXPECT_EQ(status->total, 18U);
  EXPECT_GE(status->seconds, 0.02);
  go.set_value();
  wait_for([&] { return worker.idle(); });
  EXPECT_FALSE(worker.status());
}

TEST(WorkerThread, ACancelledPieceDoesNotCancelTheNext) {
  std::vector<std::string> told;
  Worker worker([&](const std::string& what, const Result<>& outcome) {
    told.push_back(what + (outcome ? " done" : outcome.error().code == ErrorCode::kCancelled ? " cancelled" : " failed"));
  });
  worker.cancel();  // nothing runs
  std::atomic<bool> begun = false;
  worker.add("a", [&](const Progress& progress) {
    begun = true;
    return until_cancelled(progress);
  });
  worker.add("waiting", until_cancelled);
  wait_for([&] { return begun.load(); });
  worker.cancel();
  wait_for([&] { return worker.idle(); });
  worker.add("b", [](const Progress& progress) -> Result<> {
    return progress.cancelled() ? Result<>(base::cancelled("b")) : Result<>();
  });
  wait_for([&] { return worker.idle(); });
  EXPECT_THAT(told, ElementsAre("a cancelled", "b done"));
}

TEST(WorkerThread, WhatIsThrownIsAnErrorAndTheNextPieceRuns) {
  std::vector<std::string> told;
  Worker worker([&](const std::string&, const Result<>& outcome) { told.push_back(outcome ? "" : outcome.error().message); });
  worker.add("a", [](const Progress&) -> Result<> { throw std::bad_alloc(); });
  worker.add("b", [](const Progress&) -> Result<> { throw std::out_of_range("no such thing"); });
  worker.add("c", [](const Progress&) -> Result<> { throw 3; });
  worker.add("d", [](const Progress&) { return Result<>(); });
  wait_for([&] { return worker.idle(); });
  ASSERT_EQ(told.size(), 4U);
  EXPECT_THAT(told[0], testing::HasSubstr("defect"));
  EXPECT_THAT(told[1], testing::HasSubstr("no such thing"));
  EXPECT_THAT(told[2], testing::HasSubstr("defect"));
  EXPECT_EQ(told[3], "");
}

TEST(WorkerThread, ItsEndCancelsWhatRunsAndForgetsWhatWaits) {
  std::atomic<int> ran = 0;
  std::atomic<int> cancelled = 0;
  auto worker = std::make_unique<Worker>([&](const std::string&, const Result<>& outcome) { cancelled += outcome ? 0 : 1; });
  for (int i = 0; i < 3; ++i) {
    worker->add("it", [&](const Progress& progress) {
      ++ran;
      return until_cancelled(progress);
    });
  }
  wait_for([&] { return ran.load() == 1; });
  worker.reset();
  EXPECT_EQ(ran, 1);
  EXPECT_EQ(cancelled, 1);
  for (int i = 0; i < 200; ++i) {  // also where its thread has only just begun
    Worker brief([](const std::string&, const Result<>&) {});
    brief.add("it", until_cancelled);
  }
}

}  // namespace
}  // namespace crosstie::app
