#include "math/probed_sphere.h"

#include <algorithm>
#include <cmath>
#include <string>

#include <fmt/format.h>

#include "math/detail/sphere_search.h"

namespace crosstie::math {
namespace {

using base::ErrorCode;
using base::Result;

constexpr int kLattice = 500;
constexpr double kDegrees = 180.0 / std::numbers::pi;

}  // namespace

Result<> SphereProbingOptions::validate() const {
  const auto usage = [](const char* what) { return base::fail(ErrorCode::kUsage, what); };
  if (!(stylus_diameter_mm >= 0.0 && std::isfinite(stylus_diameter_mm))) return usage("stylus diameter: 0 mm or more");
  if (!(probe_sigma_mm > 0.0 && std::isfinite(probe_sigma_mm))) return usage("the probe's sigma must be positive");
  if (diameter_mm && !(*diameter_mm > 0.0 && std::isfinite(*diameter_mm))) return usage("a ball's diameter must be positive");
  if (!(diameter_sigma_mm >= 0.0 && std::isfinite(diameter_sigma_mm))) {
    return usage("the sigma of a ball's diameter must be 0 (held) or positive");
  }
  if (!(least_opening_rad >= 0.0 && least_opening_rad <= 2.0 * std::numbers::pi)) return usage("least opening: 0 to 2 pi");
  return {};
}

double opening_of(std::span<const Eigen::Vector3d> directions) {
  if (directions.empty()) return 0.0;
  const auto value = [&](const Eigen::Vector3d& axis) {
    double least = 1.0;
    for (const Eigen::Vector3d& direction : directions) least = std::min(least, axis.dot(direction));
    return -least;
  };
  detail::DirectionMinimum best{directions[0], value(directions[0])};
  for (const Eigen::Vector3d& axis : detail::lattice_directions(kLattice, false)) {
    if (const double there = value(axis); there < best.value) best = {axis, there};
  }
  best = detail::refined_direction(value, best.direction, 4.0 / std::sqrt(kLattice), 1e-6);
  return 2.0 * std::acos(std::clamp(-best.value, -1.0, 1.0));
}

Result<SphereProbing> fit_probed_sphere(std::span<const Eigen::Vector3d> tip_centres_mm, const SphereProbingOptions& options) {
  if (auto good = options.validate(); !good) return base::fail(std::move(good));
  ShapeFitOptions how;
  how.sigma_mm = options.probe_sigma_mm;
  if (options.diameter_mm) {
    how.radius = {0.5 * (*options.diameter_mm + options.stylus_diameter_mm), 0.5 * options.diameter_sigma_mm};
  }
  const auto fit = fit_sphere(tip_centres_mm, how);
  if (!fit) return tl::unexpected(fit.error());

  SphereProbing ball;
  ball.centre_mm = fit->shape.centre_mm;
  std::vector<Eigen::Vector3d> directions;
  for (const Eigen::Vector3d& tip : tip_centres_mm) directions.push_back((tip - ball.centre_mm).normalized());
  ball.opening_rad = opening_of(directions);
  if (!options.diameter_mm && ball.opening_rad < options.least_opening_rad) {
    return base::fail(
        ErrorCode::kNoUniqueSolution,
        fmt::format("the hits lie in a cap of {:.0f} degrees; with a free diameter the centre needs at least {:.0f}: probe "
                    "further round the ball, or state its diameter",
                    ball.opening_rad * kDegrees, options.least_opening_rad * kDegrees));
  }
  ball.diameter_mm = 2.0 * fit->shape.radius_mm - options.stylus_diameter_mm;
  if (!(ball.diameter_mm > 0.0)) {
    return base::fail(ErrorCode::kBadInput,
                      fmt::format("the tip centres lie on a sphere of {:.3f} mm diameter, smaller than the stylus ({:.3f} mm)",
                                  2.0 * fit->shape.radius_mm, options.stylus_diameter_mm));
  }
  ball.cov_mm2 = fit->quality.point_cov_mm2();
  ball.diameter_sigma_mm = 2.0 * fit->quality.size_sigma_mm();
  ball.form_mm = fit->quality.form_mm;
  ball.sigma0 = fit->quality.sigma0;
  ball.redundancy = fit->quality.redundancy;
  ball.hits = tip_centres_mm.size();
  ball.residuals_mm = fit->quality.residuals_mm;
  ball.warnings = fit->quality.warnings;
  return ball;
}

}  // namespace crosstie::math
