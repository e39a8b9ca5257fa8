#include "report/detail/number.h"

#include <clocale>
#include <cmath>
#include <limits>
#include <vector>

#include <gtest/gtest.h>

namespace crosstie::report::detail {
namespace {

TEST(Number, FixedHasNoNegativeZeroAndNoNan) {
  EXPECT_EQ(fixed(1.005, 1), "1.0");
  EXPECT_EQ(fixed(-0.0004, 3), "0.000");
  EXPECT_EQ(fixed(-0.0006, 3), "-0.001");
  EXPECT_EQ(fixed(std::nan(""), 3), "n/a");
  EXPECT_EQ(fixed(-std::numeric_limits<double>::infinity(), 3), "n/a");
}

TEST(Number, SignificantDigits) {
  EXPECT_EQ(significant(0.0), "0");
  EXPECT_EQ(significant(1234.567), "1235");
  EXPECT_EQ(significant(9.996), "10.0");
  EXPECT_EQ(significant(0.0123456), "0.0123");
  EXPECT_EQ(significant(-0.000012345), "-1.23e-05");
  EXPECT_EQ(significant(2.5e9), "2.50e+09");
  EXPECT_EQ(plain(0.3), "0.3");
  EXPECT_EQ(plain(1200.0), "1200");
}

TEST(Number, TheSigmaPicksTheDigits) {
  EXPECT_EQ(with_sigma(1000.00421, 0.00183, "mm"), "1000.0042\u00a0\u00b1\u00a00.0018\u00a0mm");
  EXPECT_EQ(with_sigma(1234.5, 12.0, ""), "1234\u00a0\u00b1\u00a012");
  EXPECT_EQ(expanded(0.00183, "mm"), "U\u00a0=\u00a00.0037\u00a0mm");
  EXPECT_EQ(expanded(0.0, "mm"), "");
  EXPECT_EQ(decimals_for_sigma(0.0183), 3);
  EXPECT_EQ(decimals_for_sigma(0.00996), 3);  // 0.010
  EXPECT_EQ(decimals_for_sigma(0.0994), 3);   // 0.099
  EXPECT_EQ(decimals_for_sigma(250.0), 0);
  EXPECT_EQ(decimals_for_sigma(0.0, 5), 5);
  EXPECT_EQ(decimals_for_sigma(1e-300), 9);
}

TEST(Number, AColumnShowsItsSmallSigmasToo) {
  const std::vector<double> sigmas = {0.012, 0.0019, 0.0, 0.015, std::nan("")};
  EXPECT_EQ(decimals_for_column(sigmas), 4);
  EXPECT_EQ(decimals_for_column(std::vector<double>{}, 6), 6);
  // One absurdly small sigma does not blow up the column.
  EXPECT_EQ(decimals_for_column(std::vector<double>{1e-12, 0.01, 0.02}), 4);
}

TEST(Number, Counts) {
  EXPECT_EQ(counted(0), "0");
  EXPECT_EQ(counted(999), "999");
  EXPECT_EQ(counted(19945), "19\u202f945");
  EXPECT_EQ(counted(-1234567), "-1\u202f234\u202f567");
}

TEST(Number, TheUnitFollowsTheTypicalLength) {
  EXPECT_EQ(std::string(unit_for_lengths(std::vector<double>{0.002, 0.003, 5.0}).name), "\u00b5m");
  EXPECT_EQ(std::string(unit_for_lengths(std::vector<double>{0.2, 0.3}).name), "mm");
  EXPECT_EQ(std::string(unit_for_lengths(std::vector<double>{0.0}).name), "mm");
}

TEST(Number, AnyLocaleGivesAPoint) {
  const char* german = std::setlocale(LC_ALL, "de_DE.UTF-8");
  EXPECT_EQ(fixed(1.5, 1), "1.5");
  EXPECT_EQ(significant(0.0123), "0.0123");
  std::setlocale(LC_ALL, "C");
  if (german == nullptr) GTEST_SKIP() << "no de_DE locale here: tried under C only";
}

}  // namespace
}  // namespace crosstie::report::detail
