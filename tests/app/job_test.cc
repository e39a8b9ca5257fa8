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

/// What read_job says of a job with one thing changed; "" where it takes it.
std::string refusal(std::string text, const BadJob& change) {
  const std::size_t at = text.find(change.from);
  if (at == std::string::npos) return "the job does not hold what is to be changed";
  text.replace(at, std::string(change.from).size(), change.to);
  const tests::TemporaryFolder folder;
  folder.write("job.toml", text);
  const auto job = read_job(folder.path());
  if (job) return "";
  EXPECT_EQ(job.error().code, base::ErrorCode::kBadInput);
  return job.error().message;
}

class BadJobs : public testing::TestWithParam<BadJob> {};

TEST_P(BadJobs, AreRefusedWithFileAndLine) {
  const auto message = refusal(kJob, GetParam());
  EXPECT_THAT(message, HasSubstr(GetParam().expected));
  EXPECT_THAT(message, HasSubstr("job.toml:"));
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
                                         BadJob{"[11, 52]", "[11]", "two whole numbers"},               //
                                         BadJob{"[11, 52]", "[11, 11]", "different"},                   //
                                         BadJob{"points = \"reference.obc\"\n", "", "scale_from"},      //
                                         BadJob{"{ c043 = \"net/043_*\", c671 = \"net/671_*\" }", "{}", "images"},
                                         BadJob{"family = \"aicon14\"\n", "", "family"},  //
                                         BadJob{"name = \"panel\"", "name = \"panel", "job.toml:2"}));

constexpr const char* kHead = R"(format = "crosstie-job/1"
date = "2026-11-26"
[board]
corners = [24, 17]
pitch_mm = 30.0
bend_sigma_mm = 0.2
temperature_c = 22.5
cte_per_k = 23e-6
certificate = "B-17"
certificate_date = "2025-03-01"
certificate_expires = 2027-03-01
[camera.left]
board_images = "board/left/*.png"
temperature_c = 31.0
[camera.right]
board_images = "board/right/*.png"
lens = "opencv8"
[rig]
cameras = ["right", "left"]
baseline_mm = 800.0
[cross]
points = "cross/tritop.csv"
spheres = "cross/spheres.csv"
temperature_c = 24.0
temperature_sigma_c = 0.5
cte_per_k = 11.5e-6
cte_sigma_per_k = 1e-6
certificate = "K-3"
[machine]
probe_hits = "machine/hits.csv"
stylus_diameter_mm = 5.0
probe_sigma_mm = 0.02
axis_sigma_mm = 0.01
temperature_c = 23.5
[[station]]
name = "x0850"
axis_mm = 850.0
cross = { left = "cross/x0850_l.png", right = "cross/x0850_r.png" }
scan = { left = "scan/x0850/left", right = "scan/x0850/right", manifest = "scan/patterns.json" }
[[station]]
name = "x0100"
axis_mm = -100.0
[limits]
heldout_rms_px = 0.15
epipolar_px = 0.2
seam_mm = 0.05
calibration_change = 2.5
off_axis_w = 4.0
)";

