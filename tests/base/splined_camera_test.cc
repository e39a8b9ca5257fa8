// Splined stereographic models. The expected values are those of mrcal 2.2's Python module: project, unproject,
// knots_for_splined_models.
#include <cmath>
#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/camera.h"

namespace crosstie::base {
namespace {

Camera splined(const SplineGrid& grid) {
  const LensModel model = *LensModel::splined(grid);
  Eigen::VectorXd p(parameter_count(model));
  p.head<4>() << 1200.25, 1201.5, 799.5, 598.25;
  for (int i = 4; i < p.size(); ++i) p[i] = std::round(1e4 * 0.01 * std::sin(1.0 + 0.7 * (i - 4))) * 1e-4;
  auto camera = Camera::make(model, 1600, 1200, p);
  EXPECT_TRUE(camera) << camera.error().message;
  return *camera;
}

struct Expected {
  SplineGrid grid;
  Eigen::Vector2d pixels[4];
  Eigen::RowVector3d d_point[2];  // of the second pixel
  Eigen::Vector3d rays[2];        // of (300, 400) and (1000, 900)
};
const Eigen::Vector3d kPoints[] = {{100, -50, 1000}, {-350, 200, 900}, {10, 300, 800}, {420, -310, 1000}};
const Expected kExpected[] = {{{3, 8, 6, 70},
                               {{918.0736865298289, 533.5147880925948},
                                {349.900655474284, 852.9196986587643},
                                {817.5019573039857, 1040.020900529732},
                                {1273.067033662217, 252.13349978031476}},
                               {{1.213386144868418, 0.02237562207707006, 0.4669000292094804},
                                {0.08025878867061748, 1.2121878910166166, -0.23816333574289691}},
                               {{-0.40018231717028796, -0.16182804821004632, 0.9020342542480002},
                                {0.158848413652463, 0.24366465549102892, 0.9567626231958135}}},
                              {{2, 7, 6, 60},
                               {{919.3631647676691, 540.8302804650289},
                                {353.134867369278, 853.3258460002464},
                                {815.4451554170316, 1037.660777741116},
                                {1268.7937738227183, 245.42913876555525}},
                               {{1.1964569146613238, -0.020999908117122313, 0.46995544639431996},
                                {0.055510556737045066, 1.160290351669487, -0.236254861639924}},
                               {{-0.3954900612287984, -0.15461898338200322, 0.9053621272436556},
                                {0.16102554987487105, 0.24439554754877454, 0.9562121044129436}}}};

TEST(SplinedCamera, ProjectsAndUnprojectsAsMrcalDoes) {
  for (const Expected& expected : kExpected) {
    const Camera camera = splined(expected.grid);
    for (int i = 0; i < 4; ++i) {
      const auto pixel = camera.project(kPoints[i]);
      ASSERT_TRUE(pixel) << i;
      EXPECT_LT((*pixel - expected.pixels[i]).norm(), 1e-9) << i;
    }
    Eigen::Matrix<double, 2, 3> d_point;
    ASSERT_TRUE(camera.project(kPoints[1], &d_point));
    EXPECT_LT((d_point.row(0) - expected.d_point[0]).norm() + (d_point.row(1) - expected.d_point[1]).norm(), 1e-12);
    // mrcal's own unprojection stops near 1e-8 px, ours is checked to 1e-9.
    for (const auto& [pixel, ray] : {std::pair(Eigen::Vector2d(300, 400), expected.rays[0]), {{1000, 900}, expected.rays[1]}}) {
      const auto ours = camera.unproject(pixel);
      ASSERT_TRUE(ours);
      EXPECT_LT((*ours - ray).norm(), 1e-10);
    }
  }
}

TEST(SplinedCamera, DerivativesAreThoseOfDifferences) {
  const Camera camera = splined(kExpected[0].grid);
  const auto with = [&](int i, double step) {
    Eigen::VectorXd p = camera.parameters();
    p[i] += step;
    return *Camera::make(camera.model(), 1600, 1200, p);
  };
  int not_zero = 0;
  for (const Eigen::Vector3d& point : kPoints) {
    ProjectionParameterJacobian d_parameters;
    ASSERT_TRUE(camera.project(point, nullptr, &d_parameters));
    ASSERT_EQ(d_parameters.cols(), 100);
    for (int i = 0; i < 100; ++i) {
      const double h = i < 4 ? 1e-2 : 1e-5;
      const Eigen::Vector2d difference = (*with(i, h).project(point) - *with(i, -h).project(point)) / (2.0 * h);
      EXPECT_LT((difference - d_parameters.col(i)).norm(), 1e-6 * (1.0 + difference.norm())) << i;
      not_zero += d_parameters.col(i).norm() > 0.0 ? 1 : 0;
    }
  }
  EXPECT_EQ(not_zero, 4 * (4 + 2 * 16));
}

/// The point of a stereographic image point.
Eigen::Vector3d point_at(double u, double v) {
  return Eigen::Vector3d(1000.0 * u, 1000.0 * v, 1000.0 * (1.0 - 0.25 * (u * u + v * v)));
}

TEST(SplinedCamera, EveryRayOfTheDomainComesBack) {
  std::mt19937_64 random(3);
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  struct Case {
    SplineGrid grid;
    double u, v;  // inside of the grid, and of 89 degrees
  };
  for (const auto& [grid, u, v] :
       {Case{{3, 8, 6, 70}, 0.63, 0.378}, Case{{2, 30, 20, 80}, 0.72, 0.46}, Case{{3, 5, 5, 200}, 1.3, 1.3}}) {
    const Camera camera = splined(grid);
    for (int i = 0; i < 300; ++i) {
      const Eigen::Vector3d point = point_at(u * unit(random), v * unit(random));
      const auto pixel = camera.project(point);
      ASSERT_TRUE(pixel) << point.transpose();
      const auto ray = camera.unproject(*pixel);
      ASSERT_TRUE(ray) << point.transpose();
      EXPECT_LT((*ray - point.normalized()).norm(), 1e-11);
    }
  }
}

TEST(SplinedCamera, RefusesWhatItsGridDoesNotCover) {
  const Camera camera = splined({3, 8, 6, 70});
  // The outermost covered knots lie 0.6306 from the middle in x, 0.3784 in y: the last but one of mrcal's.
  EXPECT_TRUE(camera.project(point_at(0.6305, 0.1)));
  EXPECT_FALSE(camera.project(point_at(0.6307, 0.1)));
  EXPECT_TRUE(camera.project(point_at(0.1, -0.3783)));
  EXPECT_FALSE(camera.project(point_at(0.1, -0.3785)));
  EXPECT_FALSE(camera.project({0, 0, -1000}));
  EXPECT_FALSE(camera.unproject({1e5, 600}));
  EXPECT_FALSE(camera.unproject({-1e9, -1e9}));

  // Control points that fold the image.
  Eigen::VectorXd folded = camera.parameters();
  for (int i = 4; i < folded.size(); ++i) folded[i] = 2.0 * ((i / 2) % 2);
  const Camera bad = *Camera::make(camera.model(), 1600, 1200, folded);
  int refused = 0;
  for (int i = 0; i < 40; ++i) refused += bad.project(point_at(0.03 * (i - 20), 0.01)) ? 0 : 1;
  EXPECT_GT(refused, 5);
}

TEST(SplinedCamera, NamesSayTheGrid) {
  const std::string name = "LENSMODEL_SPLINED_STEREOGRAPHIC_order=3_Nx=30_Ny=20_fov_x_deg=70";
  const auto model = lens_model_from_name(name);
  ASSERT_TRUE(model);
  EXPECT_EQ(model->grid(), (SplineGrid{3, 30, 20, 70}));
  EXPECT_EQ(lens_model_name(*model), name);
  EXPECT_EQ(parameter_count(*model), 4 + 2 * 30 * 20);
  EXPECT_EQ(parameter_names(*model).size(), 1204U);
  EXPECT_EQ(parameter_names(*model)[5], "v0");
  EXPECT_EQ(parameter_units(*model)[3], "px");
  EXPECT_EQ(parameter_units(*model)[1203], "");
  EXPECT_FALSE(*model == LensModel::kOpenCv5);
  for (const char* bad : {"LENSMODEL_SPLINED_STEREOGRAPHIC", "LENSMODEL_SPLINED_STEREOGRAPHIC_order=4_Nx=30_Ny=20_fov_x_deg=70",
                          "LENSMODEL_SPLINED_STEREOGRAPHIC_order=3_Nx=30_Ny=20_fov_x_deg=70x",
                          "LENSMODEL_SPLINED_STEREOGRAPHIC_order=3_Nx=-3_Ny=20_fov_x_deg=70",
                          "LENSMODEL_SPLINED_STEREOGRAPHIC_order=3_Nx=3_Ny=20_fov_x_deg=70",
                          "LENSMODEL_SPLINED_STEREOGRAPHIC_order=3_Nx=65535_Ny=65535_fov_x_deg=70",
                          "LENSMODEL_SPLINED_STEREOGRAPHIC_order=3_Nx=99999999999_Ny=20_fov_x_deg=70",
                          "LENSMODEL_SPLINED_STEREOGRAPHIC_order=3_Nx=30_Ny=20_fov_x_deg=360",
                          "LENSMODEL_SPLINED_STEREOGRAPHIC_Nx=30_order=3_Ny=20_fov_x_deg=70"}) {
    EXPECT_FALSE(lens_model_from_name(bad)) << bad;
  }
  EXPECT_THAT(LensModel::splined({3, 0, 0, 70}).error().message, testing::HasSubstr("at least 4 x 4"));
}

TEST(Camera, KnowsWhereItIsCalibrated) {
  Camera camera = *Camera::nominal(LensModel::kOpenCv5, 640, 480, 800.0);
  EXPECT_TRUE(camera.calibrated_at({-0.5, -0.5}));
  EXPECT_FALSE(camera.calibrated_at({639.6, 100}));
  EXPECT_FALSE(camera.calibrated_at({std::nan(""), 100}));
  camera.set_valid_region(Camera::Region{{100, 100}, {500, 100}, {500, 400}, {300, 200}, {100, 400}});  // a notch from below
  EXPECT_TRUE(camera.calibrated_at({200, 250}));
  EXPECT_TRUE(camera.calibrated_at({300, 199}));
  EXPECT_FALSE(camera.calibrated_at({300, 201}));
  EXPECT_FALSE(camera.calibrated_at({99, 250}));
  camera.set_valid_region(Camera::Region{});
  EXPECT_FALSE(camera.calibrated_at({320, 240}));
}

}  // namespace
}  // namespace crosstie::base
