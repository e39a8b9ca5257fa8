#include <filesystem>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "base/camera_file.h"
#include "base/colmap_model.h"
#include "base/json_file.h"
#include "base/ply.h"
#include "base/point_list.h"
#include "base/result_document.h"
#include "tests/app/run_verb.h"
#include "tests/support/temporary_folder.h"

namespace crosstie::app {
namespace {

namespace fs = std::filesystem;
using base::ErrorCode;
using testing::HasSubstr;
using tests::TemporaryFolder;

/// Nothing where it went well.
std::optional<base::Error> convert(std::vector<std::string> words) {
  words.insert(words.begin(), "convert");
  return tests::run_verb(words).error;
}

std::string message(const std::vector<std::string>& words) {
  const auto error = convert(words);
  return error ? error->message : "";
}

/// A folder as `adjust` leaves it: two photographs of three points.
base::AdjustedNetwork write_result(const fs::path& folder) {
  fs::create_directories(folder);
  base::AdjustedNetwork network;
  network.cameras = {{"left", *base::Camera::nominal(base::LensModel::kOpenCv5, 2000, 1333, 2100.0), true}};
  for (const int id : {3, 11, 52}) {
    base::AdjustedPoint point;
    point.id = id;
    point.xyz_mm = Eigen::Vector3d(100.0 / id, 200.0 / 3.0, id);
    point.cov_mm2 = Eigen::Vector3d(1e-6, 4e-6, 9e-6).asDiagonal();
    network.points.push_back(point);
  }
  for (const char* name : {"a", "b"}) {
    base::AdjustedImage image;
    image.name = name;
    image.camera = "left";
    image.network_from_camera = {base::rotation_exp({0.1, -0.2, name[0] - 97.0}), {10.0, 20.0, -1500.0}};
    for (int i = 0; i < 3; ++i) {
      base::AdjustedObservation observation;
      observation.image = static_cast<int>(network.images.size());
      observation.point = i;
      const auto pixel = network.cameras[0].camera.project(image.network_from_camera.inverse() *
                                                           network.points[static_cast<std::size_t>(i)].xyz_mm);
      EXPECT_TRUE(pixel);
      observation.measured_px = *pixel;
      network.residuals.push_back(observation);
    }
    network.images.push_back(image);
  }
  const auto result = base::result_json({"adjust", "network", {}, {}, {}}, {}, base::network_json(network));
  EXPECT_TRUE(base::write_json(folder / "result.json", result));
  EXPECT_TRUE(base::write_residuals(folder / "residuals.csv", network));
  return network;
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
  EXPECT_EQ(convert({csv, (folder / "b.obc").string(), "--binary"})->code, ErrorCode::kUsage);
  EXPECT_EQ(convert({csv, (folder / "b.obc").string(), "--unit", "yard"})->code, ErrorCode::kUsage);
  EXPECT_EQ(convert({(folder / "absent.csv").string(), (folder / "b.obc").string()})->code, ErrorCode::kFileSystem);
  EXPECT_EQ(convert({folder.write("bad.csv", "id,x_mm,y_mm,z_mm\n1,2,3\n").string(), (folder / "b.obc").string()})->code,
            ErrorCode::kBadInput);
  EXPECT_FALSE(fs::exists(folder / "b.obc"));
}

}  // namespace
}  // namespace crosstie::app
