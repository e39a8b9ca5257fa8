#include "base/colmap_model.h"

#include <filesystem>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/base/colmap_scene.h"
#include "tests/support/colmap.h"
#include "tests/support/temporary_folder.h"

namespace crosstie::base {
namespace {

namespace fs = std::filesystem;
using crosstie::tests::read_all;
using crosstie::tests::TemporaryFolder;
using testing::HasSubstr;

constexpr ColmapFormat kFormats[] = {ColmapFormat::kText, ColmapFormat::kBinary};

void expect_same(const ColmapModel& a, const ColmapModel& b) {
  ASSERT_EQ(a.cameras.size(), b.cameras.size());
  ASSERT_EQ(a.images.size(), b.images.size());
  ASSERT_EQ(a.points.size(), b.points.size());
  for (std::size_t i = 0; i < a.cameras.size(); ++i) {
    EXPECT_EQ(a.cameras[i].id, b.cameras[i].id);
    EXPECT_EQ(a.cameras[i].camera.model(), b.cameras[i].camera.model());
    EXPECT_EQ(a.cameras[i].camera.width_px(), b.cameras[i].camera.width_px());
    EXPECT_EQ(a.cameras[i].camera.height_px(), b.cameras[i].camera.height_px());
    EXPECT_LT((a.cameras[i].camera.parameters() - b.cameras[i].camera.parameters()).cwiseAbs().maxCoeff(), 1e-12);
  }
  for (std::size_t i = 0; i < a.images.size(); ++i) {
    const ColmapImage& left = a.images[i];
    const ColmapImage& right = b.images[i];
    EXPECT_EQ(left.id, right.id);
    EXPECT_EQ(left.name, right.name);
    EXPECT_EQ(left.camera_id, right.camera_id);
    EXPECT_LT((left.camera_from_world.rotation.coeffs() - right.camera_from_world.rotation.coeffs()).norm(), 1e-15);
    EXPECT_EQ(left.camera_from_world.translation_mm, right.camera_from_world.translation_mm);
    ASSERT_EQ(left.points.size(), right.points.size());
    for (std::size_t k = 0; k < left.points.size(); ++k) {
      EXPECT_LT((left.points[k].pixel_px - right.points[k].pixel_px).norm(), 1e-12);
      EXPECT_EQ(left.points[k].point_id, right.points[k].point_id);
    }
  }
  for (std::size_t i = 0; i < a.points.size(); ++i) {
    EXPECT_EQ(a.points[i].id, b.points[i].id);
    EXPECT_EQ(a.points[i].xyz, b.points[i].xyz);
    EXPECT_EQ(a.points[i].rgb, b.points[i].rgb);
    EXPECT_EQ(a.points[i].error_px, b.points[i].error_px);
    ASSERT_EQ(a.points[i].track.size(), b.points[i].track.size());
    for (std::size_t k = 0; k < a.points[i].track.size(); ++k) {
      EXPECT_EQ(a.points[i].track[k].image_id, b.points[i].track[k].image_id);
      EXPECT_EQ(a.points[i].track[k].point_index, b.points[i].track[k].point_index);
    }
  }
}

/// A model as another program writes it: the first image's centre lies in the middle of its principal point.
void write_small_text(const TemporaryFolder& folder, const std::string& camera = "1 SIMPLE_PINHOLE 100 80 90 50 40") {
  folder.write("cameras.txt", "# CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]\n" + camera + "\n");
  folder.write("images.txt",
               "# two lines per image\n# Number of images: 2, mean observations per image: 1\n"
               "2 1 0 0 0 0 0 10 1 second.png\n\n"
               "1 0.70710678118654757 0 0 0.70710678118654757 1 2 3 1 first.png\n0.5 0.5 7 50 40 -1\n");
  folder.write("points3D.txt", "7 1.5 -2 1e1 1 2 255 0.25 1 0\n");
}

TEST(ColmapModel, ReadsTextOfOthersAndShiftsPixels) {
  const TemporaryFolder folder;
  write_small_text(folder);
  const auto model = read_colmap_model(folder.path());
  ASSERT_TRUE(model) << model.error().message;
  // COLMAP's default principal point is the image's centre, (w / 2, h / 2); with the first pixel's centre at 0 it is (w - 1)
  // / 2.
  const auto centred = Camera::nominal(LensModel::kPinhole, 100, 80, 90.0);
  ASSERT_TRUE(centred);
  EXPECT_EQ(model->cameras.at(0).camera.parameters(), centred->parameters());
  ASSERT_EQ(model->images.size(), 2U);
  EXPECT_EQ(model->images[0].name, "first.png");
  EXPECT_EQ(model->images[0].points.at(0).pixel_px, Eigen::Vector2d(0.0, 0.0));
  EXPECT_EQ(model->images[0].points.at(1).pixel_px, Eigen::Vector2d(49.5, 39.5));
  EXPECT_EQ(model->images[0].points.at(0).point_id, 7U);
  EXPECT_FALSE(model->images[0].points.at(1).point_id);
  EXPECT_TRUE(model->images[1].points.empty());
  // A quarter turn about z takes x to y.
  EXPECT_LT((model->images[0].camera_from_world * Eigen::Vector3d(1, 0, 0) - Eigen::Vector3d(1, 3, 3)).norm(), 1e-14);
  EXPECT_EQ(model->points.at(0).xyz, Eigen::Vector3d(1.5, -2.0, 10.0));
}

TEST(ColmapModel, WritesThePixelShift) {
  const TemporaryFolder folder;
  ColmapModel model;
  model.cameras.push_back({1, *Camera::nominal(LensModel::kPinhole, 100, 80, 90.0)});
  ColmapImage image;
  image.id = 1;
  image.name = "a.png";
  image.camera_id = 1;
  image.points.push_back({{0.0, 0.0}, std::nullopt});
  model.images.push_back(image);
  ASSERT_TRUE(write_colmap_model(folder.path(), model, ColmapFormat::kText));
  EXPECT_THAT(read_all(folder / "cameras.txt"), HasSubstr("\n1 PINHOLE 100 80 90 90 50 40\n"));
  EXPECT_THAT(read_all(folder / "images.txt"), HasSubstr("\n1 1 0 0 0 0 0 0 1 a.png\n0.5 0.5 -1\n"));
}

TEST(ColmapModel, EveryLensModelIsTheOneItIsCalled) {
  const struct {
    const char* line;
    LensModel model;
    std::vector<double> parameters;
  } cases[] = {
      {"1 SIMPLE_PINHOLE 100 80 90 50 40", LensModel::kPinhole, {90, 90, 49.5, 39.5}},
      {"1 PINHOLE 100 80 90 91 50 40", LensModel::kPinhole, {90, 91, 49.5, 39.5}},
      {"1 SIMPLE_RADIAL 100 80 90 50 40 0.01", LensModel::kOpenCv4, {90, 90, 49.5, 39.5, 0.01, 0, 0, 0}},
      {"1 RADIAL 100 80 90 50 40 0.01 0.02", LensModel::kOpenCv4, {90, 90, 49.5, 39.5, 0.01, 0.02, 0, 0}},
      {"1 OPENCV 100 80 90 91 50 40 .01 .02 .03 .04", LensModel::kOpenCv4, {90, 91, 49.5, 39.5, .01, .02, .03, .04}},
      {"1 FULL_OPENCV 100 80 90 91 50 40 .01 .02 .03 .04 .05 .06 .07 .08",
       LensModel::kOpenCv8,
       {90, 91, 49.5, 39.5, .01, .02, .03, .04, .05, .06, .07, .08}},
  };
  for (const auto& c : cases) {
    const TemporaryFolder folder;
    write_small_text(folder, c.line);
    const auto model = read_colmap_model(folder.path());
    ASSERT_TRUE(model) << model.error().message;
    EXPECT_EQ(model->cameras[0].camera.model(), c.model) << c.line;
    EXPECT_EQ(model->cameras[0].camera.parameters(),
              Eigen::Map<const Eigen::VectorXd>(c.parameters.data(), static_cast<Eigen::Index>(c.parameters.size())))
        << c.line;
  }
}

TEST(ColmapModel, FiveParameterLensesGoOutAsFullOpenCv) {
  const TemporaryFolder folder;
  ColmapModel model;
  model.cameras.push_back({1, tests::made(LensModel::kOpenCv5, 100, 80, {90, 91, 49.5, 39.5, .01, .02, .003, .004, .05})});
  model.cameras.push_back({2, tests::made(LensModel::kOpenCv12, 100, 80,
                                          {90, 91, 49.5, 39.5, .01, .02, .003, .004, .05, .06, .07, .08, 0, 0, 0, 0})});
  ASSERT_TRUE(write_colmap_model(folder.path(), model, ColmapFormat::kBinary));
  const auto read = read_colmap_model(folder.path());
  ASSERT_TRUE(read) << read.error().message;
  for (std::size_t i = 0; i < 2; ++i) {
    const Eigen::Vector3d point(120.0, -80.0, 400.0);
    EXPECT_LT((*read->cameras[i].camera.project(point) - *model.cameras[i].camera.project(point)).norm(), 1e-12);
  }
  model.cameras[1].camera =
      tests::made(LensModel::kOpenCv12, 100, 80, {90, 91, 49.5, 39.5, .01, .02, .003, .004, .05, .06, .07, .08, 0, 1e-5, 0, 0});
  const auto refused = write_colmap_model(folder.path(), model, ColmapFormat::kBinary);
  ASSERT_FALSE(refused);
  EXPECT_THAT(refused.error().message, HasSubstr("camera 2"));
}

TEST(ColmapModel, RoundTrip) {
  const ColmapModel scene = tests::colmap_scene();
  for (const ColmapFormat format : kFormats) {
    const TemporaryFolder folder;
    const auto written = write_colmap_model(folder.path(), scene, format);
    ASSERT_TRUE(written) << written.error().message;
    EXPECT_EQ(colmap_format_of(folder.path()), format);
    const auto read = read_colmap_model(folder.path());
    ASSERT_TRUE(read) << read.error().message;
    expect_same(*read, scene);
  }
}

TEST(ColmapModel, ColmapItselfReadsWhatIsWrittenAndViceVersa) {
  if (!crosstie::tests::has_colmap()) GTEST_SKIP() << "no colmap here";
  const ColmapModel scene = tests::colmap_scene();
  for (const ColmapFormat format : kFormats) {
    const TemporaryFolder folder;
    fs::create_directories(folder / "ours");
    fs::create_directories(folder / "theirs");
    ASSERT_TRUE(write_colmap_model(folder / "ours", scene, format));
    const std::string said = crosstie::tests::run_colmap("model_converter --input_path '" + (folder / "ours").string() +
                                                         "' --output_path '" + (folder / "theirs").string() +
                                                         "' --output_type " + (format == ColmapFormat::kText ? "BIN" : "TXT"));
    ASSERT_FALSE(said.empty());
    EXPECT_NE(colmap_format_of(folder / "theirs"), format);
    const auto read = read_colmap_model(folder / "theirs");
    ASSERT_TRUE(read) << read.error().message;
    expect_same(*read, scene);
  }
}

TEST(ColmapModel, ColmapProjectsAsWeDo) {
  if (!crosstie::tests::has_colmap()) GTEST_SKIP() << "no colmap here";
  const TemporaryFolder folder;
  fs::create_directories(folder / "in");
  fs::create_directories(folder / "out");
  ASSERT_TRUE(write_colmap_model(folder / "in", tests::colmap_scene(), ColmapFormat::kText));
  const std::string said = crosstie::tests::run_colmap("bundle_adjuster --input_path '" + (folder / "in").string() +
                                                       "' --output_path '" + (folder / "out").string() + "'");
  const std::size_t at = said.find("Initial cost");
  ASSERT_NE(at, std::string::npos) << said;
  EXPECT_LT(std::stod(said.substr(said.find(':', at) + 1)), 1e-6)
      << "px, with exact projections of pinhole, OPENCV, FULL_OPENCV";
}

TEST(ColmapModel, AdjustedNetworksGoOut) {
  AdjustedNetwork network;
  network.cameras.push_back({"left", *Camera::nominal(LensModel::kOpenCv5, 100, 80, 90.0), true});
  AdjustedImage image;
  image.name = "l1";
  image.camera = "left";
  image.network_from_camera = {rotation_exp({0.1, 0.2, 0.3}), {1.0, 2.0, 3.0}};
  network.images = {image};
  AdjustedPoint point;
  point.id = 11;
  point.xyz_mm = {4.0, 5.0, 6.0};
  network.points = {point};
  AdjustedObservation observation;
  observation.measured_px = {20.0, 30.0};
  observation.residual_px = {0.3, 0.4};
  network.residuals = {observation};
  const ColmapModel model = colmap_model_of(network);
  const TemporaryFolder folder;
  ASSERT_TRUE(write_colmap_model(folder.path(), model, ColmapFormat::kBinary));
  const Pose& pose = model.images.at(0).camera_from_world;
  EXPECT_LT((pose * Eigen::Vector3d(1.0, 2.0, 3.0)).norm(), 1e-12) << "the projection centre is the camera's origin";
  EXPECT_EQ(model.images[0].points.at(0).pixel_px, Eigen::Vector2d(20.0, 30.0));
  EXPECT_EQ(model.points.at(0).id, 11U);
  EXPECT_DOUBLE_EQ(model.points[0].error_px, 0.5);
}

}  // namespace
}  // namespace crosstie::base