TEST(Job, ReadsTheHeadsCalibrationAndTheMachine) {
  const tests::TemporaryFolder folder;
  folder.write("job.toml", kHead);
  const auto job = read_job(folder.path());
  ASSERT_TRUE(job) << job.error().message;
  EXPECT_EQ(base::format_date(*job->date), "2026-11-26");
  ASSERT_TRUE(job->board);
  const base::Board& board = job->board->board;
  EXPECT_EQ(board.columns, 24);
  EXPECT_EQ(board.rows, 17);
  EXPECT_EQ(board.pattern, base::BoardPattern::kChessboard);
  EXPECT_TRUE(board.free);
  EXPECT_EQ(board.prior.bend_sigma_mm, 0.2) << "the job's own";
  EXPECT_DOUBLE_EQ(board.prior.sigma_mm, board.with_default_prior().prior.sigma_mm) << "the default beside it";
  EXPECT_EQ(board.certificate.number, "B-17");
  EXPECT_EQ(base::format_date(*board.certificate.valid_until), "2027-03-01") << "a date of TOML is one, too";
  EXPECT_EQ(job->cameras.at("left").temperature_c, 31.0);
  EXPECT_EQ(job->cameras.at("right").lens, base::LensModel::kOpenCv8);
  EXPECT_FALSE(job->cameras.at("left").lens) << "the ladder chooses";
  EXPECT_THAT(job->board_cameras(), testing::ElementsAre("right", "left")) << "in the rig's order";
  EXPECT_EQ(job->rig->baseline_mm, 800.0);
  EXPECT_EQ(job->cross->spheres, "cross/spheres.csv");
  EXPECT_EQ(job->cross->thermal.cte_sigma_per_k, 1e-6);
  EXPECT_EQ(job->machine->stylus_diameter_mm, 5.0);
  EXPECT_EQ(job->machine->axis_sigma_mm, 0.01);
  ASSERT_EQ(job->stations.size(), 2U);
  EXPECT_EQ(job->stations[0].name, "x0100") << "by the axis";
  EXPECT_THAT(job->stations[1].cross,
              testing::ElementsAre(testing::Pair("left", "cross/x0850_l.png"), testing::Pair("right", "cross/x0850_r.png")));
  EXPECT_EQ(job->limits.heldout_rms_px, 0.15);
  EXPECT_EQ(job->limits.epipolar_px, 0.2);
  EXPECT_EQ(job->limits.seam_mm, 0.05);
  EXPECT_EQ(job->limits.calibration_change, 2.5);
  EXPECT_EQ(job->limits.off_axis_w, 4.0);
}

class BadHeads : public testing::TestWithParam<BadJob> {};

TEST_P(BadHeads, AreRefusedWithFileAndLine) {
  const auto message = refusal(kHead, GetParam());
  EXPECT_THAT(message, HasSubstr(GetParam().expected));
  EXPECT_THAT(message, HasSubstr("job.toml:"));
}

INSTANTIATE_TEST_SUITE_P(
    Table, BadHeads,
    testing::Values(BadJob{"corners = [24, 17]\n", "", "corners = [COLUMNS, ROWS]"},                         //
                    BadJob{"[24, 17]", "[24.5, 17]", "whole numbers"},                                       //
                    BadJob{"[24, 17]", "[1, 17]", "1 x 17 corners"},                                         //
                    BadJob{"pitch_mm = 30.0\n", "", "pitch_mm"},                                             //
                    BadJob{"bend_sigma_mm = 0.2", "shape = \"rigid\"\nbend_sigma_mm = 0.2", "rigid"},        //
                    BadJob{"bend_sigma_mm = 0.2", "pattern = \"chesboard\"", "did you mean 'chessboard'"},   //
                    BadJob{"bend_sigma_mm = 0.2", "tag_mm = 20.0", "aprilgrid"},                             //
                    BadJob{"bend_sigma_mm = 0.2", "bend_sigma = 0.2", "did you mean 'bend_sigma_mm'"},       //
                    BadJob{"bend_sigma_mm = 0.2", "sigma_mm = 0.0", "above 0"},                              //
                    BadJob{"23e-6", "23.0", "steel"},                                                        //
                    BadJob{"\"2025-03-01\"", "\"2025-02-30\"", "certificate_date must be a date"},           //
                    BadJob{"2027-03-01", "2024-03-01", "lies before"},                                       //
                    BadJob{"date = \"2026-11-26\"", "date = \"26.11.2026\"", "such as \"2026-05-31\""},      //
                    BadJob{"[\"right\", \"left\"]", "[\"right\", \"right\"]", "twice"},                      //
                    BadJob{"[\"right\", \"left\"]", "[\"right\", \"lft\"]", "which the job does not have"},  //
                    BadJob{"[rig]\ncameras = [\"right\", \"left\"]\nbaseline_mm = 800.0\n", "", "which is the left one"},
                    BadJob{"lens = \"opencv8\"", "lens = \"opencv9\"", "opencv12"},                               //
                    BadJob{"lens = \"opencv8\"", "model = \"r.cameramodel\"", "not both"},                        //
                    BadJob{"points = \"cross/tritop.csv\"\n", "", "points"},                                      //
                    BadJob{"\"cross/tritop.csv\"", "\"adjust\"", "no [network]"},                                 //
                    BadJob{"11.5e-6", "11.5", "steel"},                                                           //
                    BadJob{"temperature_sigma_c = 0.5", "temperature_sigma_c = -0.5", "0 or a positive number"},  //
                    BadJob{"stylus_diameter_mm = 5.0\n", "", "stylus_diameter_mm"},                               //
                    BadJob{"probe_sigma_mm = 0.02", "probed_spheres = \"p.csv\"", "not both"},                    //
                    BadJob{"axis_sigma_mm = 0.01", "axis_sigma_m = 0.01", "did you mean 'axis_sigma_mm'"},        //
                    BadJob{"name = \"x0100\"", "name = \"x0850\"", "two stations"},                               //
                    BadJob{"axis_mm = -100.0", "axis_mm = \"-100\"", "axis_mm must be a number"},                 //
                    BadJob{"axis_mm = -100.0\n", "", "axis_mm"},                                                  //
                    BadJob{"axis_mm = -100.0", "axis_m = -0.1", "did you mean 'axis_mm'"},                        //
                    BadJob{"heldout_rms_px = 0.15", "heldout_rms = 0.15", "did you mean 'heldout_rms_px'"}));

