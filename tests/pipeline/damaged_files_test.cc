// Every verb with every file that it reads, damaged: the right exit code, one line that names the file, nothing half-written, in
// bounded time and memory. How each reader takes each kind of damage is told by tests/damage; here the program is held to it.

#include <sys/stat.h>

#include <algorithm>
#include <functional>
#include <map>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/camera_file.h"
#include "base/colmap_model.h"
#include "tests/base/colmap_scene.h"
#include "tests/pipeline/synthetic_job.h"
#include "tests/support/damage.h"
#include "tests/support/program.h"

namespace crosstie {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;
using tests::Fate;
using tests::read_all;
using tests::TemporaryFolder;

/// A call of the program with the file that is damaged; FOLDER stands for the folder that `make` fills.
struct Call {
  std::string name;
  std::function<bool(const TemporaryFolder&)> make;
  std::vector<std::string> words;
  std::string file;
  std::string out;  ///< what must not be there after a refusal
  int missing = 5;  ///< exit code where there is no such file
};

void PrintTo(const Call& call, std::ostream* out) { *out << call.name; }

const std::string kPoints =
    "id,x_mm,y_mm,z_mm,sigma_x_mm,sigma_y_mm,sigma_z_mm\n1,0,0,0,0.01,0.01,0.01\n2,500,0,0,0.01,0.01,0.01\n"
    "3,0,400,0,0.01,0.01,0.01\n4,10,20,300,0.01,0.01,0.01\n";

tests::SyntheticNetwork pinhole_network() {
  auto synthetic = tests::make_synthetic({.focal_error = 0.0, .model = base::LensModel::kPinhole});
  Eigen::VectorXd parameters = synthetic.cameras[0].parameters();
  parameters(1) = parameters(0);
  synthetic.cameras[0] = *base::Camera::make(base::LensModel::kPinhole, 2000, 1333, parameters);
  tests::project_all(synthetic, 0.02);
  return synthetic;
}

bool make_aicon(const TemporaryFolder& folder) {
  tests::write_aicon_project(folder, pinhole_network());
  folder.write("sigmas.csv", "image,id,sigma_mm\n3,17,0.0025\n4,17,0.001\n");
  folder.write("excluded.csv", "image,id\n3,18\n4,18\n");
  return true;
}

/// A job that reads every file a job may name, but control.
bool make_job(const TemporaryFolder& folder) {
  const auto synthetic = tests::make_synthetic({});
  folder.write("datum.csv", fmt::format("id,x_mm,y_mm,z_mm,axes\n10,0,0,0,xyz\n15,{},0,0,yz\n34,0,360,0,z\n", 450));
  if (!base::write_cameramodel(folder / "start.cameramodel", synthetic.network.cameras[0].camera)) return false;
  return tests::write_synthetic_job(
      folder, synthetic,
      {.camera = "model = \"start.cameramodel\"\n", .network = "scale_bars = \"bars.csv\"\ndatum = \"datum.csv\"\n"});
}

bool make_control_job(const TemporaryFolder& folder) {
  const auto synthetic = tests::make_synthetic({});
  std::string rows = "id,x_mm,y_mm,z_mm,sigma_x_mm,sigma_y_mm,sigma_z_mm\n";
  for (const std::size_t i : {0U, 5U, 24U, 29U}) {
    const auto& at = synthetic.points[i];
    rows += fmt::format("{},{},{},{},0.01,0.01,0.01\n", synthetic.ids[i], at.x(), at.y(), at.z());
  }
  folder.write("control.csv", rows);
  return tests::write_synthetic_job(folder, synthetic, {.network = "control = \"control.csv\"\n"});
}

bool make_points(const TemporaryFolder& folder) {
  folder.write("measured.csv", kPoints);
  folder.write("reference.csv", kPoints);
  return true;
}

bool make_camera(const TemporaryFolder& folder) {
  const auto camera = base::Camera::nominal(base::LensModel::kOpenCv5, 640, 480, 800.0);
  return base::write_cameramodel(folder / "camera.cameramodel", *camera) &&
         base::write_opencv_yaml(folder / "camera.yaml", *camera);
}

bool make_ply_source(const TemporaryFolder& folder) {
  folder.write("list.obc", "  17 1.25 2.5 3.5 fix fix fix 12 0\n  2 4.5 5.5 6.5 0.1 0.2 0.3 12 0\n");
  return make_points(folder);
}

template <base::ColmapFormat kFormat>
bool make_colmap(const TemporaryFolder& folder) {
  return base::write_colmap_model(folder / "model", base::tests::colmap_scene(), kFormat).has_value() ||
         (fs::create_directory(folder / "model") &&
          base::write_colmap_model(folder / "model", base::tests::colmap_scene(), kFormat).has_value());
}

bool make_scene(const TemporaryFolder& folder) {
  folder.write("scene.toml", R"(format = "crosstie-scene/1"
name = "plate"
family = "ring10"
[[camera]]
name = "left"
size_px = [64, 48]
parameters = [90, 90, 31.5, 23.5, 0, 0, 0, 0, 0]
[[body]]
name = "plate"
[[body.box]]
centre_mm = [0, 0, -5]
size_mm = [300, 300, 8]
[[body.plate]]
id = 7
centre_mm = [0, 0, 0]
dot_radius_mm = 5
[[view]]
name = "left_a"
position_mm = [0, -300, 700]
)");
  return true;
}

std::vector<Call> calls() {
  std::vector<Call> all;
  const std::vector<std::string> aicon = {"adjust", "--aicon", "FOLDER", "--out", "FOLDER/out"};
  for (const char* file : {"p.phc", "p.obc", "p.ior", "p.eor", "p.scale"}) {
    all.push_back({std::string("adjust AICON ") + file, make_aicon, aicon, file, "out", 3});  // a project without its file
  }
  for (const auto& [option, file] : {std::pair{"--sigma-override", "sigmas.csv"}, std::pair{"--exclude", "excluded.csv"}}) {
    auto words = aicon;
    words.insert(words.end(), {option, std::string("FOLDER/") + file});
    all.push_back({std::string("adjust AICON ") + option, make_aicon, words, file, "out"});
  }
  for (const char* file : {"job.toml", "bars.csv", "datum.csv", "start.cameramodel"}) {
    all.push_back({std::string("adjust JOB ") + file, make_job, {"adjust", "FOLDER"}, file, "results/adjust"});
  }
  all.push_back({"adjust JOB control", make_control_job, {"adjust", "FOLDER"}, "control.csv", "results/adjust"});
  for (const char* file : {"measured.csv", "reference.csv"}) {
    all.push_back({std::string("verify ") + file,
                   make_points,
                   {"verify", "--points", "FOLDER/measured.csv", "--reference", "FOLDER/reference.csv", "--out", "FOLDER/out"},
                   file,
                   "out"});
  }
  all.push_back(
      {"convert points", make_points, {"convert", "FOLDER/measured.csv", "FOLDER/new.obc"}, "measured.csv", "new.obc"});
  all.push_back(
      {"convert object list", make_ply_source, {"convert", "FOLDER/list.obc", "FOLDER/new.ply"}, "list.obc", "new.ply"});
  all.push_back({"convert cameramodel",
                 make_camera,
                 {"convert", "FOLDER/camera.cameramodel", "FOLDER/new.yaml"},
                 "camera.cameramodel",
                 "new.yaml"});
  all.push_back({"convert yaml",
                 make_camera,
                 {"convert", "FOLDER/camera.yaml", "FOLDER/new.cameramodel"},
                 "camera.yaml",
                 "new.cameramodel"});
  for (const char* name : {"cameras", "images", "points3D"}) {
    const std::vector<std::string> words = {"convert", "FOLDER/model", "FOLDER/new.csv"};
    all.push_back({std::string("convert COLMAP text ") + name, make_colmap<base::ColmapFormat::kText>, words,
                   std::string("model/") + name + ".txt", "new.csv", 2});  // a folder that is no model
    all.push_back({std::string("convert COLMAP binary ") + name, make_colmap<base::ColmapFormat::kBinary>, words,
                   std::string("model/") + name + ".bin", "new.csv", 2});
  }
  all.push_back({"simulate",
                 make_scene,
                 {"simulate", "--scene", "FOLDER/scene.toml", "--out", "FOLDER/out"},
                 "scene.toml",
                 "out/job.toml"});
  return all;
}

std::vector<std::string> words_of(const Call& call, const fs::path& folder) {
  std::vector<std::string> words = call.words;
  for (std::string& word : words) {
    if (word.starts_with("FOLDER")) word = folder.string() + word.substr(6);
  }
  return words;
}

/// All files below a folder; links are not followed.
std::vector<std::string> files_below(const fs::path& folder) {
  std::vector<std::string> files;
  for (const auto& entry : fs::directory_iterator(folder)) {
    files.push_back(entry.path().string());
    if (!fs::is_directory(entry.symlink_status())) continue;
    const auto deeper = files_below(entry.path());
    files.insert(files.end(), deeper.begin(), deeper.end());
  }
  std::sort(files.begin(), files.end());
  return files;
}

class DamagedFiles : public testing::TestWithParam<Call> {
 protected:
  void SetUp() override { ASSERT_TRUE(GetParam().make(folder_)); }
  ~DamagedFiles() override { RecordProperty("cases", cases_); }

