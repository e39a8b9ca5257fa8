#include "base/image_coverage.h"

#include <limits>

#include <gtest/gtest.h>

namespace crosstie::base {
namespace {

TEST(ImageCells, CellsAreNearlySquareAndHoldTheirPixels) {
  const ImageCells cells(2400, 1600);
  EXPECT_EQ(cells.columns(), 12);
  EXPECT_EQ(cells.rows(), 8);
  EXPECT_EQ(cells.cell_of({-0.5, -0.5}), 0U) << "the image begins half a pixel before the centre of the first";
  EXPECT_EQ(cells.cell_of({199.4, 0.0}), 0U);
  EXPECT_EQ(cells.cell_of({199.6, 0.0}), 1U);
  EXPECT_EQ(cells.cell_of({0.0, 199.6}), 12U);
  EXPECT_EQ(cells.cell_of({2399.0, 1599.0}), 95U);
  EXPECT_EQ(cells.cell_of({1e9, -1e9}), 11U) << "outside counts to the border";
  EXPECT_EQ(ImageCells(100, 10).rows(), 1);
}

TEST(ImageCells, CoveredShare) {
  const ImageCells cells(2400, 1600);
  EXPECT_EQ(covered_share(cells, {}), 0.0);
  EXPECT_DOUBLE_EQ(covered_share(cells, {{10.0, 10.0}, {20.0, 20.0}, {300.0, 10.0}}), 2.0 / 96.0);
  EXPECT_EQ(covered_share(cells, {{std::numeric_limits<double>::quiet_NaN(), 10.0}}), 0.0);
}

}  // namespace
}  // namespace crosstie::base
