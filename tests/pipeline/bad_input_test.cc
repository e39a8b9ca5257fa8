// What a shop floor does to a job: each case gets one clear line, the right exit code, and leaves nothing half-written.

#include <algorithm>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/image.h"
#include "tests/support/program.h"

namespace crosstie {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;
using tests::run_program;
using tests::TemporaryFolder;

constexpr const char* kJob = R"(format = "crosstie-job/1"
[markers]
family = "ring10"
[camera.hand]
focal_px = 1000.0
[network]
images = { hand = "net/*.png" }
scale = "free"
)";

/// A job with three grey photographs in which there is nothing to see.
void write_job(const TemporaryFolder& folder, const std::string& job = kJob) {
  folder.write("job.toml", job);
  fs::create_directories(folder / "net");
  for (const char* name : {"a.png", "b.png", "c.png"}) {
    base::Image image(320, 240, 8);
    for (int y = 0; y < 240; ++y) std::fill_n(image.row<std::uint8_t>(y), 320, static_cast<std::uint8_t>(100 + name[0] - 'a'));
    ASSERT_TRUE(base::write_image(folder / "net" / name, image.view()));
  }
}

/// Replaces the first `from` of the job.
std::string job_with(const std::string& from, const std::string& to) {
  std::string job = kJob;
  return job.replace(job.find(from), from.size(), to);
}

void expect_refused(const TemporaryFolder& folder, int exit_code, const std::string& message, const char* unwritten) {
  const auto run = run_program({"run", folder.path().string()});
  EXPECT_EQ(run.exit_code, exit_code) << run.err;
  EXPECT_THAT(run.err, HasSubstr(message));
  const std::string last = run.err.substr(run.err.rfind("crosstie: ") == std::string::npos ? 0 : run.err.rfind("crosstie: "));
  EXPECT_EQ(std::count(last.begin(), last.end(), '\n'), 1) << "one line: " << last;
  EXPECT_FALSE(fs::exists(folder / "results" / unwritten));
  if (fs::exists(folder / "results")) {
    for (const auto& entry : fs::directory_iterator(folder / "results")) {
      EXPECT_FALSE(entry.path().filename().string().starts_with(".")) << "left behind: " << entry.path();
    }
  }
}

TEST(BadInput, MissingJob) {
  const TemporaryFolder folder;
  expect_refused(folder, 5, "job.toml", "detect");
}

TEST(BadInput, JobsThatAskForWhatIsNotThere) {
  struct Case {
    const char* from;
    const char* to;
    int exit_code;
    const char* message;
    const char* unwritten;
  };
  const Case cases[] = {
      {"family", "famili", 3, "did you mean 'family'", "detect"}, {"ring10", "ring11", 3, "ring10", "detect"},
      {"net/*.png", "net/*.tif", 3, "net/*.tif", "detect"},       {"net/*.png", "absent/*.png", 3, "absent", "detect"},
      {"scale = \"free\"\n", "", 4, "scale_bars", "detect"},      {"focal_px = 1000.0\n", "", 3, "focal", "adjust"},
  };
  for (const Case& one : cases) {
    SCOPED_TRACE(one.message);
    const TemporaryFolder folder;
    write_job(folder, job_with(one.from, one.to));
    expect_refused(folder, one.exit_code, one.message, one.unwritten);
  }
}

TEST(BadInput, DamagedImages) {
  for (const int sixteenth : {0, 1, 4, 8, 15}) {
    const TemporaryFolder folder;
    write_job(folder);
    fs::resize_file(folder / "net/b.png", fs::file_size(folder / "net/b.png") * static_cast<unsigned>(sixteenth) / 16);
    expect_refused(folder, 3, "b.png", "detect");
  }
}

TEST(BadInput, NoMarkersInAnyImage) {
  const TemporaryFolder folder;
  write_job(folder);
  expect_refused(folder, 4, "", "adjust");
  EXPECT_TRUE(fs::exists(folder / "results/detect/result.json")) << "what was done well stays";
}

TEST(BadInput, DamagedScaleBars) {
  const TemporaryFolder folder;
  write_job(folder, job_with("scale = \"free\"", "scale_bars = \"bars.csv\""));
  folder.write("bars.csv", "id_a,id_b,length_mm,sigma_mm\n1,2,1000.0,0.01\n3,4,a metre,0.01\n");
  expect_refused(folder, 3, "bars.csv:3", "adjust");
}

TEST(BadInput, AnEarlierResultSurvivesAFailingRun) {
  const TemporaryFolder folder;
  write_job(folder);
  folder.write("results/detect/result.json", "{\"format\": \"crosstie-result/1\"}");
  fs::resize_file(folder / "net/b.png", 40);
  const auto run = run_program({"run", folder.path().string()});
  EXPECT_EQ(run.exit_code, 3) << run.err;
  EXPECT_EQ(tests::read_all(folder / "results/detect/result.json"), "{\"format\": \"crosstie-result/1\"}");
}

TEST(BadInput, FoldersWithOtherFilesAreLeftAlone) {
  const TemporaryFolder folder;
  write_job(folder);
  folder.write("mine/notes.txt", "mine");
  const auto run =
      run_program({"detect", "--family", "ring10", (folder / "net/a.png").string(), "--out", (folder / "mine").string()});
  EXPECT_EQ(run.exit_code, 5) << run.err;
  EXPECT_EQ(tests::read_all(folder / "mine/notes.txt"), "mine");
}

TEST(BadInput, InitWritesNothingOnErrors) {
  const TemporaryFolder folder;
  write_job(folder);
  const std::string images = (folder / "net").string();
  const std::string out = (folder / "new").string();
  const std::vector<std::pair<std::vector<std::string>, int>> cases = {
      {{"init", "--images", (folder / "absent").string(), "--family", "ring10", "--out", out}, 3},
      {{"init", "--images", images, "--family", "rong10", "--out", out}, 2},
      {{"init", "--images", images, "--camera", "no equals sign", "--family", "ring10", "--out", out}, 2},
      {{"init", "--images", images, "--camera", "l=L_*", "--family", "ring10", "--out", out}, 3},
      {{"init", "--images", images, "--family", "ring10", "--focal-mm", "24", "--out", out}, 2},
      {{"init", "--images", images, "--family", "ring10", "--reference", (folder / "absent.csv").string(), "--out", out}, 5},
      {{"init", "--images", images, "--family", "ring10", "--scale-from", "1", "--out", out}, 2},
  };
  for (const auto& [words, exit_code] : cases) {
    const auto run = run_program(words);
    EXPECT_EQ(run.exit_code, exit_code) << run.err;
    EXPECT_FALSE(fs::exists(out)) << run.err;
  }
  EXPECT_EQ(run_program({"init", "--images", images, "--family", "ring10", "--out", out}).exit_code, 0);
  EXPECT_EQ(run_program({"init", "--images", images, "--family", "ring10", "--out", out}).exit_code, 2)
      << "a job is never overwritten";
}

}  // namespace
}  // namespace crosstie