constexpr const char* kCut = R"([hole]
nominal = "oval"
length_mm = 2000.0
width_mm = 800.0
centre_mm = [600, 0, 2150]
normal = [0, 0, 1]
length_direction = [1, 0, 0]
[part]
position = "tower"
axis_point_mm = [0, 0, 0]
axis_direction = [1, 0, 0]
axis_in_machine = [1, 0, 0]
radius_mm = 2150.0
[path]
direction = "cw"
bevel_rad = 0.5
reach_low_mm = [-1000, -3000, 0]
reach_high_mm = [4000, 0, 4000]
arc_tolerance_mm = 0
)";

TEST(Job, ReadsHolePartAndPath) {
  const tests::TemporaryFolder folder;
  folder.write("job.toml", std::string(kJob) + kCut);
  const auto job = read_job(folder.path());
  ASSERT_TRUE(job) << job.error().message;
  ASSERT_TRUE(job->hole.has_value());
  EXPECT_EQ(job->hole->nominal, "oval");
  EXPECT_EQ(*job->hole->length_mm, 2000.0);
  EXPECT_EQ(job->hole->centre_mm->z(), 2150.0);
  EXPECT_EQ(job->part.position, "tower");
  EXPECT_EQ(*job->part.radius_mm, 2150.0);
  EXPECT_FALSE(job->path.counter_clockwise);
  EXPECT_EQ(job->path.bevel_rad, 0.5);
  EXPECT_EQ(job->path.reach_high_mm->x(), 4000.0);
  EXPECT_EQ(job->path.step_mm, 2.0);
}

class BadCuts : public testing::TestWithParam<BadJob> {};

TEST_P(BadCuts, AreRefusedWithFileAndLine) {
  const auto message = refusal(std::string(kJob) + kCut, GetParam());
  EXPECT_THAT(message, HasSubstr(GetParam().expected));
  EXPECT_THAT(message, HasSubstr("job.toml:"));
}

INSTANTIATE_TEST_SUITE_P(
    Table, BadCuts,
    testing::Values(BadJob{"nominal = \"oval\"", "nominl = \"oval\"", "did you mean 'nominal'"},
                    BadJob{"nominal = \"oval\"", "nominal = \"door.csv\"", "belongs to an outline"},
                    BadJob{"nominal = \"oval\"", "nominal = \"circle\"", "a circle has diameter_mm"},
                    BadJob{"width_mm = 800.0\n", "", "go together"}, BadJob{"normal = [0, 0, 1]\n", "", "go together"},
                    BadJob{"[0, 0, 1]", "[0, 0, 0]", "has no direction"}, BadJob{"[0, 0, 1]", "[0, 1]", "three numbers"},
                    BadJob{"axis_direction = [1, 0, 0]\n", "", "go together"},
                    BadJob{"\"tower\"", "\"markers\"", "needs points"}, BadJob{"\"tower\"", "\"magic\"", "tower"},
                    BadJob{"axis_in_machine = [1, 0, 0]\n", "", "which end"},
                    BadJob{"bevel_rad = 0.5", "bevel_rad = 30", "radians, not degrees"},
                    BadJob{"bevel_rad = 0.5", "bevel_deg = 30", "bevel_rad"},
                    BadJob{"reach_low_mm = [-1000, -3000, 0]\n", "", "go together"},
                    BadJob{"[-1000, -3000, 0]", "[-1000, 3000, 0]", "low_mm below"}, BadJob{"\"cw\"", "\"left\"", "ccw"}));

