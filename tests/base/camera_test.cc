#include "base/camera.h"

#include <random>
#include <vector>

#include <gtest/gtest.h>
#include <opencv2/calib3d.hpp>

namespace crosstie::base {
namespace {

constexpr LensModel kModels[] = {LensModel::kPinhole, LensModel::kOpenCv4, LensModel::kOpenCv5, LensModel::kOpenCv8,
                                 LensModel::kOpenCv12};

/// A lens of 4000 x 3000 px with ordinary coefficients, all of them present in the largest model.
Camera ordinary(LensModel model) {
  Eigen::VectorXd all(16);
  all << 3900.0, 3905.0, 2010.3, 1480.7, -0.12, 0.09, 3e-4, -2e-4, -0.02, 0.03, -0.01, 0.004, 2e-4, -1e-4, -3e-4, 1e-4;
  auto camera = Camera::make(model, 4000, 3000, all.head(parameter_count(model)));
  EXPECT_TRUE(camera) << camera.error().message;
  return *camera;
}

Camera five(double focal_px, int width, int height, double k1, double k2, double k3) {
  Eigen::VectorXd p(9);
  p << focal_px, focal_px, 0.5 * (width - 1), 0.5 * (height - 1), k1, k2, 0.0, 0.0, k3;
  return *Camera::make(LensModel::kOpenCv5, width, height, p);
}

cv::Mat opencv_matrix(const Camera& camera) {
  const Eigen::VectorXd& p = camera.parameters();
  return (cv::Mat_<double>(3, 3) << p[0], 0, p[2], 0, p[1], p[3], 0, 0, 1);
}
cv::Mat opencv_distortion(const Camera& camera) {
  const Eigen::VectorXd& p = camera.parameters();
  cv::Mat k = cv::Mat::zeros(std::max(4, static_cast<int>(p.size()) - 4), 1, CV_64F);
  for (int i = 4; i < p.size(); ++i) k.at<double>(i - 4) = p[i];
  return k;
}

Eigen::Vector2d opencv_project(const Camera& camera, const Eigen::Vector3d& p) {
  const std::vector<cv::Point3d> points = {{p.x(), p.y(), p.z()}};
  std::vector<cv::Point2d> pixels;
  cv::projectPoints(points, cv::Vec3d(0, 0, 0), cv::Vec3d(0, 0, 0), opencv_matrix(camera), opencv_distortion(camera), pixels);
  return {pixels[0].x, pixels[0].y};
}

std::vector<Eigen::Vector3d> points_in_view(const Camera& camera, int count, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  std::vector<Eigen::Vector3d> points;
  for (int i = 0; i < count; ++i) {
    const double z = 1000.0 + 900.0 * unit(random);
    points.emplace_back(z * 0.5 * camera.width_px() / camera.parameters()[0] * unit(random),
                        z * 0.5 * camera.height_px() / camera.parameters()[1] * unit(random), z);
  }
  return points;
}

TEST(Camera, ProjectsAsOpenCvDoes) {
  for (const LensModel model : kModels) {
    const Camera camera = ordinary(model);
    for (const Eigen::Vector3d& p : points_in_view(camera, 200, 7)) {
      const auto pixel = camera.project(p);
      ASSERT_TRUE(pixel) << lens_model_name(model);
      EXPECT_LT((*pixel - opencv_project(camera, p)).norm(), 1e-9) << lens_model_name(model);
    }
  }
}

TEST(Camera, DerivativesAreThoseOfDifferences) {
  for (const LensModel model : kModels) {
    const Camera camera = ordinary(model);
    for (const Eigen::Vector3d& p : points_in_view(camera, 50, 8)) {
      Eigen::Matrix<double, 2, 3> d_point;
      ProjectionParameterJacobian d_parameters;
      ASSERT_TRUE(camera.project(p, &d_point, &d_parameters));
      for (int i = 0; i < 3; ++i) {
        Eigen::Vector3d step = Eigen::Vector3d::Zero();
        step[i] = 1e-2;
        const Eigen::Vector2d difference = (*camera.project(p + step) - *camera.project(p - step)) / 2e-2;
        EXPECT_LT((difference - d_point.col(i)).norm(), 1e-6 * (1.0 + difference.norm())) << lens_model_name(model);
      }
      ASSERT_EQ(d_parameters.cols(), parameter_count(model));
      for (int i = 0; i < parameter_count(model); ++i) {
        const double h = i < 4 ? 1e-2 : 1e-5;
        Eigen::VectorXd plus = camera.parameters();
        Eigen::VectorXd minus = camera.parameters();
        plus[i] += h;
        minus[i] -= h;
        const Eigen::Vector2d difference =
            (*Camera::make(model, 4000, 3000, plus)->project(p) - *Camera::make(model, 4000, 3000, minus)->project(p)) /
            (2.0 * h);
        EXPECT_LT((difference - d_parameters.col(i)).norm(), 1e-6 * (1.0 + difference.norm()))
            << lens_model_name(model) << " " << parameter_names(model)[static_cast<std::size_t>(i)];
      }
    }
  }
}

TEST(Camera, BareProjectionFillsTheSameDerivatives) {
  const Camera camera = ordinary(LensModel::kOpenCv8);
  const Eigen::Vector3d p(120.0, -310.0, 1400.0);
  Eigen::Matrix<double, 2, 3> d_point;
  ProjectionParameterJacobian d_parameters;
  const auto pixel = camera.project(p, &d_point, &d_parameters);
  ASSERT_TRUE(pixel);
  double bare[2];
  double by_point[6];
  double by_parameters[2 * 12];
  ASSERT_TRUE(project_bare(camera.model(), camera.parameters().data(), p.data(), bare, by_point, by_parameters));
  EXPECT_EQ(Eigen::Map<const Eigen::Vector2d>(bare), *pixel);
  EXPECT_EQ((Eigen::Map<const Eigen::Matrix<double, 2, 3, Eigen::RowMajor>>(by_point)), d_point);
  EXPECT_EQ((Eigen::Map<const Eigen::Matrix<double, 2, 12, Eigen::RowMajor>>(by_parameters)), d_parameters);
  const double behind[3] = {0.0, 0.0, -1.0};
  EXPECT_FALSE(project_bare(camera.model(), camera.parameters().data(), behind, bare, nullptr, nullptr));
}

/// Every pixel of a grid over the image, its corners included, goes out and comes back.
void expect_round_trip(const Camera& camera) {
  for (int i = 0; i <= 20; ++i) {
    for (int j = 0; j <= 20; ++j) {
      const Eigen::Vector2d pixel((camera.width_px() - 1) * i / 20.0, (camera.height_px() - 1) * j / 20.0);
      const auto ray = camera.unproject(pixel);
      ASSERT_TRUE(ray) << pixel.transpose();
      EXPECT_NEAR(ray->norm(), 1.0, 1e-15);
      EXPECT_LT((opencv_project(camera, *ray * 1234.0) - pixel).norm(), 2e-9) << pixel.transpose();
    }
  }
}

TEST(Camera, UnprojectionRoundTripOnOrdinaryLenses) {
  for (const LensModel model : kModels) expect_round_trip(ordinary(model));
}

TEST(Camera, UnprojectionRoundTripOnStrongDistortion) {
  expect_round_trip(five(2000.0, 4000, 3000, -0.25, 0.10, 0.0));  // barrel
  expect_round_trip(five(1500.0, 3000, 2000, 0.35, 0.20, 0.10));  // pincushion
  Eigen::VectorXd p(12);
  p << 1300.0, 1300.0, 1499.5, 999.5, 0.4, 0.05, 1e-3, -1e-3, 0.001, 0.6, 0.10, 0.001;  // wide, rational
  expect_round_trip(*Camera::make(LensModel::kOpenCv8, 3000, 2000, p));
}

TEST(Camera, UnprojectionIsRightWhereOpenCvIsPixelsOff) {
  // Coefficients as an underconstrained calibration makes them: fine in the middle, steep towards the corners.
  const Camera camera = five(1055.0, 1920, 1200, -0.34, 0.26, -0.14);
  const Eigen::Vector2d corner(0.0, 0.0);
  std::vector<cv::Point2d> undistorted;
  cv::undistortPoints(std::vector<cv::Point2d>{{corner.x(), corner.y()}}, undistorted, opencv_matrix(camera),
                      opencv_distortion(camera));
  const Eigen::Vector3d opencv_ray(undistorted[0].x, undistorted[0].y, 1.0);
  EXPECT_GT((opencv_project(camera, opencv_ray) - corner).norm(), 1.0) << "the case is no trap";
  if (const auto ray = camera.unproject(corner)) {
    EXPECT_LT((opencv_project(camera, *ray) - corner).norm(), 1e-8);
    EXPECT_LT(ray->head<2>().norm() / ray->z(), camera.valid_tangent());
  }
}

TEST(Camera, UnprojectionOfAnythingIsRightOrRefused) {
  std::mt19937_64 random(9);
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  int answered = 0;
  for (int lens = 0; lens < 300; ++lens) {
    Eigen::VectorXd p(16);
    p << 1000.0, 1000.0, 500.0, 500.0, 0.6 * unit(random), 0.6 * unit(random), 0.02 * unit(random), 0.02 * unit(random),
        0.6 * unit(random), 0.6 * unit(random), 0.6 * unit(random), 0.6 * unit(random), 0.02 * unit(random),
        0.02 * unit(random), 0.02 * unit(random), 0.02 * unit(random);
    const Camera camera = *Camera::make(LensModel::kOpenCv12, 1000, 1000, p);
    for (int i = 0; i < 50; ++i) {
      const Eigen::Vector2d pixel(500.0 + 3000.0 * unit(random), 500.0 + 3000.0 * unit(random));
      const auto ray = camera.unproject(pixel);
      if (!ray) continue;
      ++answered;
      ASSERT_GT(ray->z(), 0.0);
      EXPECT_LT(ray->head<2>().norm(), camera.valid_tangent() * ray->z());
      EXPECT_LT((opencv_project(camera, *ray) - pixel).norm(), 1e-8);
    }
  }
  EXPECT_GT(answered, 3000);
}

TEST(Camera, ARayThatProjectsComesBackFromItsPixel) {
  // No refusal where there is an answer: rays up to the edge of the domain of strongly distorting lenses.
  std::mt19937_64 random(10);
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  for (int lens = 0; lens < 200; ++lens) {
    const Camera camera = five(1000.0, 1000, 1000, 0.5 * unit(random), 0.3 * unit(random), 0.2 * unit(random));
    for (const double share : {0.05, 0.5, 0.9, 0.99, 0.999}) {
      const double tangent = share * std::min(camera.valid_tangent(), 5.0);
      const double azimuth = 3.14 * unit(random);
      const Eigen::Vector3d ray = Eigen::Vector3d(tangent * std::cos(azimuth), tangent * std::sin(azimuth), 1.0).normalized();
      const auto pixel = camera.project(ray * 1000.0);
      ASSERT_TRUE(pixel);
      if (pixel->norm() > 1e5) continue;  // 1e-9 px there is beyond double precision
      const auto again = camera.unproject(*pixel);
      ASSERT_TRUE(again) << camera.parameters().transpose() << " share " << share;
      EXPECT_LT((*again - ray).norm(), share < 0.99 ? 1e-11 : 1e-8);
    }
  }
}

TEST(Camera, DomainEndsWhereTheImageFolds) {
  // r (1 + k1 r^2) is steepest at r^2 = -1 / (3 k1).
  EXPECT_NEAR(five(1000.0, 100, 100, -0.3, 0.0, 0.0).valid_tangent(), std::sqrt(1.0 / 0.9), 1e-12);
  EXPECT_NEAR(five(1000.0, 100, 100, 0.3, 0.0, 0.0).valid_tangent(), std::tan(89.0 * 3.14159265358979323846 / 180.0), 1e-6);
  Eigen::VectorXd pole(12);
  pole << 1000, 1000, 50, 50, 0, 0, 0, 0, 0, -0.5, 0, 0;  // 1 / (1 - r^2 / 2)
  EXPECT_NEAR(Camera::make(LensModel::kOpenCv8, 100, 100, pole)->valid_tangent(), std::sqrt(2.0), 1e-12);

  const Camera camera = five(1000.0, 100, 100, -0.3, 0.0, 0.0);
  const double edge = camera.valid_tangent();
  EXPECT_TRUE(camera.project({0.999 * edge, 0.0, 1.0}));
  EXPECT_FALSE(camera.project({edge, 0.0, 1.0}));
  EXPECT_FALSE(camera.project({1.5 * edge, 0.0, 1.0})) << "folded back into the image";
  EXPECT_FALSE(camera.unproject({50.0 + 1000.0 * edge, 49.5})) << "no ray reaches so far";
}

TEST(Camera, DomainIsTheFirstFoldOfAScan) {
  std::mt19937_64 random(11);
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  int folds = 0;
  for (int lens = 0; lens < 500; ++lens) {
    Eigen::VectorXd p(12);
    p << 1000.0, 1000.0, 500.0, 500.0, unit(random), unit(random), 0.0, 0.0, unit(random), unit(random), unit(random),
        unit(random);
    const Camera camera = *Camera::make(LensModel::kOpenCv8, 1000, 1000, p);
    const auto denominator = [&](double s) { return 1.0 + s * (p[9] + s * (p[10] + s * p[11])); };
    const auto distorted = [&](double r) {
      const double s = r * r;
      return r * (1.0 + s * (p[4] + s * (p[5] + s * p[8]))) / denominator(s);
    };
    constexpr double kStep = 1e-4;
    double scanned = camera.valid_tangent();
    for (double r = 0.0; r < std::min(camera.valid_tangent() + 0.01, 20.0); r += kStep) {
      if (distorted(r + kStep) <= distorted(r) || denominator((r + kStep) * (r + kStep)) <= 0.0) {
        scanned = r;
        ++folds;
        break;
      }
    }
    EXPECT_NEAR(scanned, camera.valid_tangent(), 3.0 * kStep) << p.transpose();
  }
  EXPECT_GT(folds, 200);
}

TEST(Camera, RefusesWhatIsNotInFront) {
  const Camera camera = ordinary(LensModel::kOpenCv5);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double infinite = std::numeric_limits<double>::infinity();
  EXPECT_FALSE(camera.project({0, 0, 0}));
  EXPECT_FALSE(camera.project({1, 1, -100}));
  EXPECT_FALSE(camera.project({nan, 0, 100}));
  EXPECT_FALSE(camera.project({0, 0, nan}));
  EXPECT_FALSE(camera.project({1, 0, 1e-300}));
  EXPECT_FALSE(camera.project({infinite, 0, infinite}));
  EXPECT_FALSE(camera.unproject({nan, 0}));
  EXPECT_FALSE(camera.unproject({infinite, 0}));
  EXPECT_FALSE(camera.unproject({1e300, 1e300}));
}

TEST(Camera, IsMadeFromSensibleNumbersOnly) {
  const Eigen::VectorXd good = ordinary(LensModel::kOpenCv5).parameters();
  EXPECT_FALSE(Camera::make(LensModel::kOpenCv5, 0, 3000, good));
  EXPECT_FALSE(Camera::make(LensModel::kOpenCv5, 4000, -1, good));
  EXPECT_FALSE(Camera::make(LensModel::kOpenCv8, 4000, 3000, good));
  for (int i = 0; i < good.size(); ++i) {
    Eigen::VectorXd bad = good;
    bad[i] = std::numeric_limits<double>::quiet_NaN();
    EXPECT_FALSE(Camera::make(LensModel::kOpenCv5, 4000, 3000, bad));
  }
  Eigen::VectorXd bad = good;
  bad[1] = 0.0;
  const auto refused = Camera::make(LensModel::kOpenCv5, 4000, 3000, bad);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::kBadInput);
  EXPECT_NE(refused.error().message.find("fy"), std::string::npos);
}

TEST(Camera, NominalLooksThroughTheCentre) {
  const auto camera = Camera::nominal(LensModel::kOpenCv5, 640, 480, 800.0);
  ASSERT_TRUE(camera);
  EXPECT_EQ(*camera->project({0, 0, 5}), Eigen::Vector2d(319.5, 239.5));
  EXPECT_FALSE(Camera::nominal(LensModel::kOpenCv5, 640, 480, -800.0));
}

TEST(Camera, ModelsHaveMrcalsNames) {
  for (const LensModel model : kModels) {
    EXPECT_EQ(lens_model_from_name(lens_model_name(model)), model);
    EXPECT_EQ(parameter_names(model).size(), static_cast<std::size_t>(parameter_count(model)));
  }
  EXPECT_EQ(lens_model_name(LensModel::kOpenCv8), "LENSMODEL_OPENCV8");
  EXPECT_FALSE(lens_model_from_name("LENSMODEL_CAHVOR"));
  EXPECT_EQ(parameter_names(LensModel::kOpenCv12)[8], "k3");
}

TEST(Camera, AiconsModelIsTheFormulaOfItsFilesOnTheSensor) {
  // Written out in mm with y up and an image that lies behind the camera's -z, as the .ior and .eor files mean it.
  const double c = 28.785, xh = 0.0173, yh = 0.0567, a1 = -1.096e-4, a2 = 1.496e-7, a3 = -3e-11, b1 = 5.8e-6, b2 = -8.6e-6,
               c1 = -7.0e-5, c2 = -3.1e-5, r0 = 13.488;
  Eigen::VectorXd p(15);
  p << c, xh, yh, a1, a2, a3, b1, b2, c1, c2, r0, 35.968, 23.979, 8688.0, 5792.0;
  const auto camera = Camera::make(LensModel::kAicon, 8688, 5792, p);
  ASSERT_TRUE(camera) << camera.error().message;
  for (const Eigen::Vector3d& k : {Eigen::Vector3d(0.0, 0.0, -1.0), Eigen::Vector3d(400.0, -250.0, -1000.0),
                                   Eigen::Vector3d(-600.0, 410.0, -1010.0), Eigen::Vector3d(-30.0, -405.0, -990.0)}) {
    const double xs = -c * k.x() / k.z();
    const double ys = -c * k.y() / k.z();
    const double r2 = xs * xs + ys * ys;
    const double dr = a1 * (r2 - r0 * r0) + a2 * (r2 * r2 - std::pow(r0, 4)) + a3 * (r2 * r2 * r2 - std::pow(r0, 6));
    const double x = xh + xs + xs * dr + b1 * (r2 + 2.0 * xs * xs) + 2.0 * b2 * xs * ys + c1 * xs + c2 * ys;
    const double y = yh + ys + ys * dr + b2 * (r2 + 2.0 * ys * ys) + 2.0 * b1 * xs * ys;
    const Eigen::Vector2d expected(4343.5 + x * 8688.0 / 35.968, 2895.5 - y * 5792.0 / 23.979);
    const Eigen::Vector3d in_camera(k.x(), -k.y(), -k.z());  // ours: y down, z forwards
    const auto pixel = camera->project(in_camera);
    ASSERT_TRUE(pixel);
    EXPECT_LT((*pixel - expected).norm(), 1e-9) << k.transpose();
    const auto ray = camera->unproject(*pixel);
    ASSERT_TRUE(ray);
    EXPECT_LT((*ray - in_camera.normalized()).norm(), 1e-12);
  }
  EXPECT_NEAR(camera->focal_px().x(), c * 8688.0 / 35.968, 1e-9);
  p(13) = 4344.0;
  EXPECT_FALSE(Camera::make(LensModel::kAicon, 8688, 5792, p));
}

}  // namespace
}  // namespace crosstie::base
