// What the session reads of a job's results: what is done, how well, and what is damaged.
#include <filesystem>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "app/live/job_facts.h"
#include "tests/app/live_job.h"
#include "tests/support/temporary_folder.h"

namespace crosstie::app {
namespace {

namespace fs = std::filesystem;
using testing::IsEmpty;

const std::string kJob = tests::live_job(R"([[station]]
name = "a"
axis_mm = 0.0
cross = { left = "cross/a_l.png", right = "cross/a_r.png" }
scan = { left = "scan/a/left", right = "scan/a/right", manifest = "scan/patterns.json" }

[[station]]
name = "b"
axis_mm = 500.0
scan = { left = "scan/b/left", right = "scan/b/right", manifest = "scan/patterns.json" }
)");

class JobFactsTest : public ::testing::Test {
 protected:
  void SetUp() override {
    const auto job = read_job(folder_.write("job.toml", kJob));
    ASSERT_TRUE(job) << job.error().message;
    job_ = *job;
  }
  /// `levels`: one verdict for each, "O", "W" or "F".
  void result(const fs::path& folder, const std::string& verb, const std::string& levels, const std::string& more = "",
              bool report = true) const {
    std::string verdicts;
    for (const char level : levels) {
      verdicts += std::string(verdicts.empty() ? "" : ",") + R"({"name":"n)" + level +
                  R"(","value":1,"limit":2,"unit":"mm","source":"s","level":")" +
                  (level == 'O'   ? "OK"
                   : level == 'W' ? "WARNING"
                                  : "FAIL") +
                  "\"}";
    }
    folder_.write(fs::path("results") / folder / "result.json",
                  R"({"format":"crosstie-result/1","verb":")" + verb +
                      R"(","version":"0","unit":"mm","frame":"rig","inputs":[],"options":{},"verdicts":[)" + verdicts +
                      R"(],"warnings":[])" + more + "}");
    if (report) folder_.write(fs::path("results") / folder / "report.html", "<html>");
  }
  [[nodiscard]] JobFacts facts() const { return read_job_facts(job_, folder_ / "results"); }

  tests::TemporaryFolder folder_;
  Job job_;
};

TEST_F(JobFactsTest, NothingIsDoneInAnEmptyFolder) {
  const JobFacts none = facts();
  for (const LiveStage stage : {LiveStage::kCalibrate, LiveStage::kCommission, LiveStage::kScan})
    EXPECT_FALSE(none.done(stage));
  EXPECT_THAT(none.scanned, IsEmpty());
  EXPECT_FALSE(none.gaps);
  EXPECT_EQ(none.health.level, "NONE");
}

TEST_F(JobFactsTest, AStageIsDoneWithItsResultAndSaysItsWorst) {
  result("calibrate", "calibrate", "OOO");
  result("commission", "commission", "OWFWF");
  const JobFacts now = facts();
  ASSERT_TRUE(now.done(LiveStage::kCalibrate));
  EXPECT_EQ(now.results.at(LiveStage::kCalibrate).summary, "OK: all 3 checks");
  EXPECT_EQ(now.results.at(LiveStage::kCalibrate).report, "results/calibrate/report.html");
  ASSERT_TRUE(now.done(LiveStage::kCommission));
  EXPECT_EQ(now.results.at(LiveStage::kCommission).summary, "FAIL: 2 of 5 checks");
  EXPECT_EQ(now.results.at(LiveStage::kCommission).verdicts.size(), 5U);
  EXPECT_FALSE(now.done(LiveStage::kScan));
  result("commission", "commission", "OWOW");
  EXPECT_EQ(facts().results.at(LiveStage::kCommission).summary, "WARNING: 2 of 4 checks");
  result("calibrate", "calibrate", "");
  EXPECT_EQ(facts().results.at(LiveStage::kCalibrate).summary, "no limit is set");
}

TEST_F(JobFactsTest, AScanNeedsEveryStation) {
  result("scan/a", "scan", "O", R"(,"head_test":{"source":"phases","off_px":0.031,"sigma_px":0.002})");
  result("stitch", "stitch", "O");
  JobFacts now = facts();
  EXPECT_FALSE(now.done(LiveStage::kScan)) << "b is missing";
  ASSERT_EQ(now.scanned.size(), 1U);
  EXPECT_EQ(now.scanned.at("a").px, 0.031);
  EXPECT_EQ(now.scanned.at("a").sigma_px, 0.002);
  result("scan/b", "scan", "W", R"(,"head_test":null)");
  now = facts();
  ASSERT_TRUE(now.done(LiveStage::kScan));
  EXPECT_EQ(now.results.at(LiveStage::kScan).summary, "WARNING: 1 of 3 checks");
  EXPECT_EQ(now.results.at(LiveStage::kScan).report, "results/stitch/report.html") << "of its last step";
  ASSERT_EQ(now.scanned.size(), 2U);
  EXPECT_TRUE(std::isnan(now.scanned.at("b").px)) << "a scan that cannot test the head";
}

TEST_F(JobFactsTest, WhatIsDamagedIsNotThere) {
  for (const char* text : {"", "{", "[]", "null", "3", R"({"format":"crosstie-result/1"})", "{\"verdicts\": 7}"}) {
    for (const char* folder : {"calibrate", "commission", "scan/a", "edge", "check"})
      folder_.write(fs::path("results") / folder / "result.json", text);
    const JobFacts now = facts();
    EXPECT_THAT(now.results, IsEmpty()) << text;
    EXPECT_THAT(now.scanned, IsEmpty()) << text;
    EXPECT_FALSE(now.gaps) << text;
    EXPECT_EQ(now.health.level, "NONE") << text;
  }
}

TEST_F(JobFactsTest, GapsAreSharesOfTheWholeRim) {
  // A closed rim: its length is all of it.
  result("edge", "edge", "O",
         R"(,"length_mm":1000.0,"closed":true,"gaps":[{"from_mm":100.0,"length_mm":30.0,"reason":"shadow"},)"
         R"({"from_mm":600.0,"length_mm":20.0,"reason":"shadow"}])");
  JobFacts now = facts();
  ASSERT_TRUE(now.gaps);
  EXPECT_EQ(now.gaps->count, 2);
  EXPECT_EQ(now.gaps->length_mm, 50.0);
  EXPECT_NEAR(now.gaps->coverage, 0.95, 1e-12);
  // An open one: the way back to its begin is a gap that its length does not hold.
  result("edge", "edge", "O",
         R"(,"length_mm":800.0,"closed":false,"gaps":[{"from_mm":800.0,"length_mm":200.0,"reason":"open"}])");
  now = facts();
  ASSERT_TRUE(now.gaps);
  EXPECT_NEAR(now.gaps->coverage, 0.8, 1e-12);
  result("edge", "edge", "O", R"(,"length_mm":800.0,"closed":true,"gaps":[])");
  EXPECT_EQ(facts().gaps->count, 0);
  EXPECT_EQ(facts().gaps->coverage, 1.0);
  for (const char* more : {R"(,"length_mm":null,"gaps":[])", R"(,"length_mm":0,"gaps":[])", R"(,"length_mm":5,"gaps":{}))"}) {
    result("edge", "edge", "O", more);
    EXPECT_FALSE(facts().gaps) << more;
  }
}

TEST_F(JobFactsTest, TheHealthIsThatOfTheLatestCheck) {
  result("check", "check", "OWO");
  EXPECT_EQ(facts().health.level, "WARNING");
  EXPECT_THAT(facts().health.text, testing::HasSubstr("1 of 3 tests say that the head is not as it was"));
}

}  // namespace
}  // namespace crosstie::app
