// From boards, cross, spheres and stations to the head in the machine's frame through the program, on small photographs of the twin: held
// against its truth, and against what can go wrong on the way.

#include <functional>
#include <map>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <Eigen/Cholesky>
#include <nlohmann/json.hpp>

#include "base/commissioning_reader.h"
#include "base/file.h"
#include "base/json_file.h"
#include "base/text.h"
#include "fixtures/detail/cross_body.h"
#include "fixtures/detail/head_views.h"
#include "fixtures/render.h"
#include "fixtures/sampled.h"
#include "fixtures/simulate.h"
#include "math/distributions.h"
#include "tests/support/folder_contents.h"
#include "tests/support/normalised_square.h"
#include "tests/support/program.h"

namespace crosstie {
namespace {

namespace fs = std::filesystem;
using nlohmann::ordered_json;
using testing::HasSubstr;
using tests::read_all;
using tests::run_program;
using tests::TemporaryFolder;

/// The scene "machine" with cameras of half the resolution, a board of fewer and larger squares in fewer poses, and a cross of 24 larger
/// markers; no photographs by hand.
fixtures::Scene small_machine() {
  fixtures::Scene scene = fixtures::make_scene("machine").value();
  scene.cameras.resize(2);
  for (fixtures::SceneCamera& camera : scene.cameras) {
    Eigen::VectorXd parameters = camera.camera->parameters();
    parameters.head<4>() *= 0.5;
    camera.camera = base::Camera::make(camera.camera->model(), 816, 680, parameters).value();
  }
  scene.views.clear();
  scene.scale_bars.clear();
  scene.background.clutter = 4;
  fixtures::SceneBoard& board = *scene.board;
  board.board.columns = 12;
  board.board.rows = 9;
  board.board.pitch_mm = 56.0;
  board.rig_from_board =
      fixtures::detail::board_poses(scene, {.count = 12, .near_mm = 900.0, .far_mm = 1400.0, .tilt_rad = 0.6, .seed = 3});
  std::vector<int> ids;
  for (const auto& code : scene.family.codes) ids.push_back(code.id);
  fixtures::Body cross = fixtures::detail::cross_body({.length_x_mm = 1400.0,
                                                       .length_y_mm = 1000.0,
                                                       .plates_x = 6,
                                                       .plates_y = 4,
                                                       .step_x_mm = 84.0,
                                                       .step_y_mm = 84.0,
                                                       .dot_radius_mm = 10.0,
                                                       .sheet_mm = 82.0,
                                                       .seed = 5},
                                                      ids);
  for (const fixtures::Ball& ball : scene.bodies.front().balls)
    fixtures::detail::add_sphere(cross, ball.id, ball.centre_mm.x(), ball.centre_mm.y(), ball.centre_mm.z(), ball.diameter_mm);
  scene.bodies = {std::move(cross)};
  return scene;
}

/// A job of the small machine, commissioned once; shared by all tests of this file.
class CommissionJob : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = new TemporaryFolder;
    const auto simulated = fixtures::simulate(small_machine(), job(), {.seed = kSeed});
    ASSERT_TRUE(simulated) << simulated.error().message;
    run_ = run_program({"run", job().string()});
    ASSERT_LE(run_.exit_code, 1) << run_.err;
  }
  static void TearDownTestSuite() {
    delete folder_;
    folder_ = nullptr;
  }
  static fs::path job() { return *folder_ / "job"; }
  static fs::path results(const char* step) { return job() / "results" / step; }

  static constexpr std::uint64_t kSeed = 3;
  static TemporaryFolder* folder_;
  static tests::ProgramRun run_;
};
TemporaryFolder* CommissionJob::folder_ = nullptr;
tests::ProgramRun CommissionJob::run_;

