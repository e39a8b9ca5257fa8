#include "live/frame_counter.h"

#include <chrono>
#include <cstdint>
#include <set>

#include <gtest/gtest.h>

namespace crosstie::live {
namespace {

devices::FrameHeader header(std::uint64_t id) {
  return {id, std::chrono::milliseconds(50 * id), devices::HostTime(std::chrono::milliseconds(50 * id))};
}

TEST(FrameCounter, CountsEveryLostFrameOnceOverThousands) {
  FrameCounter counter;
  // Also at the places where headers are let go.
  const std::set<std::uint64_t> lost = {5, 6, 127, 128, 129, 255, 256, 257, 1000, 2999};
  for (std::uint64_t id = 1; id <= 3000; ++id) {
    if (!lost.contains(id)) counter.add(header(id));
  }
  EXPECT_EQ(counter.faults().lost, lost.size());
  EXPECT_EQ(counter.faults().swapped, 0u);
  EXPECT_EQ(counter.faults().repeated, 0u);
}

TEST(FrameCounter, SwappedFramesAreNotLost) {
  FrameCounter counter;
  for (std::uint64_t id = 1; id <= 400; ++id) counter.add(header(id == 50 ? 51 : id == 51 ? 50 : id));
  EXPECT_EQ(counter.faults().lost, 0u);
  EXPECT_EQ(counter.faults().swapped, 1u);
}

TEST(FrameCounter, SixteenBitsStartOver) {
  FrameCounter counter;
  counter.set_options({.id_bits = 16});
  for (std::uint64_t i = 65'300; i <= 65'800; ++i) {
    devices::FrameHeader one = header(i);
    one.id = 1 + (i - 1) % 65'535;
    if (i != 65'536) counter.add(one);
  }
  EXPECT_EQ(counter.faults().lost, 1u);
  EXPECT_EQ(counter.faults().restarted, 0u);
}

}  // namespace
}  // namespace crosstie::live
