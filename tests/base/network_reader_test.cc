#include "base/network_reader.h"

#include <filesystem>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "base/json_file.h"
#include "base/result_document.h"
#include "tests/support/temporary_folder.h"

namespace crosstie::base {
namespace {

using crosstie::tests::TemporaryFolder;
using testing::HasSubstr;

AdjustedNetwork small_network() {
  AdjustedNetwork network;
  network.datum = "inner constraints";
  network.scale = "scale bars";
  network.sigma0 = 0.98;
  network.observations = 2;
  AdjustedCamera camera{"left", *Camera::nominal(LensModel::kOpenCv5, 2000, 1333, 2100.0), true};
  camera.camera.set_covariance(Eigen::MatrixXd::Identity(9, 9) * 0.04);
  network.cameras = {camera};
  for (const char* name : {"a", "b"}) {
    AdjustedImage image;
    image.name = name;
    image.camera = "left";
    image.network_from_camera = {rotation_exp({0.1, -0.2, name[0] - 95.0}), {10.0, 20.0, -1500.0}};
    image.cov(0, 5) = image.cov(5, 0) = 1e-7;
    network.images.push_back(image);
  }
  for (const int id : {3, 11, 52}) {
    AdjustedPoint point;
    point.id = id;
    point.xyz_mm = Eigen::Vector3d(1.0 / id, 2.0, id);
    point.cov_mm2 = Eigen::Vector3d(1e-6, 4e-6, 9e-6).asDiagonal();
    point.cov_mm2(0, 2) = point.cov_mm2(2, 0) = 1e-7;
    network.points.push_back(point);
  }
  AdjustedObservation observation;
  observation.image = 1;
  observation.point = 2;
  observation.measured_px = {1000.1, 700.2};
  observation.residual_px = {0.01, -0.02};
  observation.sigma_px = {0.02, 0.03};
  observation.redundancy = {0.8, 0.9};
  observation.w = 0.7;
  network.residuals = {observation};
  return network;
}

void write(const TemporaryFolder& folder, const AdjustedNetwork& network) {
  const nlohmann::ordered_json result = result_json({"adjust", "network", {}, {}, {}}, {}, network_json(network));
  ASSERT_TRUE(write_json(folder / "result.json", result));
  ASSERT_TRUE(write_residuals(folder / "residuals.csv", network));
}

TEST(NetworkReader, ReadsBackWhatAdjustWrites) {
  const TemporaryFolder folder;
  const AdjustedNetwork network = small_network();
  write(folder, network);
  const auto read = read_adjusted_network(folder.path());
  ASSERT_TRUE(read) << read.error().message;
  EXPECT_EQ(read->datum, network.datum);
  EXPECT_EQ(read->sigma0, network.sigma0);
  ASSERT_EQ(read->cameras.size(), 1U);
  EXPECT_EQ(read->cameras[0].camera.parameters(), network.cameras[0].camera.parameters());
  EXPECT_EQ(read->cameras[0].camera.covariance(), network.cameras[0].camera.covariance());
  ASSERT_EQ(read->images.size(), 2U);
  EXPECT_LT(difference(read->images[1].network_from_camera, network.images[1].network_from_camera).norm(), 1e-12);
  EXPECT_EQ(read->images[1].cov, network.images[1].cov);
  ASSERT_EQ(read->points.size(), 3U);
  EXPECT_EQ(read->points[2].id, 52);
  EXPECT_EQ(read->points[2].xyz_mm, network.points[2].xyz_mm);
  EXPECT_EQ(read->points[2].cov_mm2, network.points[2].cov_mm2);
  ASSERT_EQ(read->residuals.size(), 1U);
  EXPECT_EQ(read->residuals[0].image, 1);
  EXPECT_EQ(read->residuals[0].point, 2);
  EXPECT_EQ(read->residuals[0].measured_px, network.residuals[0].measured_px);
  EXPECT_EQ(read->residuals[0].redundancy, network.residuals[0].redundancy);
}

TEST(NetworkReader, DamageIsAnErrorThatNamesTheFile) {
  const auto json_with = [](auto change) {
    const TemporaryFolder folder;
    write(folder, small_network());
    auto json = *read_json(folder / "result.json");
    change(json);
    EXPECT_TRUE(write_json(folder / "result.json", json));
    const auto read = read_adjusted_network(folder.path());
    EXPECT_FALSE(read);
    return read ? std::string() : read.error().message;
  };
  using Json = nlohmann::ordered_json;
  EXPECT_THAT(json_with([](Json& j) { j["verb"] = "detect"; }), HasSubstr("result.json: not the result of adjust"));
  EXPECT_THAT(json_with([](Json& j) { j.erase("points"); }), HasSubstr("result.json: "));
  EXPECT_THAT(json_with([](Json& j) { j["points"][0]["xyz_mm"] = {1, 2}; }), HasSubstr("3 numbers"));
  EXPECT_THAT(json_with([](Json& j) { j["points"][0]["xyz_mm"][1] = nullptr; }), HasSubstr("result.json: "));
  EXPECT_THAT(json_with([](Json& j) { j["points"][0]["id"] = "three"; }), HasSubstr("result.json: "));
  EXPECT_THAT(json_with([](Json& j) { j["images"][0]["camera"] = "right"; }), HasSubstr("unknown camera right"));
  EXPECT_THAT(json_with([](Json& j) { j["images"][0]["network_from_camera"][0] = 2.0; }), HasSubstr("result.json: "));
  EXPECT_THAT(json_with([](Json& j) { j["cameras"][0]["model"] = "LENSMODEL_FISHEYE"; }), HasSubstr("lens model"));
  EXPECT_THAT(json_with([](Json& j) { j = Json::array(); }), HasSubstr("result.json: "));

  const TemporaryFolder folder;
  write(folder, small_network());
  const std::string header =
      "image,id,x_px,y_px,residual_x_px,residual_y_px,sigma_x_px,sigma_y_px,redundancy_x,redundancy_y,w\n";
  for (const std::string& contents : {header + "b,4,1,2,0,0,1,1,0,0,0\n", header + "c,3,1,2,0,0,1,1,0,0,0\n",
                                      header + "b,3,1,x,0,0,1,1,0,0,0\n", std::string("image,id\nb,3\n")}) {
    folder.write("residuals.csv", contents);
    const auto read = read_adjusted_network(folder.path());
    ASSERT_FALSE(read) << contents;
    EXPECT_THAT(read.error().message, HasSubstr("residuals.csv:"));
  }
  std::filesystem::remove(folder / "residuals.csv");
  EXPECT_FALSE(read_adjusted_network(folder.path()));
}

}  // namespace
}  // namespace crosstie::base