  fs::path file() const { return folder_ / GetParam().file; }

  void expect_refused(const std::string& what, const std::vector<int>& exit_codes) {
    SCOPED_TRACE(GetParam().name + ": " + what);
    ++cases_;
    const auto before = files_below(folder_.path());
    const auto run = tests::run_bounded(words_of(GetParam(), folder_.path()));
    EXPECT_THAT(exit_codes, testing::Contains(run.exit_code)) << run.err;
    const std::size_t at = run.err.rfind("crosstie: ");
    ASSERT_NE(at, std::string::npos) << run.err;
    const std::string message = run.err.substr(at);
    EXPECT_EQ(std::count(message.begin(), message.end(), '\n'), 1) << message;
    EXPECT_THAT(message, testing::AnyOf(HasSubstr(file().string()), HasSubstr(file().parent_path().string() + ": "),
                                        HasSubstr(file().parent_path().string() + " is")));
    EXPECT_LT(message.size(), 700U) << message.substr(0, 2000);
    EXPECT_EQ(files_below(folder_.path()), before) << "left behind";
    EXPECT_FALSE(fs::exists(folder_ / GetParam().out));
  }

  TemporaryFolder folder_;
  int cases_ = 0;
};

TEST_P(DamagedFiles, AreRefused) {
  const std::string good = read_all(file());
  ASSERT_FALSE(good.empty());
  folder_.write(file(), "");
  expect_refused("empty", {3});
  folder_.write(file(), good.substr(0, good.size() / 2 + 1) + "\"\x01(");
  expect_refused("cut, with rubbish at the end", {3});
  for (const tests::Damage& damage : tests::something_else()) {
    if (damage.bytes.size() > 1'000'000 && damage.bytes[0] != 'a' && damage.bytes[0] != '[') continue;
    folder_.write(file(), damage.bytes);
    expect_refused(damage.name, {3});
  }
  fs::remove(file());
  expect_refused("missing", {GetParam().missing});
  fs::create_directory(file());
  expect_refused("folder", {5, GetParam().words[0] == "convert" ? 2 : 5});
  fs::remove(file());
  ASSERT_EQ(mkfifo(file().c_str(), 0600), 0);
  expect_refused("fifo", {5});
  fs::remove(file());
  fs::create_symlink(file().filename(), file());
  expect_refused("loop", {5, GetParam().missing});
  fs::remove(file());
  fs::create_symlink("/dev/zero", file());
  expect_refused("device", {5});
  fs::remove(file());

  folder_.write(file(), good);
  const auto run = tests::run_bounded(words_of(GetParam(), folder_.path()));
  EXPECT_EQ(run.exit_code, 0) << run.err;
  EXPECT_TRUE(fs::exists(folder_ / GetParam().out));
}

std::string test_name(const testing::TestParamInfo<Call>& info) {
  std::string name = info.param.name;
  std::replace_if(
      name.begin(), name.end(), [](unsigned char c) { return std::isalnum(c) == 0; }, '_');
  return name;
}

INSTANTIATE_TEST_SUITE_P(Program, DamagedFiles, testing::ValuesIn(calls()), test_name);

/// Where results cannot be written.
class UnwritableResult : public testing::Test {
 protected:
  void SetUp() override { ASSERT_TRUE(make_points(folder_)); }

