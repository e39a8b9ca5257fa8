#include <cstring>
#include <filesystem>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "base/camera_file.h"
#include "base/colmap_model.h"
#include "base/json_file.h"
#include "base/kalibr.h"
#include "base/npy.h"
#include "base/opencv_stereo.h"
#include "base/pcd.h"
#include "base/ply.h"
#include "base/point_list.h"
#include "base/result_document.h"
#include "base/table.h"
#include "base/tool_path.h"
#include "tests/app/adjust_sample.h"
#include "tests/app/run_verb.h"
#include "tests/support/synthetic_calibration.h"
#include "tests/support/temporary_folder.h"

namespace crosstie::app {
namespace {

namespace fs = std::filesystem;
using base::ErrorCode;
using testing::HasSubstr;
using tests::TemporaryFolder;
using tests::write_result;

/// Nothing where it went well.
std::optional<base::Error> convert(std::vector<std::string> words) {
  words.insert(words.begin(), "convert");
  return tests::run_verb(words).error;
}

std::string message(const std::vector<std::string>& words) {
  const auto error = convert(words);
  return error ? error->message : "";
}

TEST(Convert, AdjustResultsBecomeColmapModelsAndThoseLists) {
  for (const bool binary : {false, true}) {
    const TemporaryFolder folder;
    const base::AdjustedNetwork network = write_result(folder / "adjust");
    const std::string model_folder = (folder / "model").string();
    std::vector<std::string> words = {(folder / "adjust").string(), model_folder};
    if (binary) words.push_back("--binary");
    ASSERT_EQ(message(words), "");
    EXPECT_EQ(base::colmap_format_of(model_folder), binary ? base::ColmapFormat::kBinary : base::ColmapFormat::kText);
    const auto model = base::read_colmap_model(model_folder);
    ASSERT_TRUE(model) << model.error().message;
    // Every image point is where its camera, pose and 3D point say.
    for (const base::ColmapImage& image : model->images) {
      ASSERT_EQ(image.points.size(), 3U);
      for (std::size_t i = 0; i < 3; ++i) {
        const auto pixel = model->cameras[0].camera.project(image.camera_from_world * model->points[i].xyz);
        EXPECT_LT((*pixel - image.points[i].pixel_px).norm(), 1e-9);
      }
    }
    ASSERT_EQ(message({model_folder, (folder / "back.csv").string()}), "");
    const auto list = base::read_point_list(folder / "back.csv");
    ASSERT_TRUE(list);
    ASSERT_EQ(list->points.size(), 3U);
    for (std::size_t i = 0; i < 3; ++i) {
      EXPECT_EQ(list->points[i].id, network.points[i].id);
      EXPECT_EQ(list->points[i].xyz_mm, network.points[i].xyz_mm);
    }
    ASSERT_EQ(message({model_folder, (folder / "metres.csv").string(), "--unit", "m"}), "");
    EXPECT_EQ(base::read_point_list(folder / "metres.csv")->points[2].xyz_mm, network.points[2].xyz_mm * 1000.0);
  }
}

TEST(Convert, PointsKeepTheirSigmas) {
  const TemporaryFolder folder;
  const base::AdjustedNetwork network = write_result(folder / "adjust");
  const std::string csv = (folder / "a.csv").string();
  const std::string obc = (folder / "a.obc").string();
  const std::string again = (folder / "again.csv").string();
  const std::string ply = (folder / "a.ply").string();
  ASSERT_EQ(message({(folder / "adjust/result.json").string(), csv}), "");
  ASSERT_EQ(message({csv, obc}), "");
  ASSERT_EQ(message({obc, again}), "");
  ASSERT_EQ(message({obc, ply}), "");
  const std::string text = (folder / "a.txt").string();
  ASSERT_EQ(message({csv, text}), "");
  EXPECT_THAT(tests::read_all(text), testing::StartsWith("id x_mm y_mm z_mm cov_xx_mm2 "));
  EXPECT_EQ(base::read_point_list(text)->points[2].cov_mm2, network.points[2].cov_mm2);
  const auto list = base::read_point_list(again);
  ASSERT_TRUE(list) << list.error().message;
  ASSERT_EQ(list->points.size(), 3U);
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_LT((list->points[i].xyz_mm - network.points[i].xyz_mm).norm(), 1e-8);
    EXPECT_LT((*list->points[i].cov_mm2 - network.points[i].cov_mm2).norm(), 1e-11);
  }
  const auto cloud = base::read_ply(ply);
  ASSERT_TRUE(cloud) << cloud.error().message;
  EXPECT_EQ(cloud->cov_mm2.size(), 3U);
  ASSERT_EQ(cloud->fields.size(), 2U);
  EXPECT_EQ(cloud->fields[0].values, (std::vector<double>{3, 11, 52}));
}

TEST(Convert, CamerasChangeTheirFile) {
  const TemporaryFolder folder;
  const auto camera = base::Camera::nominal(base::LensModel::kOpenCv8, 2000, 1333, 2100.0 / 7.0);
  ASSERT_TRUE(base::write_cameramodel(folder / "a.cameramodel", *camera));
  ASSERT_EQ(message({(folder / "a.cameramodel").string(), (folder / "a.yaml").string()}), "");
  ASSERT_EQ(message({(folder / "a.yaml").string(), (folder / "b.cameramodel").string()}), "");
  EXPECT_EQ(tests::read_all(folder / "b.cameramodel"), tests::read_all(folder / "a.cameramodel"));
}

/// A calibration of two cameras on a rig, in the folder `calibrate`.
base::Calibration write_rig(const TemporaryFolder& folder, base::LensModel model) {
  base::Calibration calibration = tests::synthetic_calibration();
  for (base::CalibratedCamera& one : calibration.cameras) {
    const Eigen::VectorXd p = one.camera.parameters().head(base::parameter_count(model));
    one.camera = *base::Camera::make(model, 1280, 1024, p);
    one.significance_p.conservativeResize(p.size());
  }
  if (model != base::LensModel::kOpenCv5) {
    calibration.covariance.resize(0, 0);
    calibration.labels.clear();
  }
  fs::create_directories(folder / "calibrate");
  EXPECT_TRUE(base::write_json(folder / "calibrate/result.json",
                               base::result_json({"calibrate", "rig", {}, {}, {}}, nlohmann::ordered_json::object(),
                                                 base::calibration_json(calibration))));
  EXPECT_TRUE(base::write_covariance(folder / "calibrate", {calibration.covariance, calibration.labels}));
  return calibration;
}

TEST(Convert, ARigBecomesAStereoPair) {
  const TemporaryFolder folder;
  const base::Calibration calibration = write_rig(folder, base::LensModel::kOpenCv5);
  const std::string in = (folder / "calibrate").string();
  ASSERT_EQ(message({in, (folder / "i.yml").string() + "," + (folder / "e.yml").string()}), "");
  const auto head = base::read_opencv_stereo(folder / "i.yml", folder / "e.yml", 1280, 1024);
  ASSERT_TRUE(head) << head.error().message;
  EXPECT_EQ(head->left.parameters(), calibration.cameras[0].camera.parameters());
  EXPECT_EQ(head->right.parameters(), calibration.cameras[1].camera.parameters());
  EXPECT_LT(base::difference(head->right_from_left, calibration.rig->right_from_left).norm(), 1e-12);
  EXPECT_THAT(message({in, (folder / "c.yaml").string()}), HasSubstr("--camera is one of left, right"));
  EXPECT_THAT(message({in, (folder / "c.yaml").string(), "--camera", "middle"}), HasSubstr("--camera is one of left, right"));
  ASSERT_EQ(message({in, (folder / "right.cameramodel").string(), "--camera", "right"}), "");
  EXPECT_EQ(base::read_camera(folder / "right.cameramodel")->parameters(), calibration.cameras[1].camera.parameters());
  EXPECT_EQ(base::read_camera(folder / "right.cameramodel")->covariance(), calibration.cameras[1].camera.covariance());
  EXPECT_THAT(tests::read_all(folder / "right.cameramodel"), HasSubstr("-0.1193"));
  // kalibr has four coefficients.
  EXPECT_THAT(message({in, (folder / "chain.yaml").string(), "--kalibr"}), HasSubstr("camera left is LENSMODEL_OPENCV5"));
  EXPECT_FALSE(fs::exists(folder / "chain.yaml"));
}

TEST(Convert, ARigBecomesAChainOfKalibrAndComesBack) {
  const TemporaryFolder folder;
  base::KalibrCamera left{"left", *base::Camera::nominal(base::LensModel::kOpenCv4, 1280, 1024, 1053.2), {}};
  base::KalibrCamera right = left;
  right.camera_from_previous = base::Pose{base::rotation_exp({0.01, -0.12, 0.3}), {-119.3, 0.8, 9.1}};
  ASSERT_TRUE(base::write_kalibr_chain(folder / "a.yaml", {left, right}));
  const std::string pair = (folder / "i.yml").string() + "," + (folder / "e.yml").string();
  ASSERT_EQ(message({(folder / "a.yaml").string(), pair}), "");
  const auto head = base::read_opencv_stereo(folder / "i.yml", folder / "e.yml", 1280, 1024);
  ASSERT_TRUE(head);
  EXPECT_LT(base::difference(head->right_from_left, *right.camera_from_previous).norm(), 1e-10);
  ASSERT_EQ(message({(folder / "a.yaml").string(), (folder / "b.yaml").string(), "--kalibr"}), "");
  const auto chain = base::read_kalibr_chain(folder / "b.yaml");
  ASSERT_TRUE(chain) << chain.error().message;
  ASSERT_EQ(chain->size(), 2U);
  EXPECT_EQ(chain->at(1).camera.parameters().head(4), right.camera.parameters().head(4));
  EXPECT_LT(base::difference(*chain->at(1).camera_from_previous, *right.camera_from_previous).norm(), 1e-10);
  EXPECT_THAT(tests::read_all(folder / "a.yaml"), HasSubstr("cam1:\n  T_cn_cnm1:\n"));
}

TEST(Convert, CloudsChangeTheirFile) {
  const TemporaryFolder folder;
  base::Cloud cloud;
  cloud.frame = "machine";
  cloud.points = {{1.0 / 3.0, 2.0, 3.0}, {-4.5, 0.25, 6000.0 + 1.0 / 7.0}};
  cloud.normals = {{0.0, 0.0, -1.0}, {0.0, 1.0, 0.0}};
  cloud.fields = {{"sigma_mm", {0.5, 0.25}}, {"station", {7.0, 8.0}}};
  ASSERT_TRUE(base::write_ply(folder / "a.ply", cloud));
  const auto in = [&](const char* name) { return (folder / name).string(); };
  ASSERT_EQ(message({in("a.ply"), in("b.ply")}), "");
  EXPECT_EQ(tests::read_all(folder / "b.ply"), tests::read_all(folder / "a.ply"));
  ASSERT_EQ(message({in("a.ply"), in("a.pcd")}), "");
  ASSERT_EQ(message({in("a.ply"), in("single.ply"), "--single"}), "");
  ASSERT_EQ(message({in("a.pcd"), in("c.ply"), "--single"}), "");
  EXPECT_EQ(tests::read_all(folder / "c.ply"), tests::read_all(folder / "single.ply")) << "both are floats";
  ASSERT_EQ(message({in("a.ply"), in("a.csv")}), "");
  const auto table = base::read_table(folder / "a.csv");
  ASSERT_TRUE(table);
  EXPECT_THAT(table->columns, testing::ElementsAre("x_mm", "y_mm", "z_mm", "nx", "ny", "nz", "sigma_mm", "station"));
  EXPECT_EQ(*table->number(1, 2), 6000.0 + 1.0 / 7.0) << "to the last digit";
  EXPECT_THAT(message({in("a.ply"), in("a.obc")}), HasSubstr("no ids"));
  ASSERT_EQ(message({in("a.ply"), in("m.csv"), "--unit", "m"}), "");
  EXPECT_EQ(*base::read_table(folder / "m.csv")->number(0, 1), 2000.0);
}

// A file of another program: an organised cloud with a hole, a colour and a histogram; and compressed as PCL compresses.
TEST(Convert, PcdFilesOfOthersAreRead) {
  const TemporaryFolder folder;
  const std::string head =
      "VERSION .7\nFIELDS x y z rgb id histogram\nSIZE 4 4 8 4 2 4\nTYPE F F F F U F\nCOUNT 1 1 1 1 1 2\nWIDTH 3\nHEIGHT "
      "1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS 3\nDATA ascii\n";
  folder.write("a.pcd", head + "1.5 2 3 4.2e-38 9 0 1\nnan nan nan 0 0 0 0\n4 5 6.25 1e-38 11 2 3\n");
  ASSERT_EQ(message({(folder / "a.pcd").string(), (folder / "a.csv").string()}), "");
  EXPECT_EQ(tests::read_all(folder / "a.csv"), "id,x_mm,y_mm,z_mm\n9,1.5,2,3\n11,4,5,6.25\n");
  // Two points of three floats, field by field: 1 1 | 2 2 | 3 3. Each number as it is, then 4 bytes once more from 4 back.
  std::string packed, expanded;
  for (const float v : {1.0F, 2.0F, 3.0F}) {
    char bytes[4];
    std::memcpy(bytes, &v, 4);
    packed += std::string(1, 3) + std::string(bytes, 4) + std::string(1, static_cast<char>(2 << 5)) + std::string(1, 3);
  }
  const auto u32 = [](std::uint32_t v) {
    char bytes[4];
    std::memcpy(bytes, &v, 4);
    return std::string(bytes, 4);
  };
  const std::string header =
      "FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 2\nHEIGHT 1\nPOINTS 2\nDATA binary_compressed\n";
  folder.write("b.pcd", header + u32(static_cast<std::uint32_t>(packed.size())) + u32(24) + packed);
  const auto cloud = base::read_pcd(folder / "b.pcd");
  ASSERT_TRUE(cloud) << cloud.error().message;
  EXPECT_EQ(cloud->points, (std::vector<Eigen::Vector3d>(2, {1.0, 2.0, 3.0})));
  // Counts are held against the size before anything is allocated.
  for (const std::string layout : {"ascii", "binary", "binary_compressed"}) {
    const std::string big =
        "FIELDS x y z\nSIZE 8 8 8\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 4000000000\nHEIGHT 1\nDATA " + layout + "\n";
    const auto refused = base::read_pcd(folder.write("big.pcd", big + std::string(64, '1')));
    ASSERT_FALSE(refused) << layout;
    EXPECT_EQ(refused.error().code, ErrorCode::kBadInput);
  }
  folder.write("filled.pcd",
               header + u32(static_cast<std::uint32_t>(packed.size())) + u32(24) + packed + std::string(100, '\0'));
  EXPECT_TRUE(base::read_pcd(folder / "filled.pcd")) << "PCL fills up to a page";
  folder.write("c.pcd", header + u32(static_cast<std::uint32_t>(packed.size())) + u32(24) + std::string(1, 3) + packed);
  EXPECT_FALSE(base::read_pcd(folder / "c.pcd"));
}

TEST(Convert, APathBecomesWhatMachinesRead) {
  const TemporaryFolder folder;
  base::ToolPath path;
  path.frame = "machine";
  path.gaps = {{2.0, 3.0, "a magnet"}};
  for (int i = 0; i < 5; ++i) {
    base::ToolPathPoint p;
    p.s_mm = i;
    p.point_mm = {i / 3.0, 10.0, 20.0};
    p.speed_mm_per_s = 8.0;
    p.sigma_torch_rad = {1e-3, 2e-3};
    p.source = i == 2 ? base::PathSource::kNominal : base::PathSource::kMeasured;
    path.points.push_back(p);
  }
  ASSERT_TRUE(base::write_tool_path_json(folder / "path.json", path));
  const auto read = base::read_tool_path_json(folder / "path.json");
  ASSERT_TRUE(read) << read.error().message;
  ASSERT_TRUE(base::write_tool_path_json(folder / "again.json", *read));
  EXPECT_EQ(tests::read_all(folder / "again.json"), tests::read_all(folder / "path.json"));
  const std::string json = (folder / "path.json").string();
  for (const std::string ending : {".csv", ".dxf", ".ngc"})
    ASSERT_EQ(message({json, (folder / ("p" + ending)).string()}), "") << ending;
  ASSERT_TRUE(base::write_tool_path_csv(folder / "truth.csv", path));
  ASSERT_TRUE(base::write_tool_path_dxf(folder / "truth.dxf", path));
  EXPECT_EQ(tests::read_all(folder / "p.csv"), tests::read_all(folder / "truth.csv"));
  EXPECT_EQ(tests::read_all(folder / "p.dxf"), tests::read_all(folder / "truth.dxf"));
  EXPECT_THAT(tests::read_all(folder / "p.ngc"), HasSubstr("G21"));
  const std::string mine = folder.write("mine", "G21\n{begin points}\nMOVE {x}\n{end points}\n").string();
  ASSERT_EQ(message({json, (folder / "mine.ngc").string(), "--template", mine}), "");
  EXPECT_THAT(tests::read_all(folder / "mine.ngc"), testing::StartsWith("G21\nMOVE 0.333"));
  EXPECT_THAT(message({json, (folder / "p.ply").string()}), HasSubstr("possible: "));
}

TEST(Convert, NothingIsOverwrittenInSilence) {
  const TemporaryFolder folder;
  write_result(folder / "adjust");
  const std::string adjust = (folder / "adjust").string();
  folder.write("a.csv", "mine");
  folder.write("mine/notes.txt", "mine");
  const std::string csv = (folder / "a.csv").string();
  const std::string model = (folder / "model").string();
  EXPECT_THAT(message({adjust, csv}), HasSubstr("--force"));
  EXPECT_EQ(tests::read_all(folder / "a.csv"), "mine");
  EXPECT_EQ(message({adjust, csv, "--force"}), "");
  ASSERT_EQ(message({adjust, model}), "");
  EXPECT_THAT(message({adjust, model, "--binary"}), HasSubstr("--force"));
  EXPECT_EQ(message({adjust, model, "--binary", "--force"}), "");
  EXPECT_EQ(base::colmap_format_of(model), base::ColmapFormat::kBinary);
  EXPECT_FALSE(fs::exists(folder / "model/cameras.txt")) << "the new model replaces the old one whole";
  // Folders of other things are not replaced, whatever is said.
  EXPECT_THAT(message({adjust, (folder / "mine").string(), "--force"}), HasSubstr("other files"));
  EXPECT_THAT(message({model, adjust, "--force"}), HasSubstr("other files"));
  EXPECT_EQ(tests::read_all(folder / "mine/notes.txt"), "mine");
  EXPECT_TRUE(fs::exists(folder / "adjust/result.json"));
}

TEST(Convert, SaysWhatIsPossible) {
  const TemporaryFolder folder;
  const std::string csv = folder.write("a.csv", "id,x_mm,y_mm,z_mm\n1,2,3,4\n").string();
  const std::string stl = folder.write("a.stl", "solid").string();
  fs::create_directories(folder / "empty");
  const std::vector<std::vector<std::string>> cases = {{csv, (folder / "b.cameramodel").string()},
                                                       {csv, (folder / "model").string()},
                                                       {csv, (folder / "b.step").string()},
                                                       {stl, (folder / "b.csv").string()},
                                                       {(folder / "empty").string(), (folder / "b.csv").string()}};
  for (const auto& words : cases) {
    const auto error = convert(words);
    ASSERT_TRUE(error) << words[1];
    EXPECT_EQ(error->code, ErrorCode::kUsage) << error->message;
    EXPECT_THAT(error->message, HasSubstr("possible: "));
    EXPECT_EQ(error->message.find('\n'), std::string::npos);
  }
  for (const char* option : {"--binary", "--single", "--kalibr"}) {
    EXPECT_EQ(convert({csv, (folder / "b.obc").string(), option})->code, ErrorCode::kUsage) << option;
  }
  EXPECT_EQ(convert({csv, (folder / "b.ngc").string()})->code, ErrorCode::kUsage);
  EXPECT_EQ(convert({csv, (folder / "b.yml").string() + "," + (folder / "c.yml").string()})->code, ErrorCode::kUsage);
  EXPECT_EQ(convert({csv, (folder / "b.obc").string(), "--unit", "yard"})->code, ErrorCode::kUsage);
  EXPECT_EQ(convert({(folder / "absent.csv").string(), (folder / "b.obc").string()})->code, ErrorCode::kFileSystem);
  EXPECT_EQ(convert({folder.write("bad.csv", "id,x_mm,y_mm,z_mm\n1,2,3\n").string(), (folder / "b.obc").string()})->code,
            ErrorCode::kBadInput);
  EXPECT_FALSE(fs::exists(folder / "b.obc"));
}

}  // namespace
}  // namespace crosstie::app
