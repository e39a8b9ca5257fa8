// Markers on a synthetic wall: their points, the wall beneath and what is masked, against where they were put.
#include "scan/markers.h"

#include <cmath>
#include <numbers>
#include <set>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>

#include "scan/decode.h"
#include "tests/scan/synthetic_scan.h"

namespace crosstie::scan {
namespace {

using base::ImageObservations;
using base::Observation;
using base::ScannedMarker;
using tests::SyntheticScan;

constexpr double kRadius_mm = 900.0;  // of the wall, a cylinder about a line along y
constexpr double kFront_mm = 1150.0;  // its nearest line
constexpr double kDot_mm = 12.0;      // radius of the dots
constexpr double kThickness_mm = 4.0;

/// A wall that bulges towards the cameras.
std::optional<double> cylinder(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction) {
  const Eigen::Vector2d o(origin.x() - 60.0, origin.z() - kFront_mm - kRadius_mm);
  const Eigen::Vector2d d(direction.x(), direction.z());
  const double a = d.squaredNorm(), b = o.dot(d), c = o.squaredNorm() - kRadius_mm * kRadius_mm;
  const double root = b * b - a * c;
  if (root < 0.0) return {};
  return (-b - std::sqrt(root)) / a;
}

/// A marker's dot on it, by the angle round the cylinder and the place along it.
struct Placed {
  Eigen::Vector3d centre_mm;
  Eigen::Vector3d normal;  ///< towards the cameras
};

Placed placed(double angle_rad, double y_mm) {
  const Eigen::Vector3d normal(std::sin(angle_rad), 0.0, -std::cos(angle_rad));
  const Eigen::Vector3d on_wall = Eigen::Vector3d(60.0, y_mm, kFront_mm + kRadius_mm) + kRadius_mm * normal;
  return {on_wall + kThickness_mm * normal, normal};
}

std::vector<Placed> all_placed() {
  std::vector<Placed> markers;
  for (const double angle : {-0.22, -0.07, 0.06, 0.2}) {
    for (const double y : {-150.0, 10.0, 160.0}) markers.push_back(placed(angle, y));
  }
  return markers;
}

/// The ellipse as which a circle appears: the conic through the images of 60 of its points.
Observation ellipse_of(const base::Camera& camera, const base::Pose& camera_from_left, const Placed& marker, double radius_mm) {
  constexpr int kPoints = 60;
  const Eigen::Vector3d across = marker.normal.unitOrthogonal();
  const Eigen::Vector3d other = marker.normal.cross(across);
  std::vector<Eigen::Vector2d> pixels;
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  for (int i = 0; i < kPoints; ++i) {
    const double angle = 2.0 * std::numbers::pi * i / kPoints;
    const Eigen::Vector3d point = marker.centre_mm + radius_mm * (std::cos(angle) * across + std::sin(angle) * other);
    pixels.push_back(*camera.project(camera_from_left * point));
    mean += pixels.back() / kPoints;
  }
  Eigen::Matrix<double, 5, 5> normal = Eigen::Matrix<double, 5, 5>::Zero();
  Eigen::Matrix<double, 5, 1> right = Eigen::Matrix<double, 5, 1>::Zero();
  for (const Eigen::Vector2d& pixel : pixels) {
    const Eigen::Vector2d p = pixel - mean;
    Eigen::Matrix<double, 5, 1> row;
    row << p.x() * p.x(), 2.0 * p.x() * p.y(), p.y() * p.y(), 2.0 * p.x(), 2.0 * p.y();
    normal += row * row.transpose();
    right += row;
  }
  const Eigen::Matrix<double, 5, 1> conic = normal.ldlt().solve(right);  // a x^2 + 2 b x y + c y^2 + 2 d x + 2 e y = 1
  Eigen::Matrix2d shape;
  shape << conic(0), conic(1), conic(1), conic(2);
  const Eigen::Vector2d middle = -shape.inverse() * conic.tail<2>();
  const double level = 1.0 + middle.dot(shape * middle);
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> axes(shape);
  Observation seen;
  seen.centre_px = mean + middle;
  seen.semi_major_px = std::sqrt(level / axes.eigenvalues()(0));
  seen.semi_minor_px = std::sqrt(level / axes.eigenvalues()(1));
  seen.angle_rad = std::atan2(axes.eigenvectors()(1, 0), axes.eigenvectors()(0, 0));
  seen.status = base::ObservationStatus::kCoded;
  return seen;
}

std::array<ImageObservations, 2> observations(const SyntheticScan& scene, std::mt19937_64& random, double sigma_px) {
  std::array<ImageObservations, 2> images;
  std::normal_distribution<double> normal;
  const auto markers = all_placed();
  for (std::size_t i = 0; i < markers.size(); ++i) {
    for (std::size_t camera = 0; camera < 2; ++camera) {
      Observation seen = ellipse_of(camera == 0 ? scene.head.left : scene.head.right,
                                    camera == 0 ? base::Pose{} : scene.head.right_from_left, markers[i], kDot_mm);
      seen.id = static_cast<int>(i);
      seen.centre_px += sigma_px * Eigen::Vector2d(normal(random), normal(random));
      seen.cov_px2 = std::max(1e-8, sigma_px * sigma_px) * Eigen::Matrix2d::Identity();
      images[camera].observations.push_back(seen);
    }
  }
  return images;
}

SyntheticScan wall_scene() {
  SyntheticScan scene;
  scene.surface = cylinder;
  return scene;
}

ScanCloud cloud_of(const SyntheticScan& scene, std::uint64_t seed) {
  const auto sequence = tests::gray_and_fringes(24.0, 6, false, false);
  std::array<base::PhaseMap, 2> maps;
  for (int camera = 0; camera < 2; ++camera) {
    std::mt19937_64 random(seed + static_cast<std::uint64_t>(camera));
    auto decoder = Decoder::make(sequence, scene.width, scene.height, {});
    for (std::size_t i = 0; i < sequence.patterns.size(); ++i)
      EXPECT_TRUE(decoder->add(static_cast<int>(i), scene.image(camera, sequence, sequence.patterns[i], random)));
    maps[static_cast<std::size_t>(camera)] = *decoder->finish();
  }
  const auto depths = match(maps[0], maps[1], scene.head, {});
  return *make_cloud(*depths, maps[0], scene.head, {});
}

MarkerOptions options() {
  MarkerOptions options;
  options.thickness_mm = kThickness_mm;
  options.dot_radius_mm = kDot_mm;
  return options;
}

TEST(ScanMarkers, PointsAndHeightsAreTrueWithinTheirSigmas) {
  constexpr std::size_t kSeeds = 10;
  const SyntheticScan scene = wall_scene();
  const auto truth = all_placed();
  double squares = 0.0, heights = 0.0, height_mean = 0.0, off = 0.0, walls = 0.0;
  int count = 0;
  std::array<ScanCloud, 3> clouds;
  for (std::size_t i = 0; i < clouds.size(); ++i) clouds[i] = cloud_of(scene, 100 + 2 * i);
  for (std::size_t seed = 0; seed < kSeeds; ++seed) {
    std::mt19937_64 random(40 + seed);
    const auto [left, right] = observations(scene, random, 0.02);
    ScanCloud cloud = clouds[seed % clouds.size()];
    EXPECT_GT(mask_markers(cloud, scene.head, left, right, options()), 1000);
    const auto markers = marker_points(cloud, scene.head, left, right, 0, options());
    ASSERT_TRUE(markers) << markers.error().message;
    ASSERT_EQ(markers->size(), truth.size());
    for (const ScannedMarker& marker : *markers) {
      const Placed& placed = truth[static_cast<std::size_t>(marker.id)];
      const Eigen::Vector3d error = marker.p_in_rig_mm - placed.centre_mm;
      squares += error.dot(marker.cov_mm2.ldlt().solve(error)) / 3.0;
      off += std::pow(marker.off_curve_px / marker.off_curve_sigma_px, 2);
      EXPECT_EQ(marker.calibration_cov_mm2.norm(), 0.0) << "the head has no covariance";
      ASSERT_TRUE(marker.on_wall()) << marker.id;
      EXPECT_LT(std::acos(std::min(1.0, marker.normal.dot(placed.normal))), 0.02);
      EXPECT_NEAR((marker.p_in_rig_mm - marker.wall_in_rig_mm).norm(), kThickness_mm, 1e-9);
      heights += std::pow((marker.height_mm - kThickness_mm) / marker.height_sigma_mm, 2);
      height_mean += marker.height_mm - kThickness_mm;
      walls += std::pow(
          std::hypot(marker.wall_in_rig_mm.x() - 60.0, marker.wall_in_rig_mm.z() - kFront_mm - kRadius_mm) - kRadius_mm, 2);
      ++count;
    }
  }
  // 120 markers: 3 sigmas of a mean of squares are 3 sqrt(2 / (3 x 120)), 3 sqrt(2 / 120).
  EXPECT_NEAR(squares / count, 1.0, 0.23);
  EXPECT_NEAR(heights / count, 1.0, 0.39);
  EXPECT_NEAR(off / count, 1.0, 0.39);
  EXPECT_NEAR(height_mean / count, 0.0, 0.06);
  EXPECT_LT(std::sqrt(walls / count), 0.35);
}

TEST(ScanMarkers, CirclesAreMeasuredNotEllipses) {
  const SyntheticScan scene = wall_scene();
  std::mt19937_64 random(1);
  const auto [left, right] = observations(scene, random, 0.0);
  ScanCloud cloud = cloud_of(scene, 60);
  mask_markers(cloud, scene.head, left, right, options());
  const auto markers = marker_points(cloud, scene.head, left, right, 0, options());
  ASSERT_TRUE(markers);
  MarkerOptions unknown = options();
  unknown.dot_radius_mm = 0.0;
  const auto by_ellipse = marker_points(cloud, scene.head, left, right, 0, unknown);
  ASSERT_TRUE(by_ellipse);
  ScanCloud nothing;
  nothing.cloud.fields = {{"sigma_mm", {}}, {"column", {}}, {"row", {}}};
  nothing.depth_mm.assign(static_cast<std::size_t>(scene.width * scene.height), std::nanf(""));
  const auto plain = marker_points(nothing, scene.head, left, right, 0, options());
  ASSERT_TRUE(plain);
  const auto truth = all_placed();
  double reduced = 0.0, sized = 0.0, ellipses = 0.0;
  for (std::size_t i = 0; i < truth.size(); ++i) {
    reduced = std::max(reduced, ((*markers)[i].p_in_rig_mm - truth[i].centre_mm).norm());
    sized = std::max(sized, ((*by_ellipse)[i].p_in_rig_mm - truth[i].centre_mm).norm());
    ellipses = std::max(ellipses, ((*plain)[i].p_in_rig_mm - truth[i].centre_mm).norm());
    EXPECT_FALSE((*plain)[i].on_wall());
  }
  EXPECT_GT(ellipses, 0.05);
  EXPECT_LT(reduced, 0.2 * ellipses);
  EXPECT_LT(sized, 0.2 * ellipses);
}

TEST(ScanMarkers, WhatIsOnMarkersIsLeftOutAndNoMore) {
  const SyntheticScan scene = wall_scene();
  std::mt19937_64 random(2);
  auto [left, right] = observations(scene, random, 0.0);
  ScanCloud cloud = cloud_of(scene, 62);
  const std::size_t before = cloud.cloud.points.size();
  // One is seen by the right camera alone, one is a marker that is not in use, one a dot of another size, which is none.
  left.observations.erase(left.observations.begin());
  left.observations[3].status = base::ObservationStatus::kRefused;
  Observation drop = left.observations[4];
  drop.status = base::ObservationStatus::kUncoded;
  drop.centre_px += Eigen::Vector2d(25.0, 0.0);
  drop.semi_major_px *= 0.3;
  drop.semi_minor_px *= 0.3;
  left.observations.push_back(drop);
  MarkerOptions exact = options();
  exact.mask_margin_px = 0.0;
  const auto masked = mask_markers(cloud, scene.head, left, right, exact);
  EXPECT_EQ(cloud.cloud.points.size() + static_cast<std::size_t>(masked), before);
  std::set<std::pair<int, int>> left_over;
  for (std::size_t i = 0; i < cloud.cloud.points.size(); ++i) {
    left_over.emplace(static_cast<int>(cloud.cloud.fields[cloud.cloud.fields.size() - 2].values[i]),
                      static_cast<int>(cloud.cloud.fields.back().values[i]));
    EXPECT_FALSE(
        std::isnan(cloud.depth_mm[static_cast<std::size_t>(cloud.cloud.fields.back().values[i]) * 320U +
                                  static_cast<std::size_t>(cloud.cloud.fields[cloud.cloud.fields.size() - 2].values[i])]));
  }
  // By geometry: nearer to a marker's axis than 3.6 radii, the plate's rim aside by 2 px, of 2.4 mm.
  int inside = 0;
  for (std::size_t i = 0; i < cloud.cloud.points.size(); ++i) {
    for (const Placed& marker : all_placed()) {
      const Eigen::Vector3d d = cloud.cloud.points[i] - marker.centre_mm;
      if ((d - d.dot(marker.normal) * marker.normal).norm() < 3.6 * kDot_mm - 5.0) ++inside;
    }
  }
  EXPECT_EQ(inside, 0);
  double area_px = 0.0;
  for (const Placed& marker : all_placed()) {
    const Observation seen = ellipse_of(scene.head.left, {}, marker, 3.6 * kDot_mm);
    area_px += std::numbers::pi * seen.semi_major_px * seen.semi_minor_px;
  }
  EXPECT_NEAR(static_cast<double>(masked) / area_px, 1.0, 0.1);
}

TEST(ScanMarkers, NoWallIsSaidWhereTheCloudStandsToOneSide) {
  const SyntheticScan scene = wall_scene();
  std::mt19937_64 random(3);
  const auto [left, right] = observations(scene, random, 0.0);
  ScanCloud cloud = cloud_of(scene, 64);
  const Eigen::Vector3d centre = all_placed()[4].centre_mm;
  // The cloud ends beside the marker.
  base::Cloud half;
  half.fields = cloud.cloud.fields;
  for (auto& one : half.fields) one.values.clear();
  for (std::size_t i = 0; i < cloud.cloud.points.size(); ++i) {
    if (cloud.cloud.points[i].x() < centre.x() + 30.0) continue;
    half.points.push_back(cloud.cloud.points[i]);
    for (std::size_t f = 0; f < half.fields.size(); ++f) half.fields[f].values.push_back(cloud.cloud.fields[f].values[i]);
  }
  cloud.cloud = half;
  const auto markers = marker_points(cloud, scene.head, left, right, 0, options());
  ASSERT_TRUE(markers);
  EXPECT_FALSE((*markers)[4].on_wall());
  EXPECT_TRUE((*markers)[10].on_wall());
}

}  // namespace
}  // namespace crosstie::scan
