// A shell's cone or cylinder: the second half of verify/surface.h.
#include <algorithm>
#include <array>
#include <cmath>
#include <set>

#include <fmt/core.h>
#include <Eigen/Geometry>

#include "math/shape_fit.h"
#include "verify/surface.h"

namespace crosstie::verify {
namespace {

using base::ErrorCode;
using base::Result;
using base::ShapeDeviations;

Result<ShellFit> fit(const std::vector<Eigen::Vector3d>& points, bool cone, bool robust) {
  ShellFit shell;
  shell.is_cone = cone;
  if (cone) {
    auto fitted = math::fit_cone(points, {.robust = robust});
    if (!fitted) return base::fail(std::move(fitted));
    shell.point_mm = fitted->shape.point_mm;
    shell.direction = fitted->shape.direction;
    shell.distance_mm = fitted->shape.distance_mm;
    shell.half_angle_rad = fitted->shape.half_angle_rad;
    shell.quality = std::move(fitted->quality);
    return shell;
  }
  auto fitted = math::fit_cylinder(points, {.robust = robust});
  if (!fitted) return base::fail(std::move(fitted));
  shell.point_mm = fitted->shape.point_mm;
  shell.direction = fitted->shape.direction;
  shell.distance_mm = fitted->shape.radius_mm;
  shell.quality = std::move(fitted->quality);
  return shell;
}

/// Those that are not strays of the shell on which a part of the points agrees robustly.
Result<std::vector<Eigen::Vector3d>> without_strays(const std::vector<Eigen::Vector3d>& points, bool cone) {
  constexpr std::size_t kRobustPoints = 250;  // consensus among more takes long and finds no other shape
  constexpr double kStray = 5.0;              // of the robust scatter
  constexpr double kNormal = 1.4826;          // median absolute deviation to sigma
  std::vector<Eigen::Vector3d> few;
  const std::size_t every = std::max<std::size_t>(1, points.size() / kRobustPoints);
  for (std::size_t i = 0; i < points.size(); i += every) few.push_back(points[i]);
  const auto rough = fit(few, cone, true);
  if (!rough) return tl::unexpected(rough.error());
  const math::Cone as_cone{rough->point_mm, rough->direction, rough->distance_mm, rough->half_angle_rad};
  const math::Cylinder as_cylinder{rough->point_mm, rough->direction, rough->distance_mm};
  std::vector<double> off;
  for (const auto& p : points)
    off.push_back(std::abs(cone ? math::signed_distance_mm(as_cone, p) : math::signed_distance_mm(as_cylinder, p)));
  std::vector<double> sorted = off;
  const auto middle = sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2);
  std::nth_element(sorted.begin(), middle, sorted.end());
  // A rough fit's own error is within a few scatters over the few points' root.
  const double limit = kStray * kNormal * *middle + 1e-9;
  std::vector<Eigen::Vector3d> good;
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (off[i] <= limit) good.push_back(points[i]);
  }
  return good;
}

std::size_t patches_of(const std::vector<Eigen::Vector3d>& points, double size_mm) {
  std::set<std::array<long, 3>> patches;
  for (const auto& p : points) {
    patches.insert({std::lround(std::floor(p.x() / size_mm)), std::lround(std::floor(p.y() / size_mm)),
                    std::lround(std::floor(p.z() / size_mm))});
  }
  return patches.size();
}

ShapeDeviations::Difference difference_from(const NominalShell& nominal, const ShellFit& shell) {
  ShapeDeviations::Difference d;
  const Eigen::Vector3d axis = nominal.axis_direction.normalized();
  const Eigen::Vector3d direction = shell.direction.dot(axis) < 0.0 ? Eigen::Vector3d(-shell.direction) : shell.direction;
  const Eigen::Vector3d tilt = direction - axis.dot(direction) * axis;
  d.axis_angle_rad = std::atan2(tilt.norm(), axis.dot(direction));
  const Eigen::Matrix3d direction_cov = shell.quality.direction_cov_rad2();
  const Eigen::Vector3d tilt_way =
      tilt.norm() > 0.0 ? Eigen::Vector3d(tilt.normalized()) : Eigen::Vector3d(axis.unitOrthogonal());
  d.axis_angle_sigma_rad = std::sqrt(std::max(0.0, tilt_way.dot(direction_cov * tilt_way)));
  const Eigen::Vector3d from_axis = shell.point_mm - nominal.axis_point_mm;
  const double height = axis.dot(from_axis);
  const Eigen::Vector3d off = from_axis - height * axis;
  d.axis_distance_mm = off.norm();
  const Eigen::Vector3d off_way = off.norm() > 0.0 ? Eigen::Vector3d(off.normalized()) : Eigen::Vector3d(axis.unitOrthogonal());
  d.axis_distance_sigma_mm = std::sqrt(std::max(0.0, off_way.dot(shell.quality.point_cov_mm2() * off_way)));
  d.diameter_mm = 2.0 * (shell.radius_mm(0.0) - nominal.radius_mm - height * std::tan(nominal.half_angle_rad));
  d.diameter_sigma_mm = 2.0 * shell.radius_sigma_mm(0.0);
  if (shell.is_cone) {
    // Both angles by the nominal's direction: a fitted cone always opens along its own.
    const double fitted = shell.direction.dot(axis) < 0.0 ? -shell.half_angle_rad : shell.half_angle_rad;
    d.apex_angle_rad = 2.0 * (fitted - nominal.half_angle_rad);
    d.apex_angle_sigma_rad = 2.0 * shell.quality.half_angle_sigma_rad();
  }
  return d;
}

}  // namespace

