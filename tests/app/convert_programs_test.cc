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
#include <nlohmann/json.hpp>

#include "base/calibration_reader.h"
#include "base/camera_file.h"
#include "base/file.h"
#include "base/json_file.h"
#include "base/npy.h"
#include "base/pcd.h"
#include "base/ply.h"
#include "base/point_list.h"
#include "base/result_document.h"
#include "base/text.h"
#include "base/tool_path.h"
#include "tests/app/adjust_sample.h"
#include "tests/app/run_verb.h"
#include "tests/support/colmap.h"
#include "tests/support/rs274.h"
#include "tests/support/synthetic_calibration.h"
#include "tests/support/temporary_folder.h"

namespace crosstie::app {
namespace {

namespace fs = std::filesystem;
using base::LensModel;
using testing::HasSubstr;
using tests::TemporaryFolder;
using tests::write_result;

bool has(const std::string& program) { return std::system(("command -v " + program + " >/dev/null 2>&1").c_str()) == 0; }

/// Runs a command of the shell in a folder; what it printed, with what went wrong.
std::string run(const TemporaryFolder& folder, const std::string& command) {
  const std::string out = (folder / "said").string();
  const int status =
      std::system(("cd '" + folder.path().string() + "' && ( " + command + " ) >'" + out + "' 2>&1 </dev/null").c_str());
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
  const std::array<double, 12> values = {2100.25, 2098.5, 985.125, 612.75, -0.11,  0.09,
                                         4e-4,    -3e-4,  -0.02,   0.003,  -0.004, 0.002};
  for (Eigen::Index i = 0; i < std::min<Eigen::Index>(p.size(), 12); ++i) p[i] = values[static_cast<std::size_t>(i)];
  if (model == LensModel::kOpenCv12) p.tail(4) << 1e-4, -2e-4, 3e-4, -1e-4;
  auto camera = *base::Camera::make(model, 1920, 1200, std::move(p));
  camera.set_valid_region(base::Camera::Region{{100.0, 80.0}, {1800.0, 90.0}, {1790.0, 1100.0}, {110.0, 1090.0}});
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

/// A result of calibrate with a rig, as convert reads it.
base::Calibration write_rig(const fs::path& folder) {
  base::Calibration calibration = tests::synthetic_calibration();
  fs::create_directories(folder);
  const auto json = base::result_json({"calibrate", "rig", {}, {}, {}}, nlohmann::ordered_json::object(),
                                      base::calibration_json(calibration));
  EXPECT_TRUE(base::write_json(folder / "result.json", json));
  EXPECT_TRUE(base::write_covariance(folder, {calibration.covariance, calibration.labels}));
  return calibration;
}

// Both cameras see a point whose place is known: mrcal's rays of our two models, with our extrinsics, must meet there.
TEST(ConvertPrograms, MrcalTriangulatesWithOurRig) {
  const std::string interpreter = python("mrcal");
  if (interpreter.empty()) GTEST_SKIP() << "no mrcal for Python (Debian: mrcal)";
  const TemporaryFolder folder;
  const base::Calibration calibration = write_rig(folder / "calibrate");
  for (const std::string side : {"left", "right"}) {
    ASSERT_EQ(convert({(folder / "calibrate").string(), (folder / (side + ".cameramodel")).string(), "--camera", side}), "");
  }
  const Eigen::Vector3d point(40.0, -25.0, 610.0);
  const auto left = calibration.cameras[0].camera.project(point);
  const auto right = calibration.cameras[1].camera.project(calibration.rig->right_from_left * point);
  ASSERT_TRUE(left && right);
  folder.write("triangulate.py",
               "import mrcal, numpy as np, sys\n"
               "models = [mrcal.cameramodel(name + '.cameramodel') for name in ('left', 'right')]\n"
               "q = np.array([float(word) for word in sys.argv[1:]]).reshape(2, 2)\n"
               "p = mrcal.triangulate(q, models)\n"
               "print(*(f'{1000 * x:.9f}' for x in p))\n");
  const auto rows = numbers_of(run(folder, fmt::format("{} triangulate.py {:.12f} {:.12f} {:.12f} {:.12f}", interpreter,
                                                       left->x(), left->y(), right->x(), right->y())));
  ASSERT_EQ(rows.size(), 1U);
  ASSERT_EQ(rows[0].size(), 3U);
  EXPECT_LT((Eigen::Vector3d(rows[0][0], rows[0][1], rows[0][2]) - point).norm(), 1e-5) << "mm; metres in mrcal's files";
}

TEST(ConvertPrograms, MrcalReadsOurSplinedModel) {
  const std::string interpreter = python("mrcal");
  if (interpreter.empty()) GTEST_SKIP() << "no mrcal for Python (Debian: mrcal)";
  const TemporaryFolder folder;
  const auto model = *base::lens_model_from_name("LENSMODEL_SPLINED_STEREOGRAPHIC_order=3_Nx=12_Ny=9_fov_x_deg=70");
  Eigen::VectorXd p(base::parameter_count(model));
  for (Eigen::Index i = 0; i < p.size(); ++i) p[i] = 0.01 * std::sin(1.7 * static_cast<double>(i));
  p.head(4) << 1500.0, 1499.0, 960.25, 599.5;
  const auto camera = base::Camera::make(model, 1920, 1200, p);
  ASSERT_TRUE(camera);
  ASSERT_TRUE(base::write_cameramodel(folder / "a.cameramodel", *camera));
  ASSERT_EQ(convert({(folder / "a.cameramodel").string(), (folder / "b.cameramodel").string()}), "");
  folder.write("project.py",
               "import mrcal, numpy as np\n"
               "m = mrcal.cameramodel('b.cameramodel')\n"
               "for v in ((0.1, -0.2, 1.0), (-0.4, 0.2, 1.0)):\n"
               "    print(*(f'{x:.12f}' for x in mrcal.project(np.array(v), *m.intrinsics())))\n");
  const auto rows = numbers_of(run(folder, interpreter + " project.py"));
  ASSERT_EQ(rows.size(), 2U);
  const std::array<Eigen::Vector3d, 2> points = {Eigen::Vector3d(0.1, -0.2, 1.0), Eigen::Vector3d(-0.4, 0.2, 1.0)};
  for (std::size_t i = 0; i < 2; ++i) {
    const auto pixel = camera->project(points[i]);
    ASSERT_TRUE(pixel);
    EXPECT_LT((Eigen::Vector2d(rows[i].at(0), rows[i].at(1)) - *pixel).norm(), 1e-6);
  }
}

// OpenCV reads what we write for it and triangulates with it.
TEST(ConvertPrograms, OpenCvReadsOurYamlAndOurStereoPair) {
  const std::string interpreter = python("cv2");
  if (interpreter.empty()) GTEST_SKIP() << "no OpenCV for Python (Debian: python3-opencv)";
  const TemporaryFolder folder;
  const base::Calibration calibration = write_rig(folder / "calibrate");
  ASSERT_EQ(convert({(folder / "calibrate").string(), (folder / "left.yaml").string(), "--camera", "left"}), "");
  ASSERT_EQ(convert({(folder / "calibrate").string(), (folder / "in.yml").string() + "," + (folder / "ex.yml").string()}), "");
  const Eigen::Vector3d point(40.0, -25.0, 610.0);
  folder.write("read.py",
               "import cv2, numpy as np\n"
               "f = cv2.FileStorage('left.yaml', cv2.FILE_STORAGE_READ)\n"
               "k, d = f.getNode('camera_matrix').mat(), f.getNode('distortion_coefficients').mat()\n"
               "p = np.array([[40.0, -25.0, 610.0]])\n"
               "print(*cv2.projectPoints(p, np.zeros(3), np.zeros(3), k, d)[0].ravel())\n"
               "i, e = (cv2.FileStorage(n, cv2.FILE_STORAGE_READ) for n in ('in.yml', 'ex.yml'))\n"
               "r, t = e.getNode('R').mat(), e.getNode('T').mat()\n"
               "print(*cv2.projectPoints(p, cv2.Rodrigues(r)[0], t, i.getNode('M2').mat(), i.getNode('D2').mat())[0].ravel())\n"
               "print(int(f.getNode('image_width').real()), int(f.getNode('image_height').real()))\n");
  const auto rows = numbers_of(run(folder, interpreter + " read.py"));
  ASSERT_EQ(rows.size(), 3U);
  const auto left = calibration.cameras[0].camera.project(point);
  const auto right = calibration.cameras[1].camera.project(calibration.rig->right_from_left * point);
  EXPECT_LT((Eigen::Vector2d(rows[0].at(0), rows[0].at(1)) - *left).norm(), 1e-9);
  EXPECT_LT((Eigen::Vector2d(rows[1].at(0), rows[1].at(1)) - *right).norm(), 1e-9);
  EXPECT_EQ(rows[2], (std::vector<double>{1280, 1024}));
}

/// Points with sigmas of their own; one lies far out and has a large id.
std::string write_list(const TemporaryFolder& folder) {
  return folder
      .write("list.csv",
             "id,x_mm,y_mm,z_mm,sigma_x_mm,sigma_y_mm,sigma_z_mm\n3,1.5,2.25,3,0.02,0.03,0.06\n11,4,5,6123.5,0.03,0.06,0.06\n"
             "16777217,-7,8.125,9,0.12,0.16,0.15\n")
      .string();
}
const std::array<double, 3> kSigmas = {0.07, 0.09, 0.25};  // lengths of (2 3 6), (3 6 6) / 100, (12 16 15) / 100

TEST(ConvertPrograms, CloudCompareShowsOurFields) {
  if (!has("CloudCompare")) GTEST_SKIP() << "no CloudCompare (Debian: cloudcompare)";
  const TemporaryFolder folder;
  ASSERT_EQ(convert({write_list(folder), (folder / "list.ply").string()}), "");
  const auto text = [&] {
    run(folder,
        "QT_QPA_PLATFORM=offscreen HOME=$PWD timeout 60 CloudCompare -SILENT -AUTO_SAVE OFF -O -GLOBAL_SHIFT 0 0 0 list.ply "
        "-C_EXPORT_FMT ASC -PREC 9 -SEP SPACE -ADD_HEADER -SAVE_CLOUDS FILE list.asc");
    return tests::read_all(folder / "list.asc");
  }();
  EXPECT_THAT(text, testing::StartsWith("//X Y Z id sigma_mm"));
  const auto rows = numbers_of(text);
  const auto list = base::read_point_list(folder / "list.csv");
  ASSERT_EQ(rows.size(), 3U) << text;
  for (std::size_t i = 0; i < 3; ++i) {
    ASSERT_EQ(rows[i].size(), 5U);
    EXPECT_EQ(Eigen::Vector3d(rows[i][0], rows[i][1], rows[i][2]), list->points[i].xyz_mm);
    EXPECT_NEAR(rows[i][3], list->points[i].id, 1.0) << "CloudCompare itself holds scalars as floats";
    EXPECT_NEAR(rows[i][4], kSigmas[i], 1e-7);
  }
}

TEST(ConvertPrograms, MeshLabShowsOurSigmas) {
  if (!has("meshlabserver") || !has("xvfb-run"))
    GTEST_SKIP() << "no meshlabserver with a display (Debian: meshlab, xvfb, xauth)";
  const TemporaryFolder folder;
  ASSERT_EQ(convert({write_list(folder), (folder / "list.ply").string()}), "");
  run(folder, "timeout 60 xvfb-run -a meshlabserver -i list.ply -o out.ply -m vq");
  const auto cloud = base::read_ply(folder / "out.ply");
  ASSERT_TRUE(cloud) << cloud.error().message;
  ASSERT_EQ(cloud->points.size(), 3U);
  ASSERT_EQ(cloud->fields.size(), 1U);
  EXPECT_EQ(cloud->fields[0].name, "quality");
  EXPECT_EQ(cloud->points[1], Eigen::Vector3d(4.0, 5.0, 6123.5));
  for (std::size_t i = 0; i < 3; ++i) EXPECT_NEAR(cloud->fields[0].values[i], kSigmas[i], 1e-7);
}

// What the Point Cloud Library makes of our file in each of its formats is the cloud that we wrote.
TEST(ConvertPrograms, PclRewritesOurClouds) {
  if (!has("pcl_convert_pcd_ascii_binary")) GTEST_SKIP() << "no pcl_convert_pcd_ascii_binary (Debian: pcl-tools)";
  const TemporaryFolder folder;
  ASSERT_EQ(convert({write_list(folder), (folder / "ours.pcd").string()}), "");
  const auto ours = base::read_pcd(folder / "ours.pcd");
  ASSERT_TRUE(ours) << ours.error().message;
  EXPECT_EQ(ours->points[1], Eigen::Vector3d(4.0, 5.0, 6123.5));
  for (const auto& [number, name] : {std::pair(0, "ascii"), std::pair(1, "binary"), std::pair(2, "binary_compressed")}) {
    run(folder, fmt::format("pcl_convert_pcd_ascii_binary ours.pcd theirs.pcd {} 9", number));
    EXPECT_THAT(tests::read_all(folder / "theirs.pcd"), HasSubstr(fmt::format("\nDATA {}\n", name)));
    const auto theirs = base::read_pcd(folder / "theirs.pcd");
    ASSERT_TRUE(theirs) << name << ": " << theirs.error().message;
    EXPECT_EQ(theirs->points, ours->points) << name;
    EXPECT_EQ(theirs->cov_mm2.size(), 3U);
    ASSERT_EQ(theirs->fields.size(), 2U);
    EXPECT_EQ(theirs->fields[0].values, ours->fields[0].values);
    for (std::size_t i = 0; i < 3; ++i) EXPECT_NEAR(theirs->fields[1].values[i], ours->fields[1].values[i], 1e-8);
  }
}

TEST(ConvertPrograms, LinuxCncRunsTheProgramOfAPath) {
  if (!tests::has_rs274()) GTEST_SKIP() << "no rs274 (Debian: linuxcnc-uspace)";
  const TemporaryFolder folder;
  base::ToolPath path;
  path.frame = "machine";
  for (int i = 0; i <= 60; ++i) {
    const double phi = 0.1 * i;
    base::ToolPathPoint p;
    p.point_mm = {300.0 * std::cos(phi), 300.0 * std::sin(phi), 950.0 + 2.0 * std::sin(3.0 * phi)};
    p.tangent = {-std::sin(phi), std::cos(phi), 0.0};
    p.speed_mm_per_s = 8.0;
    p.s_mm = 30.0 * i;
    path.points.push_back(p);
  }
  ASSERT_TRUE(base::write_tool_path_json(folder / "path.json", path));
  ASSERT_EQ(convert({(folder / "path.json").string(), (folder / "path.ngc").string(), "--retract-mm", "25"}), "");
  const auto interpreted = tests::run_rs274(tests::read_all(folder / "path.ngc"));
  EXPECT_EQ(interpreted.error, "");
  std::vector<Eigen::Vector3d> feeds;
  for (const auto& command : interpreted.commands) {
    if (command.name == "STRAIGHT_FEED")
      feeds.emplace_back(command.numbers.at(0), command.numbers.at(1), command.numbers.at(2));
    if (command.name == "STRAIGHT_TRAVERSE") {
      EXPECT_NEAR(command.numbers.at(2), 975.0, 2e-4);
    }
  }
  ASSERT_EQ(feeds.size(), path.points.size() + 1);
  for (std::size_t i = 0; i < path.points.size(); ++i) EXPECT_LT((feeds[i] - path.points[i].point_mm).norm(), 2e-4);
}

// COLMAP gives back the same network: its own adjustment leaves ours where it is, and its files become our list again.
TEST(ConvertPrograms, ColmapGivesBackTheSameNetwork) {
  if (!tests::has_colmap()) GTEST_SKIP() << "no colmap";
  const TemporaryFolder folder;
  const base::AdjustedNetwork network = write_result(folder / "adjust");
  for (const std::string format : {"TXT", "BIN"}) {
    const std::string ours = (folder / ("ours" + format)).string();
    const std::string theirs = (folder / ("theirs" + format)).string();
    fs::create_directories(theirs);
    std::vector<std::string> words = {(folder / "adjust").string(), ours};
    if (format == "BIN") words.push_back("--binary");
    ASSERT_EQ(convert(words), "");
    ASSERT_NE(tests::run_colmap(
                  fmt::format("model_converter --input_path {} --output_path {} --output_type {}", ours, theirs, format)),
              "");
    const std::string list = (folder / (format + ".csv")).string();
    ASSERT_EQ(convert({theirs, list}), "");
    const auto points = base::read_point_list(list);
    ASSERT_TRUE(points) << points.error().message;
    ASSERT_EQ(points->points.size(), network.points.size());
    for (std::size_t i = 0; i < network.points.size(); ++i) {
      EXPECT_EQ(points->points[i].id, network.points[i].id);
      EXPECT_LT((points->points[i].xyz_mm - network.points[i].xyz_mm).norm(), 1e-9);
    }
    ASSERT_EQ(convert({theirs, (folder / (format + ".cameramodel")).string()}), "");
    const auto camera = base::read_camera(folder / (format + ".cameramodel"));
    ASSERT_TRUE(camera);
    const auto pixel = camera->project({0.1, 0.2, 1.0});
    EXPECT_LT((*pixel - *network.cameras[0].camera.project({0.1, 0.2, 1.0})).norm(), 1e-9);
    const std::string said = tests::run_colmap(fmt::format("model_analyzer --path {}", theirs));
    EXPECT_THAT(said, HasSubstr("Points: 3\n"));
    EXPECT_THAT(said, HasSubstr("Observations: 6\n"));
  }
}

}  // namespace
}  // namespace crosstie::app