TEST_F(CommissionJob, RunDoesAllStepsAndThenNothing) {
  for (const char* step : {"calibrate", "stations", "commission"}) EXPECT_THAT(run_.err, HasSubstr(step));
  for (const char* step : {"calibrate", "detect-stations", "commission"})
    EXPECT_THAT(run_.out, HasSubstr((results(step) / "report.html").string()));
  const std::string before = read_all(results("commission") / "result.json");
  const auto again = run_program({"run", job().string()});
  EXPECT_LE(again.exit_code, 1) << again.err;
  std::size_t current = 0;
  for (std::size_t at = again.err.find("up to date"); at != std::string::npos; at = again.err.find("up to date", at + 1))
    ++current;
  EXPECT_EQ(current, 3U) << again.err;
  EXPECT_EQ(read_all(results("commission") / "result.json"), before);
  EXPECT_THAT(before, testing::Not(HasSubstr("certificate_not_checked"))) << "the job has a date";
}

TEST_F(CommissionJob, PutsTheHeadWhereItIs) {
  const auto result = base::read_commissioning(results("commission"));
  ASSERT_TRUE(result) << result.error().message;
  const fixtures::Scene truth = fixtures::drawn(small_machine(), kSeed);
  // The first station's reading is not exactly 0; the head's place at 0 is wanted all the same.
  EXPECT_TRUE(result->zero_in_travel);
  for (const double reading_mm : {0.0, 400.0, 1000.0}) {
    const auto pose = result->frame.at(reading_mm);
    ASSERT_TRUE(pose) << reading_mm;
    const double square =
        tests::normalised_square(pose->machine_from_rig, fixtures::machine_from_rig(*truth.machine, reading_mm), pose->cov);
    std::printf("machine_from_rig(%g): normalised square %.2f of 6\n", reading_mm, square);
    EXPECT_LT(square, math::chi_square_quantile(0.999, 6.0)) << reading_mm;
  }
  EXPECT_LT(tests::normalised_square(result->head.right_from_left, truth.head->right_from_left,
                                     base::Matrix6d(result->head.cov.bottomRightCorner<6, 6>())),
            math::chi_square_quantile(0.999, 6.0));
  for (std::size_t i = 0; i < result->spheres.size(); ++i) {
    const Eigen::Vector3d error = result->spheres[i].centre_mm - fixtures::true_spheres(truth)[i];
    EXPECT_LT(error.dot(result->spheres[i].cov_mm2.ldlt().solve(error)), math::chi_square_quantile(0.999, 3.0)) << i;
  }
}

TEST_F(CommissionJob, IsTheSameBytesForAnyNumberOfThreads) {
  // With all that comes before it; the cross-validation's threads are calibrate's own test.
  const auto first = tests::result_contents(results("commission"));
  const auto stations = tests::folder_contents(results("detect-stations"));
  ASSERT_FALSE(first.empty());
  for (const char* threads : {"1", "8"}) {
    const TemporaryFolder other;
    const auto run =
        run_program({"run", job().string(), "--to", "stations", "--threads", threads, "--out", (other / "out").string()});
    ASSERT_LE(run.exit_code, 1) << run.err;
    EXPECT_EQ(tests::folder_contents(other / "out/detect-stations"), stations) << threads;
    const auto commissioned =
        run_program({"commission", job().string(), "--threads", threads, "--out", (other / "c").string()});
    ASSERT_LE(commissioned.exit_code, 1) << commissioned.err;
    EXPECT_EQ(tests::result_contents(other / "c"), first) << threads;
  }
}

/// A pair of photographs of the cross, taken at a place of the axis by the head as it is or with a right camera that moved.
void photograph(const fs::path& folder, double axis_mm, const base::Pose& right_moved) {
  fixtures::Scene scene = small_machine();
  scene.head->right_from_left = right_moved * scene.head->right_from_left;
  scene.board.reset();
  scene.machine->stations = {{.name = "now", .axis_mm = axis_mm}};
  // Drawn with the job's seed: the cross has the same size.
  const fixtures::Scene now = fixtures::drawn(std::move(scene), 3);
  for (std::size_t view = 0; view < now.views.size(); ++view) {
    const auto image = fixtures::render(now, view, 77, 2);
    ASSERT_TRUE(image) << image.error().message;
    ASSERT_TRUE(base::make_folder(folder));
    ASSERT_TRUE(base::write_image(folder / (now.views[view].name + ".png"), image->view()));
  }
}

