#include "report/bound_report.h"

#include <set>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "report/detection_report.h"
#include "report/job_report.h"
#include "report/verdict_words.h"
#include "tests/report/markup.h"

namespace crosstie::report {
namespace {

using testing::HasSubstr;
using testing::Not;

ReportContext context_of(const std::string& title) {
  ReportContext context{.title = title,
                        .job = "a \"job\" <1>",
                        .envelope = {},
                        .options_json = R"({"id": " id=\"h-x\""})",
                        .overview = "../index.html"};
  context.envelope.verb = "detect";
  context.envelope.frame = "pixel";
  return context;
}

std::string overview() {
  JobOverview job{.job = "job", .date = "", .results = {}, .not_done = {}};
  base::ResultEnvelope envelope;
  envelope.verb = "detect";
  job.results.push_back({.name = "detect", .page = "detect/report.html", .envelope = envelope});
  return job_report(job);
}

TEST(BoundReport, IsOnePageWhoseLinksLeadInside) {
  base::ImageObservations image;
  image.image = "a.png";
  const std::string one = detection_report({image}, {"overlay/a.jpg"}, context_of("Markers"));
  ASSERT_THAT(one, HasSubstr("../index.html"));
  const std::string page = bound_report({{overview(), "/jobs/a", ""}, {one, "/jobs/a b/detect", "detect/report.html"}});
  ASSERT_FALSE(page.empty());
  EXPECT_EQ(tests::markup_error(page), std::nullopt);
  std::set<std::string> ids;
  for (std::size_t at = page.find(" id=\""); at != std::string::npos; at = page.find(" id=\"", at + 1)) {
    EXPECT_TRUE(ids.insert(page.substr(at + 5, page.find('"', at + 5) - at - 5)).second) << page.substr(at, 40);
  }
  EXPECT_THAT(page, HasSubstr("href=\"#r1\""));
  EXPECT_THAT(page, HasSubstr("id=\"r1\""));
  EXPECT_THAT(page, HasSubstr("src=\"file:///jobs/a%20b/detect/overlay/a.jpg\""));
  EXPECT_THAT(page, Not(HasSubstr("href=\"detect/report.html\"")));
  EXPECT_THAT(page, HasSubstr("{&quot;id&quot;: &quot; id=\\&quot;h-x\\&quot;&quot;}"));  // texts are left alone
}

TEST(BoundReport, RefusesPagesOfOthers) {
  EXPECT_EQ(bound_report({}), "");
  EXPECT_EQ(bound_report({{"<html><body>hello</body></html>", "/", ""}}), "");
  EXPECT_EQ(bound_report({{overview(), "/", ""}, {"</main>\n<body>\n", "/", "x/report.html"}}), "");
}

TEST(VerdictWords, AreThoseOfTheKeyWithWhatItIsOf) {
  EXPECT_EQ(verdict_words("heldout_rms_px left"), "residual of board images left out, rms per point, left");
  EXPECT_EQ(verdict_words("baseline_sigma_mm"), "sigma of the baseline");
  EXPECT_EQ(verdict_words("largest step of a seam"), "largest step of a seam");
  EXPECT_EQ(verdict_words(""), "");
}

}  // namespace
}  // namespace crosstie::report
