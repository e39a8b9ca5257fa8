#include "math/distributions.h"

#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

namespace crosstie::math {
namespace {

// Printed tables (Abramowitz & Stegun, Handbook of Mathematical Functions, tables 26.1, 26.8 - 26.10) and closed forms.
TEST(Distributions, QuantilesMatchTables) {
  EXPECT_NEAR(normal_quantile(0.975), 1.959963984540, 1e-10);
  EXPECT_NEAR(normal_quantile(0.0005), -3.290526731492, 1e-9);
  EXPECT_NEAR(chi_square_quantile(0.95, 10), 18.3070380533, 1e-8);
  EXPECT_NEAR(chi_square_quantile(0.005, 30), 13.7867198502, 1e-8);
  EXPECT_NEAR(student_quantile(0.975, 5), 2.57058183564, 1e-8);
  EXPECT_NEAR(f_quantile(0.95, 3, 10), 3.70826481905, 1e-8);
}

TEST(Distributions, TwoDegreesOfFreedomAreExponential) {
  for (const double p : {0.001, 0.5, 0.999}) EXPECT_NEAR(chi_square_quantile(p, 2), -2.0 * std::log1p(-p), 1e-11);
}

TEST(Distributions, ManyDegreesOfFreedomApproachWilsonHilferty) {
  const double dof = 18804;
  for (const double p : {0.001, 0.5, 0.999}) {
    const double third = 1.0 - 2.0 / (9.0 * dof) + normal_quantile(p) * std::sqrt(2.0 / (9.0 * dof));
    EXPECT_NEAR(chi_square_quantile(p, dof) / (dof * third * third * third), 1.0, 1e-6);
  }
}

TEST(Distributions, TauOfOneResidualIsPopes) {
  const double r = 20;
  const double t = student_quantile(0.9995, r - 1);
  EXPECT_NEAR(tau_quantile(0.999, 1, r), std::sqrt(r) * t / std::sqrt(r - 1 + t * t), 1e-9);
  // Many observations make sigma0 known: what is left is the chi-square of the residuals.
  EXPECT_NEAR(tau_quantile(0.999, 2, 1e6), std::sqrt(chi_square_quantile(0.999, 2) / 2.0), 1e-4);
  EXPECT_TRUE(std::isnan(tau_quantile(0.999, 2, 2)));
}

TEST(Distributions, OutsideTheirDomainTheyAreNotANumber) {
  EXPECT_TRUE(std::isnan(normal_quantile(0.0)));
  EXPECT_TRUE(std::isnan(chi_square_quantile(1.0, 3)));
  EXPECT_TRUE(std::isnan(student_quantile(0.5, -1)));
}

TEST(Distributions, StudentTwoSidedKeepsTheDigitsOfSmallProbabilities) {
  EXPECT_NEAR(student_two_sided(-2.57058183564, 5), 0.05, 1e-10);
  EXPECT_EQ(student_two_sided(0.0, 7), 1.0);
  EXPECT_NEAR(student_two_sided(1.0, 1), 0.5, 1e-14);  // Cauchy
  EXPECT_NEAR(student_two_sided(1e9, 1) * 0.5e9 * std::numbers::pi, 1.0, 1e-8);
  EXPECT_NEAR(student_two_sided(1.959963984540054, 1e7), 0.05, 1e-7);
  EXPECT_TRUE(std::isnan(student_two_sided(1.0, 0)));
}

}  // namespace
}  // namespace crosstie::math