TEST_F(CommissionJob, TheCheckTellsAnUnmovedHeadFromOneWhoseRightCameraMoved) {
  const TemporaryFolder pairs;
  photograph(pairs / "same", 430.0, {});
  photograph(pairs / "moved", 430.0, {base::rotation_exp({2e-4, 0.0, 0.0}), {}});
  const auto check = [&](const char* which, const std::vector<std::string>& more = {}) {
    std::vector<std::string> words = {"commission",
                                      job().string(),
                                      "--check",
                                      (pairs / which / "now_l.png").string(),
                                      (pairs / which / "now_r.png").string(),
                                      "--axis-mm",
                                      "430.0",
                                      "--out",
                                      (pairs / "out").string()};
    words.insert(words.end(), more.begin(), more.end());
    return run_program(words);
  };
  const auto same = check("same");
  EXPECT_EQ(same.exit_code, 0) << same.err << same.out;
  EXPECT_THAT(same.out, HasSubstr("rig and frame hold"));
  const auto moved = check("moved");
  EXPECT_EQ(moved.exit_code, 1) << moved.err << moved.out;
  EXPECT_THAT(moved.out, HasSubstr("RIG MOVED"));
  const ordered_json json = base::read_json(pairs / "out/result.json").value();
  EXPECT_NEAR(json.at("rig_change").at(0).get<double>(), 2e-4, 4.0 * json.at("rig_change_sigma").at(0).get<double>());
  EXPECT_EQ(check("same", {"--temperature-c", "40"}).exit_code, 0);
  EXPECT_THAT(read_all(pairs / "out/result.json"), HasSubstr("head_temperature"));

  // Its spheres probed again, 0.3 mm higher than they were: the cross is named, the head is not.
  const auto known = base::read_commissioning(results("commission"));
  ASSERT_TRUE(known);
  std::string lifted = "id,x_mm,y_mm,z_mm,sigma_x_mm,sigma_y_mm,sigma_z_mm\n";
  for (const auto& sphere : known->spheres) {
    lifted += fmt::format("{},{},{},{},0.01,0.01,0.01\n", sphere.id, sphere.centre_mm.x(), sphere.centre_mm.y(),
                          sphere.centre_mm.z() + 0.3);
  }
  const auto again = check("same", {"--probed-again", pairs.write("lifted.csv", lifted).string()});
  EXPECT_EQ(again.exit_code, 1) << again.err;
  EXPECT_THAT(again.out, HasSubstr("CROSS MOVED"));
}

TEST_F(CommissionJob, TheCheckRefusesWhatItCannotJudge) {
  const std::string left = (job() / "cross/x0500_l.png").string();
  const std::string right = (job() / "cross/x0500_r.png").string();
  const auto check = [&](const std::vector<std::string>& words) {
    std::vector<std::string> all = {"commission", job().string(), "--out", (*folder_ / "refused").string()};
    all.insert(all.end(), words.begin(), words.end());
    return run_program(all);
  };
  EXPECT_EQ(check({"--check", left, right}).exit_code, 2);
  EXPECT_EQ(check({"--check", left, left, "--axis-mm", "500"}).exit_code, 2);
  const auto outside = check({"--check", left, right, "--axis-mm", "1500"});
  EXPECT_EQ(outside.exit_code, 3);
  EXPECT_THAT(outside.err, HasSubstr("commissioned from"));
  const auto board =
      check({"--check", (job() / "board/left/01.png").string(), (job() / "board/right/01.png").string(), "--axis-mm", "500"});
  EXPECT_EQ(board.exit_code, 4) << board.err;
  EXPECT_FALSE(fs::exists(*folder_ / "refused"));
}

/// The text of a file with each occurrence of `from` replaced.
std::string replaced(std::string text, const std::string& from, const std::string& to) {
  for (std::size_t at = text.find(from); at != std::string::npos; at = text.find(from, at + to.size()))
    text.replace(at, from.size(), to);
  return text;
}

