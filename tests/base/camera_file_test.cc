#include "base/camera_file.h"

#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/core.hpp>

#include "tests/support/temporary_folder.h"

namespace crosstie::base {
namespace {

using testing::HasSubstr;
using tests::TemporaryFolder;

Camera camera_of(LensModel model) {
  Eigen::VectorXd p(parameter_count(model));
  for (int i = 0; i < p.size(); ++i) p[i] = i < 4 ? 1000.0 / (i + 3) : 0.01 / (i + 3) * (i % 2 == 0 ? 1 : -1);
  return *Camera::make(model, 1920, 1200, p);
}

constexpr const char* kCameramodel = R"(# a comment before
{
    'lensmodel': 'LENSMODEL_OPENCV4',   # and one behind
    # intrinsics are fx,fy,cx,cy,distortion0,distortion1,....
    'intrinsics': [ 1761.181055, 1761.250444, 1965.706996, 1087.518797, -0.01266096516, 0.03590794372, -2.547e-05, 0.0005275,],
    'valid_intrinsics_region': [ [ 501, 246 ], [ 501, 983 ], ],
    "extrinsics": (2e-2, -3e-1, -1e-2, 1., 2, -3.,),
    'imagersize': [ 4000, 2200,],
    'icam_intrinsics': 0,
    'nothing': None,
    # The optimization inputs contain all the data used to compute this model.
    'optimization_inputs': b'P7x\'V:A2\\nRk0~g"(',
}
)";

TEST(CameraFile, ReadsAModelAsMrcalWritesIt) {
  const TemporaryFolder folder;
  const auto camera = read_camera(folder.write("a.cameramodel", kCameramodel));
  ASSERT_TRUE(camera) << camera.error().message;
  EXPECT_EQ(camera->model(), LensModel::kOpenCv4);
  EXPECT_EQ(camera->width_px(), 4000);
  EXPECT_EQ(camera->height_px(), 2200);
  EXPECT_EQ(camera->parameters()[1], 1761.250444);
  EXPECT_EQ(camera->parameters()[7], 0.0005275);
}

TEST(CameraFile, ValidRegionAndCovarianceAreKept) {
  const TemporaryFolder folder;
  Camera camera = camera_of(*LensModel::splined({3, 5, 4, 80}));
  EXPECT_FALSE(camera.valid_region_px());
  camera.set_valid_region(Camera::Region{{10.1, 20}, {1800, 30.3}, {1700, 1100}});
  Eigen::MatrixXd root = Eigen::MatrixXd::Identity(44, 44);
  for (int i = 0; i < 44 * 44; ++i) root(i % 44, i / 44) += 0.3 * std::sin(i);
  camera.set_covariance(root * root.transpose());
  ASSERT_TRUE(write_cameramodel(folder / "a.cameramodel", camera));
  const auto again = read_camera(folder / "a.cameramodel");
  ASSERT_TRUE(again) << again.error().message;
  EXPECT_EQ(again->model(), camera.model());
  EXPECT_EQ(again->parameters(), camera.parameters());
  EXPECT_EQ(again->valid_region_px(), camera.valid_region_px());
  EXPECT_EQ(again->covariance(), Eigen::MatrixXd(camera.covariance().selfadjointView<Eigen::Upper>()));

  camera.set_valid_region(Camera::Region{});
  ASSERT_TRUE(write_cameramodel(folder / "b.cameramodel", camera));
  EXPECT_EQ(read_camera(folder / "b.cameramodel")->valid_region_px(), Camera::Region{});
  EXPECT_FALSE(write_opencv_yaml(folder / "b.yaml", camera));
}

TEST(CameraFile, CameramodelKeepsEveryBit) {
  const TemporaryFolder folder;
  for (const LensModel model :
       {LensModel::kPinhole, LensModel::kOpenCv4, LensModel::kOpenCv5, LensModel::kOpenCv8, LensModel::kOpenCv12}) {
    const Camera camera = camera_of(model);
    ASSERT_TRUE(write_cameramodel(folder / "a.cameramodel", camera));
    const auto again = read_camera(folder / "a.cameramodel");
    ASSERT_TRUE(again) << again.error().message;
    EXPECT_EQ(again->model(), model);
    EXPECT_EQ(again->parameters(), camera.parameters());
    EXPECT_EQ(again->height_px(), 1200);
  }
}

TEST(CameraFile, OpenCvReadsOurYamlAndWeReadOpenCvs) {
  const TemporaryFolder folder;
  for (const LensModel model :
       {LensModel::kPinhole, LensModel::kOpenCv4, LensModel::kOpenCv5, LensModel::kOpenCv8, LensModel::kOpenCv12}) {
    const Camera camera = camera_of(model);
    const auto path = folder / "ours.yml";
    ASSERT_TRUE(write_opencv_yaml(path, camera));
    cv::Mat matrix, k;
    int width = 0;
    cv::FileStorage ours(path.string(), cv::FileStorage::READ);
    ours["camera_matrix"] >> matrix;
    ours["distortion_coefficients"] >> k;
    ours["image_width"] >> width;
    EXPECT_EQ(width, 1920);
    EXPECT_EQ(matrix.at<double>(0, 0), camera.parameters()[0]);
    EXPECT_EQ(matrix.at<double>(1, 2), camera.parameters()[3]);
    for (int i = 4; i < camera.parameters().size(); ++i) EXPECT_EQ(k.at<double>(i - 4), camera.parameters()[i]);

    {
      cv::FileStorage theirs((folder / "theirs.yml").string(), cv::FileStorage::WRITE);
      theirs << "calibration_time"
             << "Mon 12:00:00"
             << "image_width" << 1920 << "image_height" << 1200 << "flags" << 0 << "fisheye_model" << 0;
      theirs << "camera_matrix" << matrix << "distortion_coefficients" << k.t() << "avg_reprojection_error" << 0.2;
      theirs << "image_points" << std::vector<cv::Point2f>{{1, 2}, {3, 4}};
    }
    const auto again = read_camera(folder / "theirs.yml");
    ASSERT_TRUE(again) << again.error().message;
    EXPECT_EQ(again->height_px(), 1200);
    EXPECT_LT((again->parameters().head(camera.parameters().size()) - camera.parameters()).norm(), 1e-12);
    EXPECT_EQ(again->model(), model == LensModel::kPinhole ? LensModel::kOpenCv4 : model);
  }
}

std::string yaml(const std::string& matrix_data, const std::string& distortion, const std::string& extra = "") {
  return "%YAML:1.0\n---\nimage_width: 640\nimage_height: 480\n" + extra +
         "camera_matrix: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n   data: [ " + matrix_data +
         " ]\ndistortion_coefficients: !!opencv-matrix\n" + distortion;
}

TEST(CameraFile, RefusesWithAReason) {
  const std::string good_k = "   rows: 1\n   cols: 5\n   dt: d\n   data: [ 0.1, 0.2,\n       0., 0., 0.3 ]\n";
  const std::string good_matrix = "500, 0, 320, 0, 500, 240, 0, 0, 1";
  const TemporaryFolder folder;
  ASSERT_TRUE(read_camera(folder.write("good.yml", yaml(good_matrix, good_k))));
  const auto cameramodel = [](const std::string& lens, const std::string& intrinsics, const std::string& size) {
    return "{'lensmodel': " + lens + ",\n'intrinsics': " + intrinsics + ",\n'imagersize': " + size + "}\n";
  };
  const std::string four = "[500, 500, 320, 240]";
  const std::pair<std::string, const char*> cases[] = {
      {yaml("500, 1, 320, 0, 500, 240, 0, 0, 1", good_k), "skew"},
      {yaml("-500, 0, 320, 0, 500, 240, 0, 0, 1", good_k), "not positive"},
      {yaml("500, 0, 320, 0, 500, 240, 0, 0", good_k), "does not hold as many values"},
      {yaml("500, 0, 320, 0, .Nan, 240, 0, 0, 1", good_k), "c.yml:9: \".Nan\" is no finite number"},
      {yaml(good_matrix, "   rows: 1\n   cols: 6\n   dt: d\n   data: [ 1, 2, 3, 4, 5, 6 ]\n"), "6 distortion coefficients"},
      {yaml(good_matrix, "   rows: 1\n   cols: 14\n   dt: d\n   data: [ 1, 2, 3, 4, 5, 6, 7, 8, 9, 1, 2, 3, 0.1, 0 ]\n"),
       "tilted"},
      {yaml(good_matrix, "   rows: 100000\n   cols: 100000\n   dt: d\n   data: [ 1 ]\n"), "implausible"},
      {yaml(good_matrix, good_k, "fisheye_model: 1\n"), "fisheye"},
      {yaml(good_matrix, good_k, "distortion_model: equidistant\n"), "equidistant"},
      {yaml(good_matrix, good_k, "image_width: 640\n"), "occurs twice"},
      {"camera_matrix: 5\n", "no camera file"},
      {"hello\n", "c.yml:1"},
      {cameramodel("'LENSMODEL_SPLINED_STEREOGRAPHIC_order=3_Nx=30_Ny=20_fov_x_deg=150'", four, "[640, 480]"),
       "LENSMODEL_SPLINED"},
      {cameramodel("'LENSMODEL_SPLINED_STEREOGRAPHIC_order=7_Nx=30_Ny=20_fov_x_deg=150'", four, "[640, 480]"), "is not read"},
      {cameramodel("'LENSMODEL_PINHOLE'", four, "[640, 480], 'valid_intrinsics_region': [[1, 2], [3]]"),
       "valid_intrinsics_region"},
      {cameramodel("'LENSMODEL_PINHOLE'", four, "[640, 480], 'valid_intrinsics_region': 7"), "valid_intrinsics_region"},
      {cameramodel("'LENSMODEL_PINHOLE'", four, "[640, 480], 'intrinsics_covariance': [1, 2, 3]"), "upper triangle"},
      {cameramodel("'LENSMODEL_PINHOLE'", four, "[640, 480], 'intrinsics_covariance': [1,2,0,0,1,0,0,1,0,1]"),
       "upper triangle"},
      {cameramodel("'LENSMODEL_PINHOLE'", four, "[640, 480], 'intrinsics_covariance': [-1,0,0,0,1,0,0,1,0,1]"),
       "upper triangle"},
      {cameramodel("'LENSMODEL_PINHOLE'", "[500, 500, 320]", "[640, 480]"), "has 4 parameters, 3 were given"},
      {cameramodel("'LENSMODEL_PINHOLE'", "[500, 500, 320, nan]", "[640, 480]"), "c.yml:2: \"nan\" is no finite number"},
      {cameramodel("'LENSMODEL_PINHOLE'", "[500, 500, 320, '240']", "[640, 480]"), "intrinsics"},
      {cameramodel("'LENSMODEL_PINHOLE'", four, "[640]"), "imagersize"},
      {cameramodel("'LENSMODEL_PINHOLE'", four, "[640, -480]"), "image size"},
      {cameramodel("'LENSMODEL_PINHOLE'", four, "[640, 480.5]"), "image size"},
      {cameramodel("'LENSMODEL_PINHOLE'", four, "[1e9, 1e9]"), "image size"},
      {cameramodel("LENSMODEL_PINHOLE", four, "[640, 480]"), "c.yml:1"},
      {"{'intrinsics': [1, 2, 3, 4], 'imagersize': [640, 480]}", "lensmodel is missing"},
      {"{'lensmodel': 'LENSMODEL_PINHOLE', 'lensmodel': 'x'}", "occurs twice"},
      {"{'a': __import__('os')}", "c.yml:1"},
      {std::string(kCameramodel) + "x", "something follows"},
      {"{'a': " + std::string(1000, '[') + std::string(1000, ']') + "}", "nested too deeply"},
      {"{'a': 1 'b': 2}", "comma"},
  };
  for (const auto& [text, message] : cases) {
    const auto camera = read_camera(folder.write("c.yml", text));
    ASSERT_FALSE(camera) << text;
    EXPECT_EQ(camera.error().code, ErrorCode::kBadInput);
    EXPECT_THAT(camera.error().message, HasSubstr(message)) << text.substr(0, 500);
  }
}

}  // namespace
}  // namespace crosstie::base
