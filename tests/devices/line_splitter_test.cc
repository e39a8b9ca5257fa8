#include "devices/detail/line_splitter.h"

#include <algorithm>
#include <random>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace crosstie::devices::detail {
namespace {

using ::testing::ElementsAre;

struct Split {
  std::vector<std::string> lines;
  int too_long = 0;
  std::size_t most_held = 0;
};

/// Hands `bytes` over in pieces of the given sizes, the last one repeated.
Split split(std::string_view bytes, const std::vector<std::size_t>& pieces, std::size_t max_bytes) {
  LineSplitter splitter(max_bytes);
  Split result;
  for (std::size_t i = 0; !bytes.empty(); ++i) {
    const std::string_view piece = bytes.substr(0, pieces[std::min(i, pieces.size() - 1)]);
    splitter.push(
        piece, [&](std::string_view line) { result.lines.emplace_back(line); }, [&](std::string_view) { ++result.too_long; });
    result.most_held = std::max(result.most_held, splitter.held_bytes());
    bytes.remove_prefix(piece.size());
  }
  return result;
}

TEST(LineSplitter, LinesAreTheSameHoweverTheBytesArrive) {
  const std::string bytes = "850.04\r\n\n850.05\n12345678901\n\r850.06\rrest";
  std::mt19937 random(7);
  for (int trial = 0; trial < 200; ++trial) {
    std::vector<std::size_t> pieces;
    for (int i = 0; i < 40; ++i) pieces.push_back(1 + random() % 9);
    const Split result = split(bytes, pieces, 10);
    EXPECT_THAT(result.lines, ElementsAre("850.04", "850.05", "850.06"));
    EXPECT_EQ(result.too_long, 1);
  }
}

TEST(LineSplitter, ALineOfExactlyTheLimitIsKept) {
  EXPECT_THAT(split("1234567890\n", {3}, 10).lines, ElementsAre("1234567890"));
  EXPECT_THAT(split("12345678901\n5\n", {3}, 10).lines, ElementsAre("5"));
}

TEST(LineSplitter, ALineWithoutEndTakesNoMemory) {
  const Split result = split(fmt::format("{}\n42\n", std::string(1'000'000, '7')), {4096}, 256);
  EXPECT_THAT(result.lines, ElementsAre("42"));
  EXPECT_EQ(result.too_long, 1);
  EXPECT_LE(result.most_held, 257u);
}

TEST(LineSplitter, TheRestOfALineIsSkipped) {
  LineSplitter splitter(256);
  splitter.skip_to_line_end();
  std::vector<std::string> lines;
  for (const std::string_view bytes : {"0.04", "4\n850.05\n"}) {
    splitter.push(
        bytes, [&](std::string_view line) { lines.emplace_back(line); }, [](std::string_view) {});
  }
  EXPECT_THAT(lines, ElementsAre("850.05"));
}

}  // namespace
}  // namespace crosstie::devices::detail
