#include "report/job_report.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/report/markup.h"

namespace crosstie::report {
namespace {

using testing::HasSubstr;
using testing::Not;

JobOverview some_job() {
  JobOverview job{.job = "door <1>", .date = "2026-03-30", .results = {}, .not_done = {}};
  base::ResultEnvelope scan{.verb = "scan", .frame = "rig", .inputs = {}, .verdicts = {}, .warnings = {}};
  scan.verdicts = {{"off the epipolar curves", 0.03, 0.25, "px", "default", base::VerdictLevel::kOk}};
  base::ResultEnvelope edge{.verb = "edge", .frame = "machine", .inputs = {}, .verdicts = {}, .warnings = {}};
  edge.verdicts = {{"largest gap of the rim", 61.0, 50.0, "mm", "job", base::VerdictLevel::kFail}};
  edge.warnings = {{"gap", "", "a shadow lies there"}};
  job.results = {{"scan x0500", "scan/x0500/report.html", scan}, {"edge", "", edge}};
  return job;
}

TEST(JobReport, NamesEveryStepWithItsWorstVerdictAndItsReport) {
  const std::string page = job_report(some_job());
  EXPECT_EQ(tests::markup_error(page), std::nullopt);
  for (const char* text :
       {"door &lt;1&gt;", "2026-03-30", "href=\"scan/x0500/report.html\"", "scan x0500: off the epipolar curves",
        "edge: largest gap of the rim", "a shadow lies there", "all that the job asks for"})
    EXPECT_THAT(page, HasSubstr(text));
  // One check beyond its limit and the whole job is: the banner says so.
  EXPECT_THAT(page, HasSubstr("<strong>FAIL</strong>"));
  EXPECT_LT(page.find("id=\"steps\""), page.find("id=\"verdicts\"")) << "the links come first";
}

TEST(JobReport, SaysWhatIsNotDone) {
  JobOverview job = some_job();
  job.results.pop_back();
  job.not_done = {"edge", "verify"};
  const std::string page = job_report(job);
  EXPECT_EQ(tests::markup_error(page), std::nullopt);
  EXPECT_THAT(page, HasSubstr("2 missing"));
  EXPECT_THAT(page, HasSubstr("not done yet"));
  EXPECT_THAT(page, Not(HasSubstr("all that the job asks for")));
  EXPECT_THAT(page, HasSubstr("<strong>OK</strong>"));
}

}  // namespace
}  // namespace crosstie::report
