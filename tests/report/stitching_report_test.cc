#include "report/stitching_report.h"

#include <cstdlib>
#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/table.h"
#include "report/stitching_tables.h"
#include "tests/report/markup.h"
#include "tests/support/synthetic_stitching.h"
#include "tests/support/temporary_folder.h"

namespace crosstie::report {
namespace {

using testing::HasSubstr;

ReportContext some_context() {
  ReportContext context{"One cloud", "door frame <1>", {}, "{}"};
  context.envelope.verb = "stitch";
  context.envelope.frame = "machine";
  context.envelope.verdicts = {{"largest step of a seam", 0.02, 0.1, "mm", "default", base::VerdictLevel::kOk}};
  return context;
}

TEST(StitchingReport, IsWellFormedAndShowsEverySection) {
  const std::string page = stitching_report(tests::synthetic_stitching(), tests::synthetic_merged_cloud(), some_context());
  EXPECT_EQ(tests::markup_error(page), std::nullopt);
  for (const char* text :
       {"Where the stations are", "Which source tells which direction", "How the surfaces agree", "Drift along the row",
        "Markers", "Matching of the surfaces (ICP)", "iterative closest point", "a cylinder of radius 2150.0 mm", "x0400",
        "tangential", "not joined", "the marker was moved in between", "U\u00a0=\u00a0"}) {
    EXPECT_THAT(page, HasSubstr(text));
  }
  EXPECT_THAT(page, testing::Not(HasSubstr("&lt;svg"))) << "a picture is shown, not its text";
  if (const char* file = std::getenv("CROSSTIE_REPORT_OUT")) std::ofstream(file) << page;
}

TEST(StitchingReport, StandsWithoutOverlapsOrMarkers) {
  base::Stitching stitching = tests::synthetic_stitching();
  stitching.overlaps.clear();
  stitching.markers.clear();
  stitching.rejected.clear();
  const std::string page = stitching_report(stitching, {}, some_context());
  EXPECT_EQ(tests::markup_error(page), std::nullopt);
  EXPECT_THAT(page, HasSubstr("No two surfaces overlap"));
}

TEST(StitchingReport, WritesItsTables) {
  const tests::TemporaryFolder folder;
  ASSERT_TRUE(write_stitching_tables(folder.path(), tests::synthetic_stitching()));
  const auto directions = base::read_table(folder / "directions.csv");
  ASSERT_TRUE(directions) << directions.error().message;
  EXPECT_EQ(directions->rows.size(), 18U);
  const auto overlap = base::read_table(folder / "overlap.csv");
  ASSERT_TRUE(overlap) << overlap.error().message;
  EXPECT_EQ(overlap->rows.size(), 48U);
}

}  // namespace
}  // namespace crosstie::report
