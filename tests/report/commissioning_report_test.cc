#include "report/commissioning_report.h"

#include <cmath>
#include <cstdlib>
#include <fstream>
#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/table.h"
#include "report/commissioning_tables.h"
#include "report/head_check_report.h"
#include "tests/report/markup.h"
#include "tests/support/synthetic_commissioning.h"
#include "tests/support/temporary_folder.h"

namespace crosstie::report {
namespace {

using testing::HasSubstr;
using testing::Not;
using tests::markup_error;

ReportContext some_context() {
  ReportContext context{"The head in the machine's frame", "door frame <1>", {}, "{}"};
  context.envelope.verb = "commission";
  context.envelope.frame = "machine";
  context.envelope.verdicts = {{"sphere_w", 1.4, 3.29, "", "limits.sphere_w", base::VerdictLevel::kOk}};
  return context;
}

struct Shown {
  base::Commissioning result = tests::synthetic_commissioning();
  base::Head calibrated = result.head;
  base::Cross cross;

  [[nodiscard]] std::string page() {
    calibrated.cov *= 2.0;
    calibrated.right_from_left = base::perturbed(calibrated.right_from_left, base::Vector6d::Constant(1e-5));
    cross.temperature_c = 24.0;
    cross.temperature_sigma_c = 0.5;
    cross.cte_per_k = 11.5e-6;
    cross.certificate = {"T-113", base::parse_date("2026-01-10").value(), base::parse_date("2027-01-10").value()};
    CommissioningView view{result, calibrated, cross, {}, {}};
    for (int i = 0; i <= 20; ++i) {
      view.along.push_back(result.frame.straight_at(result.frame.axis.from_mm + 50.0 * i));
    }
    view.volume.push_back({"Over the field", "x [mm]", "y [mm]", 0.0, 800.0, -300.0, 300.0,
                           Eigen::MatrixXd::NullaryExpr(8, 8, [](Eigen::Index i, Eigen::Index k) {
                             return 0.03 + 0.002 * static_cast<double>(i + k);
                           })});
    return commissioning_report(view, some_context());
  }
};

TEST(CommissioningReport, IsWellFormedAndShowsEverySection) {
  Shown shown;
  const std::string page = shown.page();
  EXPECT_EQ(markup_error(page), std::nullopt);
  for (const char* section : {"head", "volume", "axis", "spheres", "rig", "cross", "images", "adjustment", "rejected"}) {
    EXPECT_THAT(page, HasSubstr(std::string("<section id=\"") + section + "\"")) << section;
  }
  EXPECT_THAT(page, HasSubstr("door frame &lt;1&gt;"));
  EXPECT_THAT(page, HasSubstr("EYX"));
  EXPECT_THAT(page, HasSubstr("valid until 2027-01-10"));
  EXPECT_THAT(page, HasSubstr("x0002/left"));
  if (const char* file = std::getenv("CROSSTIE_REPORT_OUT")) std::ofstream(file) << page;
}

TEST(CommissioningReport, GivesTheSameBytesEachTime) {
  Shown one;
  Shown other;
  EXPECT_TRUE(one.page() == other.page());
}

TEST(CommissioningReport, SurvivesWhatIsMissingOrNotFinite) {
  Shown shown;
  shown.result.spheres.clear();
  shown.result.tre.clear();
  shown.result.residuals.clear();
  shown.result.images.clear();
  shown.result.stations.clear();
  shown.result.frame.axis.terms.clear();
  shown.result.rejected.clear();
  shown.result.markers.clear();
  shown.result.frame.cov.setConstant(std::numeric_limits<double>::quiet_NaN());
  shown.result.fre_mm = std::numeric_limits<double>::infinity();
  const std::string page = shown.page();
  EXPECT_EQ(markup_error(page), std::nullopt);
  EXPECT_THAT(page, HasSubstr("Nothing was left out."));
}

TEST(CommissioningReport, ShowsWhereNothingIsKnownOfTheRig) {
  Shown shown;
  shown.result.head.cov.resize(0, 0);
  EXPECT_THAT(shown.page(), HasSubstr("without covariance"));
}

TEST(CommissioningTables, ReadBackWithUnitsInTheirNames) {
  const tests::TemporaryFolder folder;
  const base::Commissioning result = tests::synthetic_commissioning();
  ASSERT_TRUE(write_commissioning_tables(folder.path(), result));
  const auto stations = base::read_table(folder / "stations.csv");
  ASSERT_TRUE(stations);
  ASSERT_EQ(stations->rows.size(), 5U);
  EXPECT_EQ(stations->number(2, *stations->column("x_mm")).value(), result.stations[2].machine_from_rig.translation_mm.x());
  const auto terms = base::read_table(folder / "terms.csv");
  ASSERT_TRUE(terms);
  EXPECT_EQ(terms->rows.size(), result.frame.axis.terms.size());
  for (const char* name : {"spheres.csv", "residuals.csv", "markers.csv", "rejected.csv"}) {
    EXPECT_TRUE(base::read_table(folder / name)) << name;
  }
}

TEST(HeadCheckReport, SaysWhatMovedAndWhatCouldNotBeSeen) {
  base::HeadCheck check;
  check.verdict = base::HeadCheck::Verdict::kRig;
  check.message = "relative pitch changed";
  check.tests = {{"relative pitch", "mrad", 0.06, 0.008, 56.0, 1, 7e-14, true},
                 {"machine_from_rig", "", 0.0, 0.0, 4.0, 6, 0.7, false}};
  check.rig_change << 6e-5, 0.0, 1e-5, 0.0, 0.0, 0.0;
  check.rig_change_sigma << 8e-6, 0.0, 8e-6, 0.0, 0.0, 0.0;
  check.rig_seen = {true, false, true, false, false, false};
  const std::string page = head_check_report(check, "RIG MOVED", some_context());
  EXPECT_EQ(markup_error(page), std::nullopt);
  EXPECT_THAT(page, HasSubstr("accused"));
  EXPECT_THAT(page, HasSubstr("not seen"));
  EXPECT_THAT(page, HasSubstr("RIG MOVED"));
}

}  // namespace
}  // namespace crosstie::report