TEST(Job, SaysThatItIsMissing) {
  const tests::TemporaryFolder folder;
  EXPECT_EQ(read_job(folder.path()).error().code, base::ErrorCode::kFileSystem);
}

/// toml++ unwinds tables by recursion: some megabytes of dotted keys ended the program by its stack.
TEST(Job, KeysOfMillionsOfPartsAreRefused) {
  const tests::TemporaryFolder folder;
  std::string parts = "a";
  for (int i = 0; i < 4'000'000; ++i) parts += ".a";
  for (const std::string& text :
       {"[" + parts + "]\n", parts + " = 1\n", "[[ \"=\\\"\" . " + parts + "]]\n", "x = { " + parts + " = 1 }\n"}) {
    folder.write("job.toml", "format = \"crosstie-job/1\"\n" + text);
    const auto job = read_job(folder.path());
    ASSERT_FALSE(job);
    EXPECT_EQ(job.error().code, base::ErrorCode::kBadInput);
    EXPECT_THAT(job.error().message, HasSubstr("job.toml:2: a key of more than 32 parts"));
  }
}

/// What toml++ asks of these characters ends in undefined behaviour (its function for blanks beyond ASCII).
TEST(Job, CharactersBeyondAsciiStandInQuotesAndComments) {
  const tests::TemporaryFolder folder;
  const std::string head = "\xEF\xBB\xBF#\xC3\xBC\nformat = \"crosstie-job/1\"\n";
  folder.write("job.toml", head + R"(markers = { family = "ring10" }
name = """Tür \
  A""""
[network]
images = { 'büro' = 'ü*.png' } # ä
[camera."büro"]
focal_mm = 24
sensor_width_mm = 23.5
)");
  const auto good = read_job(folder.path());
  ASSERT_TRUE(good) << good.error().message;
  EXPECT_EQ(good->name, "Tür A\"");
  EXPECT_TRUE(good->cameras.contains("büro"));
  for (const std::string text : {"[camera.c67\xCF\x98\n", "größe = 3\n", "name =ä\n", "name = \"a\" \u2002\n",
                                 R"(name = """a \ü""")", "x = { a = '''b''''' ü\n", R"(x = { a = "\"#" ü)"}) {
    folder.write("job.toml", head + text);
    const auto job = read_job(folder.path());
    ASSERT_FALSE(job) << text;
    EXPECT_EQ(job.error().code, base::ErrorCode::kBadInput);
    EXPECT_THAT(job.error().message, HasSubstr("job.toml:3: a character that is not ASCII"));
  }
}

TEST(Job, DotsInTextsAndNumbersAreNoPartsOfKeys) {
  const tests::TemporaryFolder folder;
  const std::string dots(100, '.');
  std::string numbers = "0.5";
  for (int i = 0; i < 100; ++i) numbers += ", 0.5";
  folder.write("job.toml", "format = \"crosstie-job/1\"\nname = \"\"\"\\\"\n" + dots + "\"\"\" # " + dots +
                               "\n[limits]\nsigma0_px = [" + numbers + "]\n");
  const auto job = read_job(folder.path());
  ASSERT_FALSE(job);
  EXPECT_THAT(job.error().message, HasSubstr("job.toml:5: sigma0_px must be a positive number"));
}

TEST(Job, ErrorsAreOneShortLineWhateverTheyQuote) {
  const tests::TemporaryFolder folder;
  for (const std::string& text :
       {std::string("format = \"\"\"a\nb\"\"\"\n"),
        "format = \"crosstie-job/1\"\n\"" + std::string(1'000'000, 'k') + "\" = 1\n",
        std::string("format = \"crosstie-job/1\"\nname = fals\n"), std::string("format = \"crosstie-job/1\"\n\"\\n\" = 1\n")}) {
    folder.write("job.toml", text);
    const auto job = read_job(folder.path());
    ASSERT_FALSE(job);
    EXPECT_THAT(job.error().message, testing::Not(HasSubstr("\n")));
    EXPECT_LT(job.error().message.size(), 1000U);
  }
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
