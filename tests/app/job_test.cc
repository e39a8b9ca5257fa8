#include "app/job.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "app/toml_text.h"
#include "tests/support/temporary_folder.h"

namespace crosstie::app {
namespace {

using testing::HasSubstr;

constexpr const char* kJob = R"(format = "crosstie-job/1"
name = "panel"
[markers]
family = "aicon14"
ids = ["0-100", 200]
exclude_ids = ["72-74"]
[camera.c043]
focal_mm = 24.0
sensor_width_mm = 23.5
[network]
images = { c043 = "net/043_*", c671 = "net/671_*" }
scale_from = [11, 52]
[reference]
points = "reference.obc"
[limits]
sigma0_px = 0.05
)";

TEST(Job, ReadsWhatAJobSays) {
  const tests::TemporaryFolder folder;
  folder.write("job.toml", kJob);
  const auto job = read_job(folder.path());
  ASSERT_TRUE(job) << job.error().message;
  EXPECT_EQ(job->name, "panel");
  EXPECT_EQ(job->family, "aicon14");
  EXPECT_TRUE(job->ids.contains(200));
  EXPECT_FALSE(job->ids.contains(150));
  EXPECT_TRUE(job->exclude_ids.contains(73));
  EXPECT_EQ(job->cameras.at("c043").focal_mm, 24.0);
  EXPECT_TRUE(job->cameras.contains("c671")) << "cameras of [network] exist without a table of their own";
  EXPECT_EQ(job->network->scale_from, (std::pair{11, 52}));
  EXPECT_EQ(job->limits.sigma0_px, 0.05);
  EXPECT_EQ(job->resolve("net/x.png"), folder / "net/x.png");
  EXPECT_TRUE(read_job(folder / "job.toml"));
}

struct BadJob {
  const char* from;
  const char* to;
  const char* expected;  ///< part of the message
};

class BadJobs : public testing::TestWithParam<BadJob> {};

TEST_P(BadJobs, AreRefusedWithFileAndLine) {
  std::string text = kJob;
  const std::size_t at = text.find(GetParam().from);
  ASSERT_NE(at, std::string::npos);
  text.replace(at, std::string(GetParam().from).size(), GetParam().to);
  const tests::TemporaryFolder folder;
  folder.write("job.toml", text);
  const auto job = read_job(folder.path());
  ASSERT_FALSE(job) << text;
  EXPECT_EQ(job.error().code, base::ErrorCode::kBadInput);
  EXPECT_THAT(job.error().message, HasSubstr(GetParam().expected));
  EXPECT_THAT(job.error().message, HasSubstr("job.toml:"));
}

INSTANTIATE_TEST_SUITE_P(Table, BadJobs,
                         testing::Values(BadJob{"crosstie-job/1", "crosstie-job/2", "crosstie-job/1"},  //
                                         BadJob{"family =", "famly =", "did you mean 'family'"},        //
                                         BadJob{"[limits]", "[limit]", "did you mean 'limits'"},        //
                                         BadJob{"focal_mm = 24.0", "focal_mm = \"24\"", "focal_mm"},    //
                                         BadJob{"focal_mm = 24.0", "focal_mm = -24.0", "positive"},     //
                                         BadJob{"focal_mm = 24.0", "focal_mm = nan", "focal_mm"},       //
                                         BadJob{"sensor_width_mm = 23.5\n", "", "together"},            //
                                         BadJob{"\"0-100\"", "\"100-0\"", "100-0"},                     //
                                         BadJob{"[11, 52]", "[11]", "two ids"},                         //
                                         BadJob{"[11, 52]", "[11, 11]", "different"},                   //
                                         BadJob{"points = \"reference.obc\"\n", "", "scale_from"},      //
                                         BadJob{"{ c043 = \"net/043_*\", c671 = \"net/671_*\" }", "{}", "images"},
                                         BadJob{"family = \"aicon14\"\n", "", "family"},  //
                                         BadJob{"name = \"panel\"", "name = \"panel", "job.toml:2"}));

TEST(Job, ReadsPastTheTablesOfLaterVerbsButChecksTheirKeys) {
  const tests::TemporaryFolder folder;
  folder.write("job.toml", std::string(kJob) + "[[station]]\nname = \"x0850\"\naxis_mm = 850.0\n");
  const auto job = read_job(folder.path());
  ASSERT_TRUE(job) << job.error().message;
  EXPECT_THAT(job->unused, testing::ElementsAre("station"));
  folder.write("job.toml", std::string(kJob) + "[[station]]\naxis_m = 0.85\n");
  EXPECT_THAT(read_job(folder.path()).error().message, HasSubstr("did you mean 'axis_mm'"));
}

TEST(Job, SaysThatItIsMissing) {
  const tests::TemporaryFolder folder;
  EXPECT_EQ(read_job(folder.path()).error().code, base::ErrorCode::kFileSystem);
}

TEST(TomlText, ReadsBackAsItWas) {
  const tests::TemporaryFolder folder;
  const std::string awkward = "a \"quoted\" \\ path\twith\nall ü";
  folder.write("job.toml", "format = \"crosstie-job/1\"\nname = " + toml_string(awkward) +
                               "\n[limits]\nsigma0_px = " + toml_number(7.0) + "\n");
  const auto job = read_job(folder.path());
  ASSERT_TRUE(job) << job.error().message;
  EXPECT_EQ(job->name, awkward);
  EXPECT_EQ(job->limits.sigma0_px, 7.0);
}

}  // namespace
}  // namespace crosstie::app
