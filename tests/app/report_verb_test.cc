// The verb report: what it finds, and what it hands to the browser that prints. The browser is a script that keeps the page it was given.
#include <filesystem>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "app/current.h"
#include "app/session.h"
#include "base/file.h"
#include "report/job_report.h"
#include "tests/app/run_verb.h"
#include "tests/report/markup.h"
#include "tests/support/temporary_folder.h"

namespace crosstie::app {
namespace {

namespace fs = std::filesystem;
using base::ErrorCode;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

std::string page_called(const std::string& name, const std::vector<std::string>& steps = {}) {
  report::JobOverview job{.job = name, .date = "2026-03-30", .results = {}, .not_done = {}};
  for (const std::string& step : steps) {
    const base::ResultEnvelope envelope{.verb = "scan", .frame = "rig", .inputs = {}, .verdicts = {}, .warnings = {}};
    job.results.push_back({step, step + "/report.html", envelope});
  }
  return report::job_report(job);
}

class ReportVerb : public testing::Test {
 protected:
  void SetUp() override {
    write("job/job.toml", "");
    write("job/results/index.html", page_called("overview", {"scan/x0500", "edge"}));
    write("job/results/scan/x0500/report.html", page_called("the scan's"));
    write("job/results/edge/report.html", page_called("the edge's"));
  }
  void write(const std::string& name, const std::string& text) const {
    fs::create_directories((folder_.path() / name).parent_path());
    ASSERT_TRUE(base::write_file_atomically(folder_.path() / name, text));
  }
  [[nodiscard]] std::string at(const std::string& name) const { return (folder_.path() / name).string(); }
  /// A browser that does this with $page, the page to print, and $pdf, where it is to be printed.
  [[nodiscard]] std::string browser(const std::string& deed) const {
    write("browser",
          "#!/bin/sh\nfor word in \"$@\"; do case $word in --print-to-pdf=*) pdf=${word#*=} ;; file://*) page=${word#file://} "
          ";; esac; "
          "done\n" +
              deed + "\n");
    fs::permissions(at("browser"), fs::perms::owner_all);
    return at("browser");
  }
  [[nodiscard]] std::string printing() const {
    return browser("cp \"$page\" " + at("seen.html") + "; printf '%%PDF-1.4 of a test' >\"$pdf\"");
  }
  [[nodiscard]] std::string contents(const std::string& name) const { return tests::read_all(at(name)); }

  const tests::TemporaryFolder folder_;
};

TEST_F(ReportVerb, NamesTheOverviewAndTheReportsThatItLeadsTo) {
  const auto answer = tests::run_verb({"report", at("job")});
  ASSERT_FALSE(answer.error) << answer.error->message;
  EXPECT_EQ(answer.out, at("job/results/index.html") + "\n" + at("job/results/scan/x0500/report.html") + "\n" +
                            at("job/results/edge/report.html") + "\n");
  EXPECT_EQ(tests::run_verb({"report", at("job/results/edge")}).out, at("job/results/edge/report.html") + "\n");
  EXPECT_EQ(tests::run_verb({"report", at("job/job.toml")}).out, answer.out);
}

TEST_F(ReportVerb, BindsAllReportsOfAJobIntoOnePageForThePrinter) {
  const auto answer = tests::run_verb({"report", at("job"), "--pdf", at("door.pdf"), "--browser", printing()});
  ASSERT_FALSE(answer.error) << answer.error->message;
  EXPECT_EQ(answer.out, at("door.pdf") + "\n");
  EXPECT_EQ(contents("door.pdf"), "%PDF-1.4 of a test");
  const std::string page = contents("seen.html");
  EXPECT_EQ(tests::markup_error(page), std::nullopt);
  const auto overview = page.find(">overview<"), scan = page.find(">the scan&#39;s<"), edge = page.find(">the edge&#39;s<");
  EXPECT_LT(overview, scan);
  EXPECT_LT(scan, edge);
  EXPECT_LT(edge, page.size());
  EXPECT_THAT(page, AllOf(HasSubstr("href=\"#r1\""), HasSubstr("id=\"r2\""), Not(HasSubstr("href=\"edge/report.html\""))))
      << "links lead inside";
}

TEST_F(ReportVerb, PrintsOneReportByItself) {
  ASSERT_FALSE(
      tests::run_verb({"report", at("job/results/edge/report.html"), "--pdf", at("edge.pdf"), "--browser", printing()}).error);
  EXPECT_THAT(contents("seen.html"), AllOf(HasSubstr("the edge"), Not(HasSubstr("the scan"))));
}

TEST_F(ReportVerb, LeavesAnEarlierPdfAloneWhereTheBrowserFails) {
  write("door.pdf", "earlier");
  for (const auto& [deed, reason] : {std::pair("exit 3", "exit code 3"), std::pair("kill -SEGV $$", "signal 11"),
                                     std::pair("true", "wrote no PDF"), std::pair("echo text >\"$pdf\"", "wrote no PDF")}) {
    const auto answer = tests::run_verb({"report", at("job"), "--pdf", at("door.pdf"), "--browser", browser(deed)});
    ASSERT_TRUE(answer.error) << deed;
    EXPECT_EQ(answer.error->code, ErrorCode::kFileSystem);
    EXPECT_THAT(answer.error->message, HasSubstr(reason));
    EXPECT_EQ(contents("door.pdf"), "earlier");
  }
}

TEST_F(ReportVerb, SaysWhatIsMissing) {
  const auto error_of = [](std::vector<std::string> words) {
    const auto answer = tests::run_verb(words);
    return answer.error ? answer.error->message : "";
  };
  EXPECT_THAT(error_of({"report", at("nowhere")}), HasSubstr("not there"));
  EXPECT_THAT(error_of({"report", at("job/results/scan")}), HasSubstr("no report there"));
  EXPECT_THAT(error_of({"report", at("job"), "--browser", "chromium"}), HasSubstr("needs --pdf"));
  EXPECT_THAT(error_of({"report", at("job"), "--pdf", at("a.pdf"), "--browser", at("none")}), HasSubstr("no program"));
  write("foreign/report.html", "<html><body>not ours</body></html>");
  EXPECT_THAT(error_of({"report", at("foreign"), "--pdf", at("a.pdf"), "--browser", printing()}),
              HasSubstr("no page of crosstie"));
  write("job/results/edge/report.html", "cut");
  EXPECT_THAT(error_of({"report", at("job"), "--pdf", at("a.pdf"), "--browser", printing()}), HasSubstr("no page of crosstie"));
  EXPECT_FALSE(fs::exists(at("a.pdf")));
}

TEST_F(ReportVerb, TheWayFromAReportToItsOverview) {
  Session session(true, 1, {});
  EXPECT_EQ(overview_of(at("job/results/edge"), session), "../index.html");
  EXPECT_EQ(overview_of(at("job/results/edge/"), session), "../index.html");
  EXPECT_EQ(overview_of(at("job/results/scan/x0500"), session), "../../index.html");
  EXPECT_EQ(overview_of(at("job/other/edge"), session), "");
  EXPECT_EQ(overview_of(at("elsewhere/edge"), session), "") << "it stands in no job";
  session.set_job_results(at("elsewhere/"));  // as run --out tells
  EXPECT_EQ(overview_of(at("elsewhere/edge"), session), "../index.html");
  EXPECT_EQ(overview_of(at("elsewhere/scan/x0500"), session), "../../index.html");
  EXPECT_EQ(overview_of(at("another/edge"), session), "");
}

}  // namespace
}  // namespace crosstie::app
