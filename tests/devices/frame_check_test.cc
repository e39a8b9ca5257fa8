#include "devices/frame_check.h"

#include <chrono>
#include <limits>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace crosstie::devices {
namespace {

using base::ErrorCode;
using std::chrono::milliseconds;
using ::testing::ElementsAre;
using ::testing::IsEmpty;

struct Shot {
  std::uint64_t id;
  int time_ms;  ///< on the camera's clock
};

/// The findings as "fault@index x count".
std::vector<std::string> found(const std::vector<Shot>& shots, const FrameCheckOptions& options = {}) {
  std::vector<FrameHeader> headers;
  for (const Shot& shot : shots) headers.push_back({shot.id, milliseconds(shot.time_ms), HostTime()});
  const auto findings = check_frames(headers, options);
  if (!findings) return {findings.error().message};
  std::vector<std::string> result;
  for (const FrameFinding& finding : *findings) {
    result.push_back(fmt::format("{}@{} x{}", frame_fault_name(finding.fault), finding.index, finding.count));
  }
  return result;
}

TEST(FrameCheck, CompleteSequences) {
  EXPECT_THAT(found({}), IsEmpty());
  EXPECT_THAT(found({{7, 100}}), IsEmpty());
  EXPECT_THAT(found({{7, 100}, {8, 150}, {9, 200}, {10, 900}}), IsEmpty());
  EXPECT_THAT(found({{7, 100}, {8, 150}, {9, 201}, {10, 249}}, {.period_s = 0.05}), IsEmpty());
  EXPECT_THAT(found({{0, 0}, {1, 0}, {2, 0}}, {.period_s = 0.05}), IsEmpty());  // no clock
}

TEST(FrameCheck, LostFrames) {
  EXPECT_THAT(found({{7, 100}, {10, 250}, {11, 300}}, {.period_s = 0.05}), ElementsAre("lost@1 x2"));
  EXPECT_THAT(found({{1, 50}, {3, 150}, {4, 200}, {6, 300}}), ElementsAre("lost@1 x1", "lost@3 x1"));
}

TEST(FrameCheck, SwappedFrames) {
  // Delivered in the wrong order, as their times say, too.
  EXPECT_THAT(found({{1, 50}, {3, 150}, {2, 100}, {4, 200}}, {.period_s = 0.05}), ElementsAre("swapped@2 x1"));
  // Ids in order, contents exchanged.
  EXPECT_THAT(found({{1, 50}, {2, 150}, {3, 100}, {4, 200}}, {.period_s = 0.05}), ElementsAre("swapped@2 x1"));
  EXPECT_THAT(found({{1, 50}, {2, 50}}), ElementsAre("swapped@1 x1"));  // two exposures at one time
}

TEST(FrameCheck, RepeatedFrames) {
  EXPECT_THAT(found({{1, 50}, {2, 100}, {2, 100}, {3, 150}}), ElementsAre("repeated@2 x1"));
  EXPECT_THAT(found({{1, 50}, {2, 100}, {1, 50}, {3, 150}}), ElementsAre("repeated@2 x1"));
}

TEST(FrameCheck, ExposuresThatTheCameraMissedWithoutCounting) {
  EXPECT_THAT(found({{1, 50}, {2, 100}, {3, 250}, {4, 300}}, {.period_s = 0.05}), ElementsAre("missed@2 x2"));
  EXPECT_THAT(found({{1, 50}, {2, 100}, {3, 250}, {4, 300}}), IsEmpty());  // no period, no claim
  EXPECT_THAT(found({{1, 50}, {2, 100}, {4, 250}}, {.period_s = 0.05}), ElementsAre("lost@2 x1", "missed@2 x1"));
}

TEST(FrameCheck, IdsOf16BitsStartOverAt1) {
  EXPECT_THAT(found({{65534, 10}, {65535, 20}, {1, 30}, {2, 40}}, {.id_bits = 16}), IsEmpty());
  EXPECT_THAT(found({{65534, 10}, {2, 40}}, {.id_bits = 16}), ElementsAre("lost@1 x2"));
  EXPECT_THAT(found({{65535, 10}, {2, 30}, {1, 20}, {3, 40}}, {.id_bits = 16}), ElementsAre("swapped@2 x1"));
}

TEST(FrameCheck, ACountThatBeginsAnew) {
  EXPECT_THAT(found({{65534, 10}, {65535, 20}, {1, 30}, {2, 40}}), ElementsAre("restarted@2 x1"));
  EXPECT_THAT(found({{5000, 10}, {1, 20}, {2, 30}}, {.id_bits = 16}), ElementsAre("restarted@1 x1"));
}

TEST(FrameCheck, ManyFrames) {
  std::vector<Shot> shots;
  for (int i = 0; i < 200'000; ++i) shots.push_back({static_cast<std::uint64_t>(1 + (i + 65'000) % 65'535), 10 * (i + 1)});
  EXPECT_THAT(found(shots, {.id_bits = 16, .period_s = 0.01}), IsEmpty());
  shots.erase(shots.begin() + 150'000);
  EXPECT_THAT(found(shots, {.id_bits = 16, .period_s = 0.01}), ElementsAre("lost@150000 x1"));
}

TEST(FrameCheck, OptionsOutOfTheirDomain) {
  for (const FrameCheckOptions& options :
       {FrameCheckOptions{.id_bits = 0}, FrameCheckOptions{.id_bits = 63}, FrameCheckOptions{.period_s = -1.0},
        FrameCheckOptions{.period_s = std::numeric_limits<double>::infinity()}}) {
    ASSERT_FALSE(check_frames({}, options));
    EXPECT_EQ(check_frames({}, options).error().code, ErrorCode::kUsage);
  }
}

}  // namespace
}  // namespace crosstie::devices