/// A table with its coordinates multiplied; sigmas and all other columns stay.
std::string scaled_coordinates(const std::string& text, double factor) {
  std::string result;
  std::vector<std::string> names;
  for (const std::string_view line : base::split(text, '\n')) {
    std::string row;
    const auto cells = base::split(line, ',');
    for (std::size_t i = 0; i < cells.size(); ++i) {
      const auto value = base::parse_double(cells[i]);
      const bool coordinate = i < names.size() && (names[i] == "x_mm" || names[i] == "y_mm" || names[i] == "z_mm");
      if (i > 0) row += ',';
      row += value && coordinate ? base::format_double(*value * factor) : std::string(cells[i]);
    }
    if (names.empty()) names.assign(cells.begin(), cells.end());
    result += row + "\n";
  }
  return result;
}

struct BadMachine {
  const char* name;
  const char* file;  ///< of the job, that is changed
  std::function<std::string(std::string)> change;
  int exit_code;
  const char* reason;
};

const BadMachine kBadMachines[] = {
    {"no spheres in [cross]", "job.toml", [](auto text) { return replaced(text, "spheres = \"cross/spheres.csv\"\n", ""); }, 3,
     "points and spheres"},
    {"no probing in [machine]", "job.toml", [](auto text) { return replaced(text, "probe_hits = \"machine/hits.csv\"\n", ""); },
     3, "probed_spheres or probe_hits"},
    {"a list of spheres that is not there", "job.toml",
     [](auto text) { return replaced(text, "cross/spheres.csv", "cross/none.csv"); }, 5, "none.csv"},
    {"one station", "job.toml", [](auto text) { return text.substr(0, text.find("[[station]]\nname = \"x0250\"")); }, 4,
     "the axis needs two"},
    {"no station", "job.toml", [](auto text) { return text.substr(0, text.find("[[station]]")); }, 3, "needs [[station]]"},
    {"two stations of one name", "job.toml", [](auto text) { return replaced(text, "name = \"x0250\"", "name = \"x0000\""); },
     3, "two stations are called 'x0000'"},
    {"one photograph for two stations", "job.toml", [](auto text) { return replaced(text, "x0250_l.png", "x0000_l.png"); }, 3,
     "is named twice"},
    {"photographs of two stations exchanged", "job.toml",
     [](auto text) {
       text = replaced(replaced(text, "cross/x0250_", "cross/tmp_"), "cross/x0750_", "cross/x0250_");
       return replaced(text, "cross/tmp_", "cross/x0750_");
     },
     3, "reading"},
    {"left and right exchanged", "job.toml",
     [](auto text) { return replaced(replaced(replaced(text, "_l.png", "_t.png"), "_r.png", "_l.png"), "_t.png", "_r.png"); },
     3, "left and right photographs are swapped"},
    {"a camera that is not the head's", "job.toml",
     [](auto text) {
       return replaced(text, "cross = { left = \"cross/x0250_l.png\"", "cross = { middle = \"cross/x0250_l.png\"");
     },
     3, "the head's cameras are left and right"},
    {"the markers of the cross in inches", "cross/tritop.csv", [](auto text) { return scaled_coordinates(text, 1.0 / 25.4); },
     4, "no pose of the head explains its markers"},
    {"the spheres of the cross in inches", "cross/spheres.csv", [](auto text) { return scaled_coordinates(text, 1.0 / 25.4); },
     3, "one of the two is in inches"},
    {"probe hits in inches", "machine/hits.csv", [](auto text) { return scaled_coordinates(text, 1.0 / 25.4); }, 3,
     "one of the two is in inches"},
    {"spheres with each other's ids", "cross/spheres.csv",
     [](auto text) { return replaced(replaced(replaced(text, "\n1,", "\n9,"), "\n2,", "\n1,"), "\n9,", "\n2,"); }, 3,
     "swapped"},
    {"hits in a small cap only", "machine/hits.csv",
     [](auto text) {
       // The pole and the four hits beside it are not on one half of the ball any more: those on the equator are taken away.
       std::string kept = "sphere,x_mm,y_mm,z_mm\n";
       std::map<std::string, int> number;
       for (const std::string_view line : base::split(text, '\n')) {
         const std::string sphere(base::split(line, ',').front());
         if (base::parse_double(sphere) && number[sphere]++ < 3) kept += std::string(line) + "\n";
       }
       return kept;
     },
     4, "sphere 1"},
    {"a stylus of another diameter", "job.toml",
     [](auto text) { return replaced(text, "stylus_diameter_mm = 4", "stylus_diameter_mm = 6"); }, 3, "diameter of the stylus"},
    {"readings in inches", "job.toml",
     [](auto text) {
       std::string result;
       for (const std::string_view line : base::split(text, '\n')) {
         const std::string_view key = "axis_mm = ";
         const auto value = line.starts_with(key) ? base::parse_double(line.substr(key.size())) : std::nullopt;
         result += (value ? fmt::format("{}{}", key, *value / 25.4) : std::string(line)) + "\n";
       }
       return result;
     },
     3, "the readings are in inches"},
    {"all readings equal", "job.toml",
     [](auto text) {
       std::string result;
       for (const std::string_view line : base::split(text, '\n'))
         result += (line.starts_with("axis_mm = ") ? std::string("axis_mm = 250.0") : std::string(line)) + "\n";
       return result;
     },
     3, "one of the readings is wrong"},
    {"a list of markers without sigmas", "cross/tritop.csv",
     [](auto text) {
       std::string result;
       for (const std::string_view line : base::split(text, '\n')) {
         const auto cells = base::split(line, ',');
         if (cells.size() >= 4) result += fmt::format("{},{},{},{}\n", cells[0], cells[1], cells[2], cells[3]);
       }
       return result;
     },
     3, "no sigmas"},
    {"other ids than the cross has", "cross/tritop.csv",
     [](auto text) {
       std::string result;
       for (const std::string_view line : base::split(text, '\n'))
         result += fmt::format("{}{}\n", base::parse_double(line.substr(0, line.find(','))) ? "9" : "", line);
       return result;
     },
     4, "compare the ids"},
};