  tests::ProgramRun verify_into(const std::string& out, const std::string& before = "") const {
    return tests::run_bounded({"verify", "--points", (folder_ / "measured.csv").string(), "--reference",
                               (folder_ / "reference.csv").string(), "--out", out},
                              before);
  }
  void expect_failed(const tests::ProgramRun& run, const std::string& word) const {
    EXPECT_EQ(run.exit_code, 5) << run.err;
    EXPECT_THAT(run.err, HasSubstr(word));
    EXPECT_EQ(std::count(run.err.begin(), run.err.end(), '\n'), 1) << run.err;
    EXPECT_THAT(files_below(folder_.path()), testing::SizeIs(2)) << "left behind";
  }

  TemporaryFolder folder_;
};

TEST_F(UnwritableResult, Places) {
  expect_failed(verify_into((folder_ / "measured.csv").string()), "measured.csv is a file");
  expect_failed(verify_into((folder_ / "measured.csv/out").string()), "measured.csv");
  expect_failed(verify_into("/dev/full"), "/dev/full");
  expect_failed(verify_into("/proc/out"), "/proc");
  expect_failed(verify_into((folder_ / std::string(300, 'n')).string()), "File name too long");
}

TEST_F(UnwritableResult, AFileSizeLimit) { expect_failed(verify_into((folder_ / "out").string(), "ulimit -f 1; "), "out"); }

TEST_F(UnwritableResult, TooFewFileHandles) {
  // Those that the caller left open are closed first, so that the number left is the same wherever the test runs.
  expect_failed(
      verify_into((folder_ / "out").string(), "sh -c 'exec 3>&- 4>&- 5>&- 6>&- 7>&- 8>&- 9>&-; ulimit -n 4; exec \"$@\"' sh "),
      "Too many open files");
}

TEST_F(UnwritableResult, OddNamesAreNoHindrance) {
  for (const std::string name : {"with blank", "\xC3\xBC\xE4\xBD\xA0", "new\nline", "it's {0} %s"}) {
    const auto run = verify_into((folder_ / name / "out").string());
    EXPECT_EQ(run.exit_code, 0) << run.err;
    EXPECT_TRUE(fs::exists(folder_ / name / "out/result.json"));
  }
}

TEST_F(UnwritableResult, AFullStandardOutput) {
  for (const char* words : {" --help", " verify --help", " --version"}) {
    const int status = std::system((std::string("'" CROSSTIE_EXECUTABLE "'") + words + " >/dev/full 2>/dev/null").c_str());
    EXPECT_EQ(WEXITSTATUS(status), 5) << words;
  }
}

}  // namespace
}  // namespace crosstie
