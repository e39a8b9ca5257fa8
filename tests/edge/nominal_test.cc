#include "edge/nominal.h"

#include <cmath>
#include <numbers>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <Eigen/Geometry>

#include "math/shapes.h"
#include "tests/edge/synthetic_rim.h"

namespace crosstie::edge {
namespace {

using std::numbers::pi;
using ::testing::HasSubstr;
using tests::on_cylinder;
using tests::true_ellipse;
using tests::true_oval;

NominalCurve made(const Nominal& nominal) {
  auto curve = NominalCurve::make(nominal);
  EXPECT_TRUE(curve.has_value()) << curve.error().message;
  return *curve;
}

TEST(Nominal, LengthsAreThoseOfTheBooks) {
  EXPECT_NEAR(made({NominalKind::kCircle, {200.0}}).length_mm(), 200.0 * pi, 1e-9);
  // Perimeter of an ellipse of half axes 2 and 1: 9.688448220547675 (complete elliptic integral of the second kind).
  EXPECT_NEAR(made({NominalKind::kEllipse, {400.0, 200.0}}).length_mm(), 968.8448220547675, 1e-8);
  EXPECT_NEAR(made({NominalKind::kOval, {2000.0, 800.0}}).length_mm(), 800.0 * pi + 2400.0, 1e-9);
  EXPECT_NEAR(made({NominalKind::kOval, {800.0, 800.0}}).length_mm(), 800.0 * pi, 1e-9);
}

TEST(Nominal, BeginsOnXAndRunsCounterClockwise) {
  for (const NominalKind kind : {NominalKind::kEllipse, NominalKind::kOval, NominalKind::kSuperellipse}) {
    const NominalCurve curve = made({kind, {600.0, 400.0}});
    EXPECT_NEAR((curve.at(0.0).point_mm - Eigen::Vector3d(300.0, 0.0, 0.0)).norm(), 0.0, 1e-9);
    EXPECT_NEAR((curve.at(0.0).tangent - Eigen::Vector3d::UnitY()).norm(), 0.0, 1e-9);
    EXPECT_NEAR((curve.at(curve.length_mm() / 4).point_mm - Eigen::Vector3d(0.0, 200.0, 0.0)).norm(), 0.0, 1e-7);
    EXPECT_NEAR((curve.at(-curve.length_mm() / 4).point_mm - Eigen::Vector3d(0.0, -200.0, 0.0)).norm(), 0.0, 1e-7);
  }
}

TEST(Nominal, ArcLengthIsTheWayAlongTheCurve) {
  const std::vector<Nominal> all = {{NominalKind::kEllipse, {600.0, 200.0}},
                                    {NominalKind::kOval, {900.0, 300.0}},
                                    {NominalKind::kSuperellipse, {900.0, 300.0}, 4.0},
                                    {NominalKind::kOval, {900.0, 300.0}, 2.5, Saddle{700.0, 0.05, 0.3}}};
  for (const Nominal& nominal : all) {
    const NominalCurve curve = made(nominal);
    constexpr int kSteps = 20000;
    double way = 0.0;
    Eigen::Vector3d last = curve.at(0.0).point_mm;
    for (int i = 1; i <= kSteps; ++i) {
      const CurvePoint here = curve.at(curve.length_mm() * i / kSteps);
      EXPECT_NEAR(here.tangent.dot(here.normal), 0.0, 1e-12);
      way += (here.point_mm - last).norm();
      last = here.point_mm;
    }
    EXPECT_NEAR(way, curve.length_mm(), 1e-5 * curve.length_mm() / kSteps + 1e-4);
  }
}

TEST(Nominal, OutlinesAreWhatTheirFormulasSay) {
  const auto ellipse = true_ellipse(700.0, 350.0);
  const auto oval = true_oval(1200.0, 500.0);
  const NominalCurve ellipse_curve = made({NominalKind::kEllipse, {700.0, 350.0}});
  const NominalCurve oval_curve = made({NominalKind::kOval, {1200.0, 500.0}});
  const NominalCurve super = made({NominalKind::kSuperellipse, {700.0, 350.0}, 3.0});
  for (double u = 0.003; u < 1.0; u += 0.0371) {
    EXPECT_NEAR((ellipse_curve.nearest(ellipse(u).point).point_mm - ellipse(u).point).norm(), 0.0, 1e-9);
    EXPECT_NEAR((oval_curve.nearest(oval(u).point).point_mm - oval(u).point).norm(), 0.0, 1e-9);
    const Eigen::Vector3d p = super.at(u * super.length_mm()).point_mm;
    EXPECT_NEAR(std::pow(std::abs(p.x()) / 350.0, 3.0) + std::pow(std::abs(p.y()) / 175.0, 3.0), 1.0, 1e-12);
  }
}

TEST(Nominal, ASaddleLiesOnTheTowerAndOverItsOutline) {
  for (const double side : {1.0, -1.0}) {
    for (const double half_angle : {0.0, 0.03, -0.05}) {
      for (const double direction : {0.0, 0.7, 2.0}) {
        const Nominal flat{NominalKind::kOval, {900.0, 400.0}};
        Nominal nominal = flat;
        nominal.saddle = Saddle{side * 2150.0, half_angle, direction};
        const NominalCurve curve = made(nominal);
        const NominalCurve outline = made(flat);
        // The tower by its own words: the generator through the origin is inclined by the half angle to the axis, which lies
        // 2150 mm across from the origin, behind the surface where the head is outside.
        const Eigen::Vector3d generator(std::cos(direction), std::sin(direction), 0.0);
        const Eigen::Vector3d sideways = Eigen::Vector3d::UnitZ().cross(generator);
        const Eigen::Vector3d axis = Eigen::AngleAxisd(side * half_angle, sideways) * generator;
        Eigen::Vector3d to_axis = axis.cross(sideways);
        if (to_axis.z() * side > 0.0) to_axis = -to_axis;
        math::Cone cone{2150.0 * to_axis, axis, 2150.0 * std::cos(half_angle), half_angle};
        if (half_angle < 0.0) cone = {2150.0 * to_axis, -axis, 2150.0 * std::cos(half_angle), -half_angle};
        ASSERT_NEAR(math::signed_distance_mm(cone, Eigen::Vector3d::Zero()), 0.0, 1e-9);
        for (double s = 1.0; s < curve.length_mm(); s += 97.3) {
          const CurvePoint here = curve.at(s);
          EXPECT_NEAR(math::signed_distance_mm(cone, here.point_mm), 0.0, 1e-9);
          const double outside = math::signed_distance_mm(cone, here.point_mm + here.normal);
          EXPECT_NEAR(outside, side, 1e-6) << "the normal is the tower's, towards the head";
          const Eigen::Vector3d under(here.point_mm.x(), here.point_mm.y(), 0.0);
          EXPECT_NEAR((outline.nearest(under).point_mm - under).norm(), 0.0, 1e-9);
        }
      }
    }
  }
}

TEST(Nominal, ASplineComesWithinItsBoundOfACircle) {
  Nominal nominal{NominalKind::kPoints};
  constexpr int kPoints = 24;
  for (int i = 0; i < kPoints; ++i) {
    nominal.points_mm.emplace_back(100.0 * std::cos(2.0 * pi * i / kPoints), 100.0 * std::sin(2.0 * pi * i / kPoints), 5.0);
  }
  const NominalCurve curve = made(nominal);
  // 5/384 h^4 max|f''''| of a cubic spline: 100 * (2 pi / 24)^4 * 5 / 384
  const double bound = 100.0 * std::pow(2.0 * pi / kPoints, 4) * 5.0 / 384.0;
  for (double s = 0.0; s < curve.length_mm(); s += 3.3) {
    EXPECT_NEAR(curve.at(s).point_mm.head<2>().norm(), 100.0, bound);
    EXPECT_NEAR(curve.at(s).normal.z(), 1.0, 1e-9);
  }
  nominal.spline = false;
  EXPECT_NEAR(made(nominal).length_mm(), kPoints * 200.0 * std::sin(pi / kPoints), 1e-9);
  EXPECT_EQ(made(nominal).corners_mm().size(), std::size_t{kPoints});
  nominal.closed = false;
  EXPECT_NEAR(made(nominal).length_mm(), (kPoints - 1) * 200.0 * std::sin(pi / kPoints), 1e-9);
}

TEST(Nominal, NearestPlacesOfASquareAreKnown) {
  Nominal square{NominalKind::kPoints};
  square.points_mm = {{0, 0, 0}, {100, 0, 0}, {100, 100, 0}, {0, 100, 0}};
  square.spline = false;
  const NominalCurve curve = made(square);
  EXPECT_NEAR(curve.length_mm(), 400.0, 1e-12);
  EXPECT_NEAR((curve.nearest({37.5, 4.0, 3.0}).point_mm - Eigen::Vector3d(37.5, 0, 0)).norm(), 0.0, 1e-12);
  EXPECT_NEAR(curve.nearest({37.5, 4.0, 3.0}).s_mm, 37.5, 1e-9);
  EXPECT_NEAR((curve.nearest({110.0, 120.0, 0.0}).point_mm - Eigen::Vector3d(100, 100, 0)).norm(), 0.0, 1e-12);
  EXPECT_NEAR(curve.nearest({-3.0, 25.0, 1.0}).s_mm, 375.0, 1e-9);
  ASSERT_EQ(curve.corners_mm().size(), 4U);
  EXPECT_NEAR(curve.corners_mm()[2], 200.0, 1e-9);
}

TEST(Nominal, AMirrorOfAMirrorIsTheSameHole) {
  Nominal nominal{NominalKind::kOval, {900.0, 400.0}, 2.5, Saddle{2150.0, 0.03, 0.4}};
  const NominalCurve once = made(mirrored(nominal));
  const NominalCurve before = made(nominal);
  for (double s = 0.0; s < before.length_mm(); s += 111.0) {
    Eigen::Vector3d p = before.at(s).point_mm;
    p.y() = -p.y();
    EXPECT_NEAR((once.nearest(p).point_mm - p).norm(), 0.0, 1e-9);
  }
}

TEST(Nominal, WhatIsNoHoleIsRefused) {
  const auto message = [](const Nominal& nominal) {
    const auto curve = NominalCurve::make(nominal);
    return curve ? std::string() : curve.error().message;
  };
  EXPECT_THAT(message({NominalKind::kCircle, {}}), HasSubstr("needs diameter"));
  EXPECT_THAT(message({NominalKind::kEllipse, {100.0}}), HasSubstr("length and width"));
  EXPECT_THAT(message({NominalKind::kEllipse, {100.0, -3.0}}), HasSubstr("width"));
  EXPECT_THAT(message({NominalKind::kOval, {100.0, 200.0}}), HasSubstr("wider"));
  EXPECT_THAT(message({NominalKind::kSuperellipse, {200.0, 100.0}, 1.2}), HasSubstr("exponent"));
  EXPECT_THAT(message({NominalKind::kCircle, {500.0}, 2.5, Saddle{200.0}}), HasSubstr("does not meet the tower"));
  EXPECT_THAT(message({NominalKind::kCircle, {500.0}, 2.5, Saddle{0.0}}), HasSubstr("radius"));
  Nominal list{NominalKind::kPoints};
  list.points_mm = {{0, 0, 0}, {100, 0, 0}};
  EXPECT_THAT(message(list), HasSubstr("3 points"));
  list.points_mm = {{0, 0, 0}, {100, 0, 0}, {100, 0, 0}, {0, 100, 0}};
  EXPECT_THAT(message(list), HasSubstr("points 2 and 3 are in one place"));
  list.points_mm = {{0, 0, 0}, {100, 100, 0}, {100, 0, 0}, {0, 100, 0}};
  EXPECT_THAT(message(list), HasSubstr("crosses itself"));
  list.points_mm = {{0, 0, 0}, {100, 0, 0}, {std::nan(""), 0, 0}, {0, 100, 0}};
  EXPECT_THAT(message(list), HasSubstr("not finite"));
}

}  // namespace
}  // namespace crosstie::edge