TEST_F(CommissionJob, BadInputIsRefusedByNameWithItsReason) {
  // A copy whose cameras are calibrated and whose photographs have been looked at already.
  const TemporaryFolder copy;
  fs::copy(job(), copy / "job", fs::copy_options::recursive);
  for (const BadMachine& bad : kBadMachines) {
    const fs::path file = copy / "job" / bad.file;
    const std::string good = read_all(file);
    const std::string changed = bad.change(good);
    ASSERT_NE(changed, good) << bad.name;
    copy.write(fs::path("job") / bad.file, changed);
    const auto run = run_program({"commission", (copy / "job").string(), "--out", (copy / "out").string()});
    EXPECT_EQ(run.exit_code, bad.exit_code) << bad.name << ": " << run.err;
    EXPECT_THAT(run.err, HasSubstr(bad.reason)) << bad.name;
    EXPECT_FALSE(fs::exists(copy / "out")) << bad.name;
    copy.write(fs::path("job") / bad.file, good);
  }
}

TEST_F(CommissionJob, TheGraphIsASnakefileOfItsSteps) {
  const auto run = run_program({"run", job().string(), "--print-graph"});
  ASSERT_EQ(run.exit_code, 0) << run.err;
  for (const char* part : {"rule all:", "rule calibrate:", "\"board/left/01.png\"", "rule stations:", "\"cross/x0250_r.png\"",
                           "rule commission:", "\"results/calibrate.done\"", "\"machine/hits.csv\"", "--to commission"}) {
    EXPECT_THAT(run.out, HasSubstr(part));
  }
  EXPECT_EQ(run_program({"run", job().string(), "--to", "adjust"}).exit_code, 3) << "the job has no network";
  EXPECT_EQ(run_program({"run", job().string(), "--to", "comission"}).exit_code, 2);
}

}  // namespace
}  // namespace crosstie
