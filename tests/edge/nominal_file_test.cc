#include "edge/nominal_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/temporary_folder.h"

namespace crosstie::edge {
namespace {

using base::ErrorCode;
using ::testing::HasSubstr;
using tests::TemporaryFolder;

TEST(NominalFile, AListKeepsItsOrderAndItsUnit) {
  const TemporaryFolder folder;
  const auto inches = folder.write("inch.csv", "x_inch,y_inch,z_inch\n0,0,0\n10,0,0\n10,4,0\n0,4,0\n0,0,0\n");
  const auto nominal = read_nominal(inches, {.spline = false});
  ASSERT_TRUE(nominal.has_value()) << nominal.error().message;
  ASSERT_EQ(nominal->points_mm.size(), 4U) << "the last one is the first one again";
  EXPECT_NEAR(nominal->points_mm[2].x(), 254.0, 1e-9);
  EXPECT_NEAR(NominalCurve::make(*nominal)->length_mm(), 28.0 * 25.4, 1e-9);
  EXPECT_TRUE(nominal->normals.empty());

  const auto open = read_nominal(folder.write("open.csv", "0 0 0\n10 0 0\n10 4 0\n"), {.unit = "mm", .closed = false});
  ASSERT_TRUE(open.has_value()) << open.error().message;
  EXPECT_EQ(open->points_mm.size(), 3U);
  EXPECT_FALSE(open->closed);
}

TEST(NominalFile, NormalsComeWithTheTable) {
  const TemporaryFolder folder;
  const auto file = folder.write("n.csv", "x_mm,y_mm,z_mm,nx,ny,nz\n0,0,0,0,0,-1\n10,0,0,0,0,-1\n10,4,0,0,0,-2\n");
  const auto nominal = read_nominal(file);
  ASSERT_TRUE(nominal.has_value()) << nominal.error().message;
  ASSERT_EQ(nominal->normals.size(), 3U);
  EXPECT_NEAR(NominalCurve::make(*nominal)->at(3.0).normal.z(), -1.0, 1e-12);
  const auto half = read_nominal(folder.write("half.csv", "x_mm,y_mm,z_mm,nx,ny\n0,0,0,0,0\n10,0,0,0,0\n10,4,0,0,0\n"));
  ASSERT_FALSE(half.has_value());
  EXPECT_THAT(half.error().message, HasSubstr("not all there"));
}

TEST(NominalFile, WhatIsNoNominalIsNamed) {
  const TemporaryFolder folder;
  const auto no_unit = read_nominal(folder.write("plain.csv", "x,y,z\n0,0,0\n10,0,0\n10,4,0\n"));
  ASSERT_FALSE(no_unit.has_value());
  EXPECT_THAT(no_unit.error().message, HasSubstr("unit"));
  const auto eight = read_nominal(folder.write("eight.csv", "x_mm,y_mm,z_mm\n0,0,0\n10,10,0\n10,0,0\n0,10,0\n"));
  ASSERT_FALSE(eight.has_value());
  EXPECT_EQ(eight.error().code, ErrorCode::kBadInput);
  EXPECT_THAT(eight.error().message, HasSubstr("eight.csv: the nominal curve crosses itself"));
  const auto absent = read_nominal(folder / "absent.csv");
  ASSERT_FALSE(absent.has_value());
  EXPECT_EQ(absent.error().code, ErrorCode::kFileSystem);
}

}  // namespace
}  // namespace crosstie::edge
