#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "report/verification_report.h"
#include "tests/report/markup.h"
#include "tests/report/synthetic_network.h"

namespace crosstie::report {
namespace {

using base::Verification;
using ::testing::HasSubstr;
using ::testing::Not;
using tests::markup_error;
using tests::synthetic_context;
using tests::without_code;

/// 30 points with deviations drawn at random, one of them left out, and lengths between neighbours.
Verification some_verification() {
  std::mt19937_64 random(9);
  std::normal_distribution<double> normal;
  Verification verification;
  verification.reference_from_measured = {Eigen::Quaterniond(Eigen::AngleAxisd(0.5, Eigen::Vector3d::UnitZ())),
                                          {10.0, -20.0, 30.0}};
  verification.pose_cov = 1e-8 * base::Matrix6d::Identity();
  verification.scale_ppm = 12.3;
  verification.scale_sigma_ppm = 4.5;
  for (int id = 1; id <= 30; ++id) {
    base::Deviation one;
    one.id = id;
    one.reference_mm = 300.0 * Eigen::Vector3d(normal(random), normal(random), 0.1 * normal(random));
    one.deviation_mm = 0.005 * Eigen::Vector3d(normal(random), normal(random), normal(random));
    one.measured_mm = one.reference_mm + one.deviation_mm;
    one.untransformed_mm = Eigen::Vector3d(100.0, 3.0, -2.0);
    one.sigma_mm.setConstant(0.004);
    one.used = id != 17;
    verification.points.push_back(one);
    verification.lengths.push_back({id, id + 1, 50.0 * id, 50.0 * id + (id == 4 ? 0.2 : 0.01), 0.004, 0.05 + 0.0025 * id});
  }
  verification.only_measured = {401, 402};
  verification.rms_mm.setConstant(0.005);
  verification.rms3d_mm = 0.00866;
  verification.max_mm = 0.02;
  verification.normalised_rms = 1.21;
  verification.length_rms_mm = 0.04;
  verification.length_max_mm = 0.2;
  return verification;
}

TEST(VerificationReport, IsSoundAndSaysWhatMatters) {
  const std::string page = verification_report(some_verification(), synthetic_context("verify"));
  EXPECT_EQ(markup_error(page), std::nullopt);
  for (const char* text :
       {"6 degrees of freedom", "12.3\u00a0\u00b1\u00a04.5\u00a0ppm", "401, 402", "1 of 30 lengths beyond",
        "left out of fit and statistics: 17", "Untransformed", "Quaternion", "28.647890", "VDI/VDE 2634", "1.21"}) {
    EXPECT_TRUE(tests::contains(page, text)) << text;
  }
  EXPECT_EQ(page, verification_report(some_verification(), synthetic_context("verify")));
}

TEST(VerificationReport, OtherFitsNameTheirDegreesOfFreedom) {
  Verification verification = some_verification();
  verification.fit = "similarity";
  EXPECT_TRUE(tests::contains(verification_report(verification, {}), "7 degrees of freedom")) << "7 degrees of freedom";
  verification.fit = "none";
  EXPECT_TRUE(tests::contains(verification_report(verification, {}), "0 degrees of freedom")) << "0 degrees of freedom";
}

TEST(VerificationReport, DegenerateResults) {
  EXPECT_EQ(markup_error(verification_report({}, {})), std::nullopt);
  Verification single;
  single.points.push_back({5});
  single.lengths.push_back({1, 2});
  single.warnings.push_back({"<a>", "&", "\"'"});
  const std::string page = verification_report(single, {});
  EXPECT_EQ(markup_error(page), std::nullopt);
  EXPECT_TRUE(tests::contains(page, "&lt;a&gt;")) << "&lt;a&gt;";
  Verification wild = some_verification();
  wild.points[3].deviation_mm.setConstant(std::numeric_limits<double>::quiet_NaN());
  wild.points[4].reference_mm.setConstant(std::numeric_limits<double>::infinity());
  wild.pose_cov.setConstant(std::numeric_limits<double>::quiet_NaN());
  wild.lengths[2].measured_mm = std::numeric_limits<double>::quiet_NaN();
  wild.lengths[3].nominal_mm = std::numeric_limits<double>::infinity();
  const std::string text = without_code(verification_report(wild, {}));
  EXPECT_EQ(markup_error(text), std::nullopt);
  for (const char* name : {"cx", "cy", "x1", "x2", "y1", "y2", "points", "d", "width", "height"}) {
    for (const std::string& value : tests::attribute_values(text, name)) {
      EXPECT_THAT(value, Not(HasSubstr("n"))) << name << "=" << value;  // nan, inf, n/a
    }
  }
}

}  // namespace
}  // namespace crosstie::report
