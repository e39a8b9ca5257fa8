#include "bundle/detail/rank.h"

#include <array>

#include <gtest/gtest.h>

#include "bundle/adjust.h"
#include "tests/bundle/synthetic_network.h"

namespace crosstie::bundle {
namespace {

/// Groups of so many rows on so many unknowns of each of their blocks.
struct Pattern {
  math::Parameters parameters;
  math::WhitenedRows rows;

  void block(int size) {
    parameters.add("b", std::vector<std::string>(static_cast<std::size_t>(size), "x"), math::BlockRole::kKept);
  }
  void group(int count, const std::vector<int>& blocks) {
    std::vector<int> sizes;
    for (const int b : blocks) sizes.push_back(parameters.block(b).size());
    rows.add(count, blocks, sizes);
  }
  [[nodiscard]] int rank() const { return detail::structural_rank(rows, parameters); }
};

TEST(StructuralRank, CountsWhatHasTooFewRows) {
  Pattern pattern;
  pattern.block(3);
  pattern.block(2);
  pattern.group(2, {0});
  pattern.group(4, {1});
  EXPECT_EQ(pattern.rank(), 4) << "the first block has two rows for three unknowns, whatever the second has to spare";
}

TEST(StructuralRank, MovesRowsToThoseWhoNeedThem) {
  // Served in order, block 0 takes the rows of the group that it shares with block 1, which has no other.
  Pattern pattern;
  for (int i = 0; i < 3; ++i) pattern.block(2);
  pattern.group(2, {0, 1});
  pattern.group(2, {0, 2});
  pattern.group(2, {2});
  EXPECT_EQ(pattern.rank(), 6);
}

TEST(StructuralRank, RowsAreNotUsedTwice) {
  Pattern pattern;
  for (int i = 0; i < 3; ++i) pattern.block(2);
  pattern.group(3, {0, 1, 2});
  pattern.group(1, {0, 1, 2});
  EXPECT_EQ(pattern.rank(), 4);
}

TEST(StructuralRank, OfANetworkAddsUp) {
  const auto synthetic = tests::make_synthetic({.cameras = 2, .rig = true, .images = 12});
  const auto result = adjust(synthetic.network);
  ASSERT_TRUE(result) << result.error().message;
  EXPECT_EQ(result->structural_rank, result->unknowns);
  EXPECT_EQ(result->conditions, 6);
  EXPECT_EQ(result->rank, result->unknowns - 6);
  EXPECT_EQ(result->estimated.interior, 2 * 9);
  EXPECT_EQ(result->estimated.exterior, 6 * 6);
  EXPECT_EQ(result->estimated.rig, 6);
  EXPECT_EQ(result->estimated.object, 3 * static_cast<int>(result->points.size()));
  EXPECT_EQ(result->estimated.total(), result->unknowns);
  EXPECT_EQ(result->observed.image_coordinates, 2 * static_cast<int>(result->residuals.size()));
  EXPECT_EQ(result->observed.scale_bars, 2);
  EXPECT_EQ(result->observed.total(), result->observations);
  EXPECT_LT(result->last_step, 1e-6);
}

}  // namespace
}  // namespace crosstie::bundle