double ShellFit::radius_mm(double along_mm) const {
  return distance_mm / std::cos(half_angle_rad) + along_mm * std::tan(half_angle_rad);
}

double ShellFit::radius_sigma_mm(double along_mm) const {
  constexpr Eigen::Index kSize = 5;
  constexpr Eigen::Index kAngle = 6;
  const double c = std::cos(half_angle_rad);
  const double by_size = 1.0 / c;
  const double by_angle = is_cone ? (distance_mm * std::sin(half_angle_rad) + along_mm) / (c * c) : 0.0;
  const auto& cov = quality.covariance;
  return std::sqrt(std::max(0.0, by_size * by_size * cov(kSize, kSize) + 2.0 * by_size * by_angle * cov(kSize, kAngle) +
                                     by_angle * by_angle * cov(kAngle, kAngle)));
}

Result<ShellFit> fit_shell(const base::Cloud& measured, const ShellFitOptions& options) {
  if (options.max_points == 0 || !(options.correlation_mm >= 0.0))
    return base::fail(ErrorCode::kUsage, "max_points is positive, correlation_mm not negative");
  std::vector<Eigen::Vector3d> points;
  const std::size_t every = std::max<std::size_t>(1, (measured.points.size() + options.max_points - 1) / options.max_points);
  double noise = 0.0;
  for (std::size_t i = 0; i < measured.points.size(); i += every) {
    points.push_back(measured.points[i]);
    if (!measured.cov_mm2.empty()) noise += measured.cov_mm2[i].trace() / 3.0;
  }
  const std::size_t all = points.size();
  if (options.robust) {
    auto good = without_strays(points, options.cone);
    if (!good) return base::fail(std::move(good));
    points = *std::move(good);
  }
  auto shell = fit(points, options.cone, false);
  if (!shell) return shell;
  const double a_priori = measured.cov_mm2.empty() ? options.sigma_mm * options.sigma_mm : noise / static_cast<double>(all);
  // The covariance is that of sigma0 from the residuals; the larger of it and the noise counts, and patches in place of points.
  double factor = std::max(1.0, a_priori / (shell->quality.sigma0 * shell->quality.sigma0));
  if (options.correlation_mm > 0.0) {
    factor *=
        std::max(1.0, static_cast<double>(points.size()) / static_cast<double>(patches_of(points, options.correlation_mm)));
  }
  shell->quality.covariance *= factor;
  shell->noise_mm = std::sqrt(a_priori);
  shell->strays = all - points.size();
  shell->points_mm = std::move(points);
  return shell;
}

Result<ShapeDeviations> compare_shell(const base::Cloud& measured, const std::optional<NominalShell>& nominal,
                                      const ShellFitOptions& options) {
  const auto shell = fit_shell(measured, options);
  if (!shell) return tl::unexpected(shell.error());
  ShapeDeviations result;
  result.shape = options.cone ? "cone" : "cylinder";
  result.point_mm = shell->point_mm;
  result.direction = shell->direction;
  result.direction_sigma_rad = shell->quality.direction_cov_rad2().diagonal().cwiseMax(0.0).cwiseSqrt();
  result.diameter_mm = 2.0 * shell->radius_mm(0.0);
  result.diameter_sigma_mm = 2.0 * shell->radius_sigma_mm(0.0);
  if (options.cone) {
    result.apex_angle_rad = 2.0 * shell->half_angle_rad;
    result.apex_angle_sigma_rad = 2.0 * shell->quality.half_angle_sigma_rad();
  }
  result.low_mm = HUGE_VAL;
  result.high_mm = -HUGE_VAL;
  for (const auto& p : shell->points_mm) {
    const double along = shell->direction.dot(p - shell->point_mm);
    result.low_mm = std::min(result.low_mm, along);
    result.high_mm = std::max(result.high_mm, along);
  }
  result.low_diameter_mm = 2.0 * shell->radius_mm(result.low_mm);
  result.low_diameter_sigma_mm = 2.0 * shell->radius_sigma_mm(result.low_mm);
  result.high_diameter_mm = 2.0 * shell->radius_mm(result.high_mm);
  result.high_diameter_sigma_mm = 2.0 * shell->radius_sigma_mm(result.high_mm);
  result.rms_mm = shell->quality.rms_mm;
  result.form_mm = shell->quality.form_mm;
  result.sigma0 = shell->noise_mm > 0.0 ? shell->quality.sigma0 / shell->noise_mm : 0.0;
  result.count = shell->quality.count;
  result.rejected = shell->strays;
  result.warnings = shell->quality.warnings;
  if (nominal) result.difference = difference_from(*nominal, *shell);
  return result;
}

}  // namespace crosstie::verify
