// What convert writes, as the programs of others read it; a program that is not here skips its test (./run exchange installs them all).

#include <array>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <numbers>
#include <sstream>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <Eigen/Geometry>

#include "base/camera_file.h"
#include "base/file.h"
#include "base/kalibr.h"
#include "base/ply.h"
#include "base/pcd.h"
#include "base/point_list.h"
#include "base/text.h"
#include "base/tool_path.h"
#include "tests/app/run_verb.h"
#include "tests/support/rs274.h"
#include "tests/support/synthetic_calibration.h"
#include "tests/support/temporary_folder.h"

namespace crosstie::app {
namespace {

namespace fs = std::filesystem;
using base::LensModel;
using testing::HasSubstr;
using tests::TemporaryFolder;

bool has(const std::string& program) { return std::system(("command -v " + program + " >/dev/null 2>&1").c_str()) == 0; }

/// Runs a command of the shell in a folder; what it printed, with what went wrong.
std::string run(const TemporaryFolder& folder, const std::string& command) {
  const std::string out = (folder / "said").string();
  const int status = std::system(("cd '" + folder.path().string() + "' && ( " + command + " ) >'" + out + "' 2>&1 </dev/null").c_str());
  std::string text = tests::read_all(out);
  EXPECT_EQ(status, 0) << command << "\n" << text;
  return text;
}

/// Debian's Python has the packages of Debian's programs, whatever another one on the path has.
std::string python(const std::string& module) {
  for (const char* candidate : {"/usr/bin/python3", "python3"}) {
    if (std::system(fmt::format("{} -c 'import {}' >/dev/null 2>&1", candidate, module).c_str()) == 0) return candidate;
  }
  return "";
}

std::string convert(std::vector<std::string> words) {
  words.insert(words.begin(), "convert");
  const auto answer = tests::run_verb(words);
  return answer.error ? answer.error->message : "";
}

/// All numbers of a text, line by line; comments aside.
std::vector<std::vector<double>> numbers_of(const std::string& text) {
  std::vector<std::vector<double>> rows;
  for (const auto line : base::split(text, '\n')) {
    if (line.empty() || line.starts_with('#') || line.starts_with('/')) continue;
    std::vector<double> row;
    for (const auto word : base::split(line, ' ')) {
      if (const auto number = base::parse_double(word)) row.push_back(*number);
    }
    if (!row.empty()) rows.push_back(std::move(row));
  }
  return rows;
}

base::Camera distorted(LensModel model) {
  Eigen::VectorXd p = Eigen::VectorXd::Zero(base::parameter_count(model));
  const std::array<double, 12> values = {2100.25, 2098.5, 985.125, 612.75, -0.11, 0.09, 4e-4, -3e-4, -0.02, 0.003, -0.004, 0.002};
  for (Eigen::Index i = 0; i < std::min<Eigen::Index>(p.size(), 12); ++i) p[i] = values[static_cast<std::size_t>(i)];
  if (model == LensModel::kOpenCv12) p.tail(4) << 1e-4, -2e-4, 3e-4, -1e-4;
  auto camera = *base::Camera::make(model, 1920, 1200, std::move(p));
  camera.set_valid_region({{100.0, 80.0}, {1800.0, 90.0}, {1790.0, 1100.0}, {110.0, 1090.0}});
  return camera;
}

const std::vector<Eigen::Vector3d> kDirections = {{0, 0, 1}, {0.2, -0.1, 1}, {-0.35, 0.2, 1}, {0.3, 0.22, 1}, {0.1, 0.25, 1}};

// mrcal maps pixels of our model to those of a pinhole camera that is written by hand here: f x / z + c is all that the truth needs.
TEST(ConvertPrograms, MrcalReprojectsWithOurLenses) {
  if (!has("mrcal-reproject-points")) GTEST_SKIP() << "no mrcal-reproject-points (Debian: mrcal)";
  for (const LensModel model : {LensModel::kOpenCv4, LensModel::kOpenCv5, LensModel::kOpenCv8, LensModel::kOpenCv12}) {
    const TemporaryFolder folder;
    ASSERT_TRUE(base::write_opencv_yaml(folder / "ours.yaml", distorted(model)));
    ASSERT_EQ(convert({(folder / "ours.yaml").string(), (folder / "ours.cameramodel").string()}), "");
    folder.write("flat.cameramodel",
                 "{ 'lensmodel': 'LENSMODEL_PINHOLE', 'intrinsics': [1000.0, 1000.0, 500.0, 400.0],"
                 " 'extrinsics': [0,0,0,0,0,0], 'imagersize': [1001, 801] }\n");
    std::string pixels = "# x y\n";
    for (const Eigen::Vector3d& direction : kDirections) {
      const auto pixel = distorted(model).project(direction);
      ASSERT_TRUE(pixel);
      pixels += fmt::format("{:.12f} {:.12f}\n", pixel->x(), pixel->y());
    }
    folder.write("pixels", pixels);
    const auto rows = numbers_of(run(folder, "mrcal-reproject-points ours.cameramodel flat.cameramodel <pixels"));
    ASSERT_EQ(rows.size(), kDirections.size());
    for (std::size_t i = 0; i < rows.size(); ++i) {
      EXPECT_NEAR(rows[i].at(0), 1000.0 * kDirections[i].x() + 500.0, 1e-3);
      EXPECT_NEAR(rows[i].at(1), 1000.0 * kDirections[i].y() + 400.0, 1e-3);
    }
  }
}

TEST(ConvertPrograms, MrcalKnowsOurValidRegion) {
  if (!has("mrcal-is-within-valid-intrinsics-region")) GTEST_SKIP() << "no mrcal tools (Debian: mrcal)";
  const TemporaryFolder folder;
  ASSERT_TRUE(base::write_cameramodel(folder / "a.cameramodel", distorted(LensModel::kOpenCv5)));
  ASSERT_EQ(convert({(folder / "a.cameramodel").string(), (folder / "b.cameramodel").string()}), "");
  folder.write("pixels", "# x y\n90 600\n110 600\n960 1085\n960 1110\n");
  const auto rows = numbers_of(run(folder, "mrcal-is-within-valid-intrinsics-region --cols-xy x y b.cameramodel <pixels"));
  ASSERT_EQ(rows.size(), 4U);
  EXPECT_THAT((std::array{rows[0].back(), rows[1].back(), rows[2].back(), rows[3].back()}), testing::ElementsAre(0, 1, 1, 0));
}

/// A result of calibrate with a rig, written where `convert` reads it.
base::Calibration write_rig(const fs::path& folder) {
  base::Calibration calibration = tests::synthetic_calibration();
  EXPECT_TRUE(tests::write_calibration(folder, calibration));
  return calibration;
}

}  // namespace
}  // namespace crosstie::app
