// crosstie report: which pages are meant, and what is said where nothing can print.

#include <fstream>

#include <gmock/gmock.h>

#include "app/browser.h"
#include "app/current.h"
#include "tests/app/run_verb.h"
#include "tests/support/temporary_folder.h"

namespace crosstie::app {
namespace {

using testing::HasSubstr;
using tests::run_verb;

void write(const std::filesystem::path& file, const std::string& text) {
  std::filesystem::create_directories(file.parent_path());
  std::ofstream(file) << text;
}

TEST(Report, NamesThePagesOfAJob) {
  const tests::TemporaryFolder folder;
  const auto job = folder.path() / "job";
  write(job / "job.toml", "");
  write(
      job / "results/index.html",
      R"(<a href="calibrate/report.html">c</a><a href="scan/x0/report.html">s</a><a href="calibrate/report.html">c</a><a href="#x">x</a>)");
  write(job / "results/calibrate/report.html", "");
  for (const auto& path : {job, job / "job.toml", job / "results"}) {
    const auto answer = run_verb({"report", path.string()});
    ASSERT_FALSE(answer.error) << answer.error->message;
    const std::string results = (job / "results").string();
    EXPECT_EQ(answer.out,
              results + "/index.html\n" + results + "/calibrate/report.html\n" + results + "/scan/x0/report.html\n");
  }
  const auto one = run_verb({"report", (job / "results/calibrate").string()});
  EXPECT_THAT(one.out, HasSubstr("calibrate/report.html"));
  EXPECT_EQ(run_verb({"report", (folder.path() / "none").string()}).error->code, base::ErrorCode::kFileSystem);
  std::filesystem::create_directory(folder.path() / "empty");
  EXPECT_EQ(run_verb({"report", (folder.path() / "empty").string()}).error->code, base::ErrorCode::kBadInput);
  EXPECT_EQ(run_verb({"report", job.string(), "--browser", "x"}).error->code, base::ErrorCode::kUsage);
}

TEST(Report, SaysWhatPrintsIt) {
  const tests::TemporaryFolder folder;
  const auto page = folder.path() / "report.html";
  write(page, "<body>\n<main></main>\n</body>");
  const auto pdf = folder.path() / "out.pdf";
  const auto missing = run_verb({"report", page.string(), "--pdf", pdf.string(), "--browser", "no-such-browser"});
  ASSERT_TRUE(missing.error);
  EXPECT_EQ(missing.error->code, base::ErrorCode::kFileSystem);
  EXPECT_THAT(missing.error->message, HasSubstr("no-such-browser"));
  // Programs that are no browsers: one fails, one writes nothing.
  for (const char* program : {"/bin/false", "/bin/true"}) {
    const auto answer = run_verb({"report", page.string(), "--pdf", pdf.string(), "--browser", program});
    ASSERT_TRUE(answer.error) << program;
    EXPECT_EQ(answer.error->code, base::ErrorCode::kFileSystem);
    EXPECT_FALSE(std::filesystem::exists(pdf));
  }
  write(page, "<p>of another program</p>");
  EXPECT_EQ(run_verb({"report", page.string(), "--pdf", pdf.string(), "--browser", "/bin/true"}).error->code,
            base::ErrorCode::kBadInput);
}

TEST(Report, ResultsOfAJobLeadToItsOverview) {
  const tests::TemporaryFolder folder;
  write(folder.path() / "job/job.toml", "");
  EXPECT_EQ(overview_of(folder.path() / "job/results/adjust"), "../index.html");
  EXPECT_EQ(overview_of(folder.path() / "job/results/scan/x0/"), "../../index.html");
  EXPECT_EQ(overview_of(folder.path() / "job/other/adjust"), "");
  EXPECT_EQ(overview_of(folder.path() / "elsewhere/results/adjust"), "");
  const OverviewIn elsewhere(folder.path() / "elsewhere/");  // as run --out writes it
  EXPECT_EQ(overview_of(folder.path() / "elsewhere/adjust"), "../index.html");
  EXPECT_EQ(overview_of(folder.path() / "elsewhere/scan/x0"), "../../index.html");
}

}  // namespace
}  // namespace crosstie::app
