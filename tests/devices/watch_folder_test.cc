#include "devices/watch_folder.h"

#include <chrono>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <string>
#include <utility>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "devices/newest_queue.h"
#include "tests/devices/eventually.h"
#include "tests/devices/grey_png.h"
#include "tests/support/temporary_folder.h"

namespace crosstie::devices {
namespace {

using base::ErrorCode;
using ::testing::HasSubstr;
using tests::eventually;
using tests::grey_png;

constexpr double kLong_s = 30.0;

int grey_of(const Frame& frame) { return frame.image.view().row<std::uint8_t>(0)[0]; }

class WatchFolderTest : public ::testing::Test {
 protected:
  /// Files that are there already count, so that no test depends on when the first look is.
  [[nodiscard]] WatchFolderOptions options(const std::string& pattern) const {
    return {.files = {.pattern = folder_ / pattern, .rest_s = 0.01, .take_existing = true}, .period_s = 0.002};
  }
  /// Appears whole, as if another program renamed it.
  void put(const std::string& name, const std::string& bytes) const {
    std::filesystem::rename(folder_.write("being_written", bytes), folder_ / name);
  }

  tests::TemporaryFolder folder_;
};

TEST_F(WatchFolderTest, FilesComeAsFramesOfACamera) {
  NewestQueue<Frame> queue(8);
  const auto camera = *watch_folder_camera(options("*.png"));
  ASSERT_TRUE(camera->start({}, [&](base::Result<Frame> frame) { queue.push(std::move(frame)); }));
  for (const int level : {10, 20}) {
    put(fmt::format("{}.png", level), grey_png(level));
    const auto frame = queue.pop(kLong_s);
    ASSERT_TRUE(frame && *frame);
    EXPECT_EQ(grey_of(**frame), level);
    EXPECT_EQ((*frame)->header.id, static_cast<std::uint64_t>(level / 10));
    EXPECT_EQ((*frame)->name, (folder_ / fmt::format("{}.png", level)).string());
    const auto age = std::chrono::system_clock::now().time_since_epoch() - (*frame)->header.device_time;
    EXPECT_LT(std::abs(std::chrono::duration<double>(age).count()), 60.0);
  }
  EXPECT_TRUE(camera->state().running);
  EXPECT_EQ(camera->trigger().error().code, ErrorCode::kUsage);
  camera->stop();
  EXPECT_FALSE(camera->state().running);
}

TEST_F(WatchFolderTest, ADamagedImageIsToldOf) {
  NewestQueue<Frame> queue(8);
  const auto camera = *watch_folder_camera(options("*.png"));
  ASSERT_TRUE(camera->start({}, [&](base::Result<Frame> frame) { queue.push(std::move(frame)); }));
  put("damaged.png", grey_png(1).substr(0, 60));
  ASSERT_TRUE(eventually([&] { return camera->state().incomplete == 1; }));
  EXPECT_THAT(camera->state().trouble, HasSubstr("damaged.png"));
  put("good.png", grey_png(2));
  ASSERT_TRUE((*queue.pop(kLong_s)).has_value());
  EXPECT_EQ(camera->state().trouble, "");
}

TEST_F(WatchFolderTest, PairsByName) {
  NewestQueue<FramePair> queue(8);
  const auto pairs = *watch_folder_pair(options("L_*.png"), options("R_*.png"));
  ASSERT_TRUE(pairs->start({}, [&](base::Result<FramePair> pair) { queue.push(std::move(pair)); }));
  put("L_001.png", grey_png(1));
  put("R_002.png", grey_png(102));
  put("R_001.png", grey_png(101));
  auto pair = queue.pop(kLong_s);
  ASSERT_TRUE(pair && *pair);
  EXPECT_EQ(grey_of((*pair)->left), 1);
  EXPECT_EQ(grey_of((*pair)->right), 101);
  put("L_002.png", grey_png(2));
  pair = queue.pop(kLong_s);
  ASSERT_TRUE(pair && *pair);
  EXPECT_EQ(grey_of((*pair)->left), 2);
  EXPECT_EQ(grey_of((*pair)->right), 102);
  EXPECT_EQ(pairs->counts().pairs, 2u);
}

TEST_F(WatchFolderTest, FilesWithoutPartnersAreBoundedAndCounted) {
  for (int i = 0; i < 20; ++i) put(fmt::format("L_{:02}.png", i), grey_png(i));
  const auto pairs = *watch_folder_pair(options("L_*.png"), options("R_*.png"));
  ASSERT_TRUE(pairs->start({}, [](const base::Result<FramePair>&) {}));
  EXPECT_TRUE(eventually([&] { return pairs->states()[0].frames == 20 && pairs->counts().unmatched[0] == 4; }));
  EXPECT_EQ(pairs->counts().pairs, 0u);
}

TEST_F(WatchFolderTest, OptionsOutOfTheirDomain) {
  WatchFolderOptions never = options("*.png");
  never.period_s = 0.0;
  EXPECT_EQ(watch_folder_camera(never).error().code, ErrorCode::kUsage);
  EXPECT_EQ(watch_folder_camera(options("*_*.png")).error().code, ErrorCode::kUsage);
  // Which right file belongs to a left one, names alone must say.
  EXPECT_EQ(watch_folder_pair(options("left.png"), options("right.png")).error().code, ErrorCode::kUsage);
  const auto camera = *watch_folder_camera(options("*.png"));
  EXPECT_EQ(camera->start({.trigger = TriggerMode::kSoftware}, [](const base::Result<Frame>&) {}).error().code,
            ErrorCode::kUsage);
}

}  // namespace
}  // namespace crosstie::devices
