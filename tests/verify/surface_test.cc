#include "verify/surface.h"

#include <cmath>
#include <numbers>
#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <Eigen/Geometry>

namespace crosstie::verify {
namespace {

using base::Cloud;
using base::ErrorCode;
using base::Mesh;
using std::numbers::pi;
using ::testing::HasSubstr;

/// z = height(x, y) over a square of `half` about 0, in steps of one.
template <typename Height>
Mesh height_field(int half, Height height) {
  Mesh mesh;
  const int n = 2 * half + 1;
  for (int y = -half; y <= half; ++y) {
    for (int x = -half; x <= half; ++x) mesh.vertices.points.emplace_back(x, y, height(x, y));
  }
  for (int y = 0; y + 1 < n; ++y) {
    for (int x = 0; x + 1 < n; ++x) {
      const auto at = [&](int dx, int dy) { return static_cast<std::uint32_t>((y + dy) * n + x + dx); };
      mesh.triangles.push_back({at(0, 0), at(1, 0), at(1, 1)});
      mesh.triangles.push_back({at(0, 0), at(1, 1), at(0, 1)});
    }
  }
  return mesh;
}

/// Distance from a triangle by its plane, else its three sides.
double distance_of(const Eigen::Vector3d& a, const Eigen::Vector3d& b, const Eigen::Vector3d& c, const Eigen::Vector3d& p) {
  const Eigen::Vector3d n = (b - a).cross(c - a).normalized();
  const Eigen::Vector3d q = p - n.dot(p - a) * n;
  const auto inside = [&](const Eigen::Vector3d& u, const Eigen::Vector3d& v) { return (v - u).cross(q - u).dot(n) >= 0.0; };
  if (inside(a, b) && inside(b, c) && inside(c, a)) return (p - q).norm();
  double least = HUGE_VAL;
  for (const auto& [u, v] : {std::pair{a, b}, std::pair{b, c}, std::pair{c, a}}) {
    const double t = std::clamp((p - u).dot(v - u) / (v - u).squaredNorm(), 0.0, 1.0);
    least = std::min(least, (u + t * (v - u) - p).norm());
  }
  return least;
}

TEST(Surface, DistancesFromAMeshAreThoseFromAllItsTriangles) {
  const Mesh mesh = height_field(12, [](double x, double y) { return 0.02 * x * x - 0.03 * y * x + std::sin(0.4 * y); });
  std::mt19937_64 random(1);
  std::uniform_real_distribution<double> place(-10.0, 10.0);
  Cloud cloud;
  for (int i = 0; i < 400; ++i) {
    const double x = place(random);
    const double y = place(random);
    cloud.points.emplace_back(x, y, place(random));
  }
  const auto result = compare_surface(cloud, mesh, {.gate_mm = 100.0});
  ASSERT_TRUE(result.has_value()) << result.error().message;
  EXPECT_EQ(result->reference, "mesh");
  EXPECT_EQ(result->count + result->beyond_border, 400U);
  for (std::size_t i = 0; i < result->count; ++i) {
    double least = HUGE_VAL;
    for (const auto& t : mesh.triangles) {
      least = std::min(least, distance_of(mesh.vertices.points[t[0]], mesh.vertices.points[t[1]], mesh.vertices.points[t[2]],
                                          result->points[i]));
    }
    EXPECT_NEAR(std::abs(result->deviations_mm[i]), least, 1e-12);
  }
}

TEST(Surface, SignsBordersAndStatisticsOfAPlane) {
  const Mesh mesh = height_field(20, [](double, double) { return 0.0; });
  Cloud cloud;
  for (int i = 0; i < 100; ++i) cloud.points.emplace_back(-10.0 + 0.2 * i, 0.3, 0.01 * (i - 39.5));
  cloud.points.emplace_back(25.0, 0.0, 0.0);  // past the border
  cloud.points.emplace_back(0.0, 0.0, 50.0);  // no point of it
  cloud.cov_mm2.assign(cloud.points.size(), 0.04 * Eigen::Matrix3d::Identity());
  const auto result = compare_surface(cloud, mesh, {.tolerance_mm = 0.3, .gate_mm = 8.0});
  ASSERT_TRUE(result.has_value());
  EXPECT_EQ(result->count, 100U);
  EXPECT_EQ(result->beyond_border, 1U);
  EXPECT_EQ(result->too_far, 1U);
  EXPECT_NEAR(result->mean_mm, 0.1, 1e-12);
  EXPECT_NEAR(result->max_mm, 0.595, 1e-12);
  EXPECT_NEAR(result->sigma_mm, 0.01 * std::sqrt((100.0 * 100.0 - 1.0) / 12.0 * 100.0 / 99.0), 1e-12);
  EXPECT_NEAR(result->p95_mm, 0.545, 1e-12);
  EXPECT_NEAR(result->in_tolerance, 0.60, 1e-12);
  EXPECT_NEAR(*result->normalised_rms, result->rms_mm / 0.2, 1e-12);
  EXPECT_LT(result->deviations_mm.front(), 0.0);
  EXPECT_GT(result->deviations_mm.back(), 0.0);
}

/// Points of a cylinder of radius R about x over `arc` radians, at R + off.
Cloud shell(double radius, double arc, double length, double off, int n, unsigned seed, double noise = 0.0) {
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> uniform(-0.5, 0.5);
  std::normal_distribution<double> normal;
  Cloud cloud;
  for (int i = 0; i < n; ++i) {
    const double phi = arc * uniform(random);
    const double x = length * uniform(random);
    const double r = radius + off + noise * normal(random);
    cloud.points.emplace_back(x, r * std::sin(phi), r * std::cos(phi));
    cloud.normals.emplace_back(0.0, std::sin(phi), std::cos(phi));
  }
  return cloud;
}

TEST(Surface, ACloudIsAReferenceToo) {
  Mesh reference;
  reference.vertices = shell(300.0, 0.6, 200.0, 0.0, 20000, 1);
  const Cloud measured = shell(300.0, 0.55, 180.0, 0.12, 2000, 2);
  const auto result = compare_surface(measured, reference, {});
  ASSERT_TRUE(result.has_value()) << result.error().message;
  EXPECT_EQ(result->reference, "cloud");
  // Twenty of 20000 points on 180 x 200 mm lie within about 3.4 mm: a plane would be 0.01 mm under the arc, second order follows it.
  EXPECT_NEAR(result->mean_mm, 0.12, 1e-4);
  EXPECT_LT(result->sigma_mm, 0.001);
  EXPECT_LT(result->beyond_border, 400U);
  const auto outside = compare_surface(shell(300.0, 1.2, 400.0, 0.12, 4000, 3), reference, {});
  ASSERT_TRUE(outside.has_value());
  EXPECT_LT(outside->count, 1400U) << "a quarter of the points has a reference";
  EXPECT_LT(outside->max_mm, 0.3) << "and the others have none";
}

TEST(Surface, NominalShapesHaveExactDistances) {
  const Cloud cloud = shell(2150.0, 1.0, 1000.0, -0.25, 500, 4);
  const auto cylinder = compare_surface(cloud, math::Cylinder{{77.0, 0.0, 0.0}, Eigen::Vector3d::UnitX(), 2150.0}, {});
  ASSERT_TRUE(cylinder.has_value());
  EXPECT_NEAR(cylinder->mean_mm, -0.25, 1e-9);
  EXPECT_LT(cylinder->sigma_mm, 1e-9);
  EXPECT_EQ(cylinder->in_tolerance, 1.0);
  const auto far = compare_surface(cloud, math::Cylinder{{0.0, 0.0, 0.0}, Eigen::Vector3d::UnitX(), 84.6}, {});
  ASSERT_FALSE(far.has_value());
  EXPECT_EQ(far.error().code, ErrorCode::kBadInput);
  EXPECT_THAT(far.error().message, HasSubstr("one frame and unit"));
}

TEST(Surface, ABestFitFindsTheWayOnASurfaceThatHoldsIt) {
  const auto height = [](double x, double y) {
    return 0.02 * x * x + 0.01 * y * y + 2.0 * std::sin(0.3 * x) * std::cos(0.25 * y);
  };
  const Mesh mesh = height_field(40, height);
  base::Vector6d moved;
  moved << 0.004, -0.006, 0.005, 0.3, -0.2, 0.25;
  const base::Pose reference_from_measured = base::perturbed({}, moved);
  Cloud cloud;
  for (std::size_t i = 0; i < mesh.vertices.points.size(); i += 3) {
    if (mesh.vertices.points[i].head<2>().cwiseAbs().maxCoeff() < 35.0)
      cloud.points.push_back(reference_from_measured.inverse() * mesh.vertices.points[i]);
  }
  const auto result = compare_surface(cloud, mesh, {.best_fit = true});
  ASSERT_TRUE(result.has_value());
  EXPECT_TRUE(result->held.empty());
  EXPECT_LT(base::difference(result->reference_from_measured, reference_from_measured).norm(), 0.002);
  EXPECT_LT(result->rms_mm, 0.002);
  const auto as_it_stands = compare_surface(cloud, mesh, {});
  EXPECT_GT(as_it_stands->rms_mm, 0.1);
}

TEST(Surface, ABestFitHoldsWhatACylinderDoesNotDetermine) {
  const Cloud cloud = shell(2150.0, 0.5, 700.0, 0.1, 4000, 5, 0.02);
  base::Vector6d moved;
  moved << 0.0, 0.001, 0.0, 0.0, 0.4, 0.3;
  const auto result = compare_surface(cloud, math::Cylinder{{0.0, 0.0, 0.0}, Eigen::Vector3d::UnitX(), 2150.0},
                                      {.reference_from_measured = base::perturbed({}, moved), .best_fit = true});
  ASSERT_TRUE(result.has_value());
  ASSERT_EQ(result->held.size(), 2U);
  const std::string both = result->held[0] + " " + result->held[1];
  EXPECT_THAT(both, HasSubstr("shift along (1.00, "));
  EXPECT_LT(result->rms_mm, 0.1);
  const Eigen::Vector3d middle(0.0, 0.0, 2150.0);
  EXPECT_NEAR((result->reference_from_measured * middle).x(), (base::perturbed({}, moved) * middle).x(), 0.05)
      << "it did not slide";
}

TEST(ShellFit, FindsTheShellAndItsDifferenceFromTheNominal) {
  // A cone: radius 2100 at x = 0, 2135 at x = 3500, over 70 degrees; the axis is inclined by 1 mrad.
  const double half = std::atan(35.0 / 3500.0);
  std::mt19937_64 random(6);
  std::uniform_real_distribution<double> uniform(0.0, 1.0);
  std::normal_distribution<double> normal;
  constexpr int kSeeds = 40;
  Eigen::Vector4d squares = Eigen::Vector4d::Zero();
  for (int seed = 0; seed < kSeeds; ++seed) {
    Cloud cloud;
    const Eigen::Quaterniond turned(Eigen::AngleAxisd(0.001, Eigen::Vector3d::UnitZ()));
    for (int i = 0; i < 600; ++i) {
      const double x = 3500.0 * uniform(random);
      const double phi = 1.22 * (uniform(random) - 0.5);
      const Eigen::Vector3d radial(0.0, std::sin(phi), std::cos(phi));
      const Eigen::Vector3d on = Eigen::Vector3d(x, 0.0, 0.0) + (2100.0 + 0.01 * x) * radial;
      const Eigen::Vector3d outward = std::cos(half) * radial - std::sin(half) * Eigen::Vector3d::UnitX();
      cloud.points.push_back(turned * (on + 0.1 * normal(random) * outward));
    }
    const NominalShell nominal{{0.0, 0.0, 0.0}, Eigen::Vector3d::UnitX(), 2100.0, half};
    const auto fit = compare_shell(cloud, nominal, {.cone = true, .robust = false, .sigma_mm = 0.1, .correlation_mm = 0.0});
    ASSERT_TRUE(fit.has_value()) << fit.error().message;
    EXPECT_NEAR(fit->sigma0, 1.0, 0.15);
    ASSERT_TRUE(fit->difference.has_value());
    const double middle = 0.5 * (fit->low_mm + fit->high_mm);
    EXPECT_LT(std::abs(middle), 100.0);
    // At the ends of the points, in the nominal's heights.
    const auto truth = [&](double along) {
      return 2.0 * (2100.0 + 0.01 * (turned.conjugate() * (fit->point_mm + along * fit->direction)).x());
    };
    squares(0) += std::pow((fit->low_diameter_mm - truth(fit->low_mm)) / fit->low_diameter_sigma_mm, 2);
    squares(1) += std::pow((fit->high_diameter_mm - truth(fit->high_mm)) / fit->high_diameter_sigma_mm, 2);
    squares(2) += std::pow(fit->difference->apex_angle_rad / fit->difference->apex_angle_sigma_rad, 2);
    squares(3) += std::pow((fit->difference->axis_angle_rad - 0.001) / fit->difference->axis_angle_sigma_rad, 2);
  }
  squares /= kSeeds;
  for (int i = 0; i < 4; ++i) EXPECT_NEAR(squares(i), 1.0, 4.0 * std::sqrt(2.0 / kSeeds)) << i;
}

TEST(ShellFit, StraysAreLeftOut) {
  Cloud cloud = shell(2150.0, 0.9, 1200.0, 0.0, 900, 12, 0.05);
  for (int i = 0; i < 60; ++i) cloud.points.emplace_back(10.0 * i - 300.0, 50.0, 2180.0 + 0.3 * i);  // a cable over it
  const auto fit = compare_shell(cloud, std::nullopt, {.cone = false});
  ASSERT_TRUE(fit.has_value()) << fit.error().message;
  EXPECT_NEAR(static_cast<double>(fit->rejected), 60.0, 3.0);
  EXPECT_NEAR(fit->diameter_mm, 4300.0, 4.0 * fit->diameter_sigma_mm);
  EXPECT_LT(fit->rms_mm, 0.06);
}

TEST(ShellFit, FormCountsByPatchesAndNotByPoints) {
  // Patches of 50 mm are off by 0.2 mm each: points of one patch say the same.
  constexpr int kSeeds = 12;
  double honest = 0.0;
  double naive = 0.0;
  for (int seed = 0; seed < kSeeds; ++seed) {
    std::mt19937_64 random(static_cast<unsigned>(seed) + 9U);
    std::normal_distribution<double> normal;
    Cloud cloud;
    for (int row = 0; row < 10; ++row) {
      for (int column = 0; column < 30; ++column) {
        const double off = 0.2 * normal(random);
        for (int k = 0; k < 8; ++k) {
          const double x = 50.0 * row + 6.0 * k;
          const double phi = (50.0 * column + 5.0 * k) / 1000.0;
          cloud.points.emplace_back(x, (1000.0 + off) * std::sin(phi), (1000.0 + off) * std::cos(phi));
        }
      }
    }
    const auto by_patch = compare_shell(cloud, std::nullopt, {.cone = false, .robust = false});
    const auto by_point = compare_shell(cloud, std::nullopt, {.cone = false, .robust = false, .correlation_mm = 0.0});
    ASSERT_TRUE(by_patch && by_point);
    honest += std::pow((by_patch->diameter_mm - 2000.0) / by_patch->diameter_sigma_mm, 2) / kSeeds;
    naive += std::pow((by_point->diameter_mm - 2000.0) / by_point->diameter_sigma_mm, 2) / kSeeds;
  }
  EXPECT_GT(naive, 2.5) << "eight times too sure";
  EXPECT_LT(honest, 1.0 + 4.0 * std::sqrt(2.0 / kSeeds));
  EXPECT_GT(honest, 0.15);
}

TEST(EdgeAgainstEdge, DistancesAndSigmas) {
  const auto rim = [](double radius, double height, int n) {
    base::EdgeCurve edge;
    edge.closed = true;
    for (int i = 0; i < n; ++i) {
      const double phi = 2.0 * pi * i / n;
      base::EdgePoint p;
      p.point_mm = {radius * std::cos(phi), radius * std::sin(phi), height};
      p.normal = Eigen::Vector3d::UnitZ();
      p.sigma_u_mm = 0.03;
      p.sigma_v_mm = 0.04;
      p.s_mm = radius * phi;
      edge.points.push_back(p);
    }
    return edge;
  };
  const auto result = compare_edge(rim(299.9, 0.2, 500), rim(300.0, 0.0, 4000));
  ASSERT_TRUE(result.has_value());
  EXPECT_EQ(result->count, 500U);
  for (std::size_t i = 0; i < 500; ++i) {
    EXPECT_NEAR(result->u_mm[i], 0.1, 1e-3) << "into the opening";
    EXPECT_NEAR(result->v_mm[i], 0.2, 1e-12);
    EXPECT_LT(result->sigma_u_mm[i], 0.03 * std::sqrt(2.0) + 1e-12);
    EXPECT_GE(result->sigma_u_mm[i], 0.03 * std::sqrt(1.5) - 1e-12);
  }
  EXPECT_NEAR(result->rms_mm, std::hypot(0.1, 0.2), 1e-3);
  EXPECT_NEAR(result->max_mm, std::hypot(0.1, 0.2), 1e-3);
  EXPECT_FALSE(compare_edge(rim(300.0, 50.0, 100), rim(300.0, 0.0, 100)).has_value());
}

}  // namespace
}  // namespace crosstie::verify
