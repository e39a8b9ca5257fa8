// Spheres and ball bars: the first half of verify/acceptance.h.
#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include <fmt/format.h>
#include <Eigen/Cholesky>
#include <Eigen/Geometry>

#include "math/shape_fit.h"
#include "verify/acceptance.h"
#include "verify/detail/form_range.h"

namespace crosstie::verify {
namespace {

using base::ErrorCode;
using base::fail;
using base::Result;
using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr double kDegrees = 180.0 / std::numbers::pi;
const double kRectangular = std::sqrt(12.0);  // width over standard deviation of a rectangular distribution

/// The points that count as a sphere's surface.
struct Cap {
  Vector3d axis = Vector3d::UnitZ();
  std::vector<std::size_t> members;
  std::size_t beyond = 0;       ///< on the surface, but outside of the cap
  std::size_t just_beyond = 0;  ///< of them, within kBand of its border
};

constexpr double kBand = 0.05;  // rad, along the border of a cap

Cap cap_of(const base::Cloud& cloud, const Vector3d& centre, double radius_mm, const AcceptanceOptions& options) {
  std::vector<std::size_t> shell;
  std::vector<Vector3d> directions;
  for (std::size_t i = 0; i < cloud.points.size(); ++i) {
    const Vector3d off = cloud.points[i] - centre;
    const double distance = off.norm();
    if (std::abs(distance - radius_mm) > options.shell * radius_mm || distance == 0.0) continue;
    shell.push_back(i);
    directions.emplace_back(off / distance);
  }
  Cap cap;
  if (shell.empty()) return cap;
  Vector3d sum = Vector3d::Zero();
  for (const Vector3d& d : directions) sum += d;
  const double least_cos = std::cos(0.5 * options.cap());
  const double band_cos = std::cos(std::min(std::numbers::pi, 0.5 * options.cap() + kBand));
  // The mean direction of what lies in the cap, so that a stem or a table beside the sphere does not turn it.
  for (int k = 0; k < 10 && sum.norm() > 0.0; ++k) {
    cap.axis = sum.normalized();
    sum.setZero();
    for (const Vector3d& d : directions) {
      if (d.dot(cap.axis) >= least_cos) sum += d;
    }
  }
  for (std::size_t i = 0; i < shell.size(); ++i) {
    if (directions[i].dot(cap.axis) >= least_cos) {
      cap.members.push_back(shell[i]);
    } else {
      ++cap.beyond;
      cap.just_beyond += directions[i].dot(cap.axis) >= band_cos ? 1 : 0;
    }
  }
  return cap;
}

/// Full opening that directions cover about an axis, the narrowest way across: of eight sectors the angles within which 95 % of their
/// directions lie, opposite ones together.
double opening_about(const Vector3d& axis, const std::vector<Vector3d>& directions) {
  const Vector3d e1 = axis.unitOrthogonal();
  const Vector3d e2 = axis.cross(e1);
  std::array<std::vector<double>, 8> angles;
  for (const Vector3d& d : directions) {
    const double turn = (std::atan2(d.dot(e2), d.dot(e1)) / std::numbers::pi + 1.0) * 4.0;
    angles[static_cast<std::size_t>(std::clamp(turn, 0.0, 7.0))].push_back(std::acos(std::clamp(d.dot(axis), -1.0, 1.0)));
  }
  std::array<double, 8> reach = {};
  for (std::size_t s = 0; s < 8; ++s) {
    if (angles[s].empty()) continue;
    const auto at = angles[s].begin() + static_cast<std::ptrdiff_t>(0.95 * static_cast<double>(angles[s].size() - 1));
    std::nth_element(angles[s].begin(), at, angles[s].end());
    reach[s] = *at;
  }
  double least = HUGE_VAL;
  for (std::size_t s = 0; s < 4; ++s) least = std::min(least, reach[s] + reach[s + 4]);
  return least;
}

/// A least-squares sphere, what was discarded for it, and the linear algebra of its sigmas.
struct Fit {
  math::Sphere sphere;
  std::vector<std::size_t> kept;
  std::vector<std::size_t> discarded;
};

Result<Fit> fit_discarding(const base::Cloud& cloud, const std::vector<std::size_t>& members, double share) {
  const auto permitted = static_cast<std::size_t>(share * static_cast<double>(members.size()));
  Fit fit;
  fit.kept = members;
  for (int round = 0; round < 10; ++round) {
    std::vector<Vector3d> points;
    points.reserve(fit.kept.size());
    for (const std::size_t i : fit.kept) points.push_back(cloud.points[i]);
    const auto sphere = math::fit_sphere(points);
    if (!sphere) return tl::unexpected(sphere.error());
    fit.sphere = sphere->shape;
    std::vector<std::pair<double, std::size_t>> off;
    off.reserve(members.size());
    for (const std::size_t i : members) off.emplace_back(-std::abs(math::signed_distance_mm(fit.sphere, cloud.points[i])), i);
    std::sort(off.begin(), off.end());
    std::vector<std::size_t> discarded;
    for (std::size_t k = 0; k < permitted; ++k) discarded.push_back(off[k].second);
    std::sort(discarded.begin(), discarded.end());
    if (discarded == fit.discarded) break;
    fit.discarded = std::move(discarded);
    fit.kept.clear();
    std::set_difference(members.begin(), members.end(), fit.discarded.begin(), fit.discarded.end(),
                        std::back_inserter(fit.kept));
  }
  return fit;
}

}  // namespace

Result<base::MeasuredSphere> measure_sphere(const base::Cloud& cloud, const SphereArtefact& artefact,
                                            const AcceptanceOptions& options) {
  if (auto ok = options.validate(); !ok) return fail(std::move(ok));
  if (!(artefact.diameter_mm > 0.0) || !(artefact.diameter_sigma_mm >= 0.0) || !(artefact.form_mm >= 0.0))
    return fail(ErrorCode::kUsage,
                fmt::format("sphere {}: its diameter is positive, its sigma and form are not negative", artefact.name));
  const double radius = 0.5 * artefact.diameter_mm;
  Vector3d centre;
  if (artefact.near_mm) {
    centre = *artefact.near_mm;
  } else {
    const auto found = find_spheres(cloud, artefact.diameter_mm);
    if (found.empty()) {
      return fail(ErrorCode::kNoUniqueSolution,
                  fmt::format("sphere {}: no sphere of {} mm is in the cloud; give near_mm, a place near its centre",
                              artefact.name, artefact.diameter_mm));
    }
    centre = found.front();
  }
  // A given place is good to half a radius: first by all that is near, then by the cap.
  AcceptanceOptions choice = options;
  choice.shell = artefact.near_mm ? 0.5 : options.shell;
  Cap cap;
  Fit fit;
  for (int round = 0; round < 12; ++round) {
    cap = cap_of(cloud, centre, radius, choice);
    if (cap.members.size() < options.least_points) {
      return fail(
          ErrorCode::kNoUniqueSolution,
          fmt::format("sphere {}: {} points of it in a cap of {:.0f} degrees, {} are needed: scan it finer, nearer, or with a "
                      "larger sphere",
                      artefact.name, cap.members.size(), options.cap() * kDegrees, options.least_points));
    }
    auto fitted = fit_discarding(cloud, cap.members, round < 3 ? 0.0 : options.discard_share);
    if (!fitted) return fail(fitted.error().code, fmt::format("sphere {}: {}", artefact.name, fitted.error().message));
    const double moved = (fitted->sphere.centre_mm - centre).norm();
    fit = *std::move(fitted);
    centre = fit.sphere.centre_mm;
    const bool settled = round > 3 && moved < 1e-6 * radius;
    choice.shell = std::max(options.shell, 0.5 * choice.shell);
    if (settled) break;
  }

  base::MeasuredSphere result;
  result.name = artefact.name;
  result.centre_mm = fit.sphere.centre_mm;
  result.diameter_mm = 2.0 * fit.sphere.radius_mm;
  detail::FormPoints points;
  const auto count = static_cast<Eigen::Index>(fit.kept.size());
  points.deviation_mm.resize(count);
  points.variance_mm2 = Eigen::VectorXd::Zero(count);
  points.design.resize(count, 4);
  std::vector<Vector3d> directions;
  const Vector3d e1 = cap.axis.unitOrthogonal();
  const Vector3d e2 = cap.axis.cross(e1);
  Eigen::Vector4d excess = Eigen::Vector4d::Zero();  // of the normal equations, by noise of second order
  Eigen::Vector4d over_border = Eigen::Vector4d::Zero();
  std::size_t in_band = 0;
  const double band_cos = std::cos(std::max(0.0, 0.5 * options.cap() - kBand));
  for (Eigen::Index k = 0; k < count; ++k) {
    const std::size_t i = fit.kept[static_cast<std::size_t>(k)];
    const Vector3d off = cloud.points[i] - result.centre_mm;
    const double distance = off.norm();
    const Vector3d n = off / distance;
    directions.push_back(n);
    points.deviation_mm(k) = distance - fit.sphere.radius_mm;
    points.design.row(k) << n.transpose(), 1.0;
    const double flat = fit.sphere.radius_mm * std::sqrt(2.0 / std::max(1e-9, 1.0 + n.dot(cap.axis)));  // Lambert, equal area
    points.place_mm.emplace_back(flat * n.dot(e1), flat * n.dot(e2));
    if (cloud.cov_mm2.empty()) continue;
    const Matrix3d& cov = cloud.cov_mm2[i];
    points.variance_mm2(k) = n.dot(cov * n);
    const double outward = 0.5 * (cov.trace() - points.variance_mm2(k)) / fit.sphere.radius_mm;
    excess += outward * points.design.row(k).transpose();
    excess.head<3>() += (cov * n - points.variance_mm2(k) * n) / fit.sphere.radius_mm;
    if (n.dot(cap.axis) >= band_cos) continue;
    // Noise along the surface brings points over the border whose noise along the normal goes with it.
    ++in_band;
    const Vector3d inward = (cap.axis - cap.axis.dot(n) * n).normalized();
    over_border += inward.dot(cov * n) / (kBand * fit.sphere.radius_mm) * points.design.row(k).transpose();
  }
  // Where the surface as seen ends there by itself nothing comes over.
  if (2 * cap.just_beyond > in_band) excess += over_border;
  base::FormFigures& figures = result.form_figures;
  figures.count = cap.members.size();
  figures.discarded = fit.discarded.size();
  figures.beyond_cap = cap.beyond;
  figures.rms_mm = std::sqrt(points.deviation_mm.squaredNorm() / static_cast<double>(count - 4));
  if (!cloud.cov_mm2.empty()) {
    figures.point_sigma_mm = std::sqrt(points.variance_mm2.mean());
    figures.predicted_mm = detail::predicted_range(points.variance_mm2, options.discard_share);
  }
  result.cap_rad = opening_about(cap.axis, directions);
  if (result.cap_rad < options.least_cap()) {
    return fail(
        ErrorCode::kNoUniqueSolution,
        fmt::format("sphere {}: its points cover {:.0f} degrees the narrowest way across, {:.0f} are needed: radius and centre "
                    "are not told apart. Look at it from nearer its front, or see least_cap_deg",
                    artefact.name, result.cap_rad * kDegrees, options.least_cap() * kDegrees));
  }
  detail::raise_to_scatter(points, count);
  const detail::Correlation correlation = detail::correlation_of(points);
  figures.independent_share = correlation.share;
  figures.correlation_mm = correlation.place_mm;
  const Eigen::Matrix4d inverse = (points.design.transpose() * points.design).inverse();
  const Eigen::Matrix4d covariance =
      inverse * (points.design.transpose() * points.variance_mm2.asDiagonal() * points.design) * inverse / correlation.share;
  result.cov_mm2 = covariance.topLeftCorner<3, 3>();
  result.diameter_sigma_mm = 2.0 * std::sqrt(covariance(3, 3));
  result.size_bias_mm = 2.0 * (inverse * excess)(3);
  // With the radius held.
  std::vector<Vector3d> kept;
  for (const std::size_t i : fit.kept) kept.push_back(cloud.points[i]);
  const auto held = math::fit_sphere(kept, {.radius = math::RadiusKnowledge{radius, 0.0}});
  if (!held) return fail(held.error().code, fmt::format("sphere {}: {}", artefact.name, held.error().message));
  result.held_centre_mm = held->shape.centre_mm;
  const Matrix3d held_inverse = (points.design.leftCols<3>().transpose() * points.design.leftCols<3>()).inverse();
  result.held_cov_mm2 =
      held_inverse *
      (points.design.leftCols<3>().transpose() * points.variance_mm2.asDiagonal() * points.design.leftCols<3>()) *
      held_inverse / correlation.share;
  const Vector3d by_radius = held_inverse * points.design.leftCols<3>().colwise().sum().transpose();
  result.held_cov_mm2 += 0.25 * artefact.diameter_sigma_mm * artefact.diameter_sigma_mm * by_radius * by_radius.transpose();

  const auto [low, high] = std::minmax_element(points.deviation_mm.begin(), points.deviation_mm.end());
  result.form.value_mm = *high - *low;
  // The discarded points are drawn, too: what may be discarded is part of the rule.
  detail::FormPoints all = points;
  const auto more = static_cast<Eigen::Index>(fit.discarded.size());
  all.deviation_mm.conservativeResize(count + more);
  all.design.conservativeResize(count + more, 4);
  for (Eigen::Index k = 0; k < more; ++k) {
    const Vector3d off = cloud.points[fit.discarded[static_cast<std::size_t>(k)]] - result.centre_mm;
    const Vector3d n = off.normalized();
    all.deviation_mm(count + k) = off.norm() - fit.sphere.radius_mm;
    all.design.row(count + k) << n.transpose(), 1.0;
    const double flat = fit.sphere.radius_mm * std::sqrt(2.0 / std::max(1e-9, 1.0 + n.dot(cap.axis)));
    all.place_mm.emplace_back(flat * n.dot(e1), flat * n.dot(e2));
  }
  result.form.noise_sigma_mm = detail::range_sigma(all, options.discard_share, correlation.place_mm, options.resamples);
  result.form.artefact_sigma_mm = artefact.form_mm / kRectangular;
  result.size = {result.diameter_mm - artefact.diameter_mm, result.diameter_sigma_mm, artefact.diameter_sigma_mm};
  figures.deviations_mm.assign(points.deviation_mm.begin(), points.deviation_mm.end());
  figures.places_mm = std::move(points.place_mm);
  return result;
}

Result<base::AcceptancePosition> measure_bar(const base::Cloud& cloud, const BarArtefact& artefact,
                                             const AcceptanceOptions& options) {
  constexpr double kRightWithin = 0.03;
  const double length = artefact.length_at_temperature_mm();
  if (!(length > 0.0)) return fail(ErrorCode::kUsage, "the bar's length must be positive");
  SphereArtefact a = artefact.a;
  SphereArtefact b = artefact.b;
  if (a.near_mm.has_value() != b.near_mm.has_value())
    return fail(ErrorCode::kUsage, "near_mm of a bar is given for both of its spheres or for none");
  if (!a.near_mm) {
    const auto of_a = find_spheres(cloud, a.diameter_mm);
    const auto of_b = find_spheres(cloud, b.diameter_mm);
    double best = kRightWithin * length;
    for (const Vector3d& p : of_a) {
      for (const Vector3d& q : of_b) {
        const double off = std::abs((p - q).norm() - length);
        if (off >= best) continue;
        best = off;
        a.near_mm = p;
        b.near_mm = q;
      }
    }
    if (!a.near_mm) {
      return fail(
          ErrorCode::kNoUniqueSolution,
          fmt::format(
              "no two spheres of {} and {} mm are {:.1f} mm apart in the cloud ({} and {} found); give a place near the "
              "centre of each",
              a.diameter_mm, b.diameter_mm, length, of_a.size(), of_b.size()));
    }
  }
  base::AcceptancePosition position;
  position.artefact = "bar";
  for (const SphereArtefact* sphere : {&a, &b}) {
    auto measured = measure_sphere(cloud, *sphere, options);
    if (!measured) return fail(std::move(measured));
    position.spheres.push_back(*std::move(measured));
  }
  const base::MeasuredSphere& first = position.spheres[0];
  const base::MeasuredSphere& second = position.spheres[1];
  base::SphereSpacing spacing;
  spacing.calibrated_mm = length;
  const double by_temperature = artefact.length_mm * artefact.cte_per_k * artefact.temperature_sigma_c;
  const double artefact_sigma = std::hypot(artefact.length_sigma_mm, by_temperature);
  const auto error_of = [&](const Vector3d& p, const Matrix3d& cov_p, const Vector3d& q, const Matrix3d& cov_q) {
    const Vector3d along = (q - p).normalized();
    return base::AcceptanceValue{(q - p).norm() - length, std::sqrt(along.dot((cov_p + cov_q) * along)), artefact_sigma};
  };
  spacing.measured_mm = (second.centre_mm - first.centre_mm).norm();
  spacing.error = error_of(first.centre_mm, first.cov_mm2, second.centre_mm, second.cov_mm2);
  spacing.held_error = error_of(first.held_centre_mm, first.held_cov_mm2, second.held_centre_mm, second.held_cov_mm2);
  spacing.length_error.value_mm = spacing.error.value_mm + 0.5 * (first.size.value_mm + second.size.value_mm);
  // Noise of centres and diameters of one sphere goes together; along a bar across the view it hardly does, and not at all is taken.
  spacing.length_error.noise_sigma_mm =
      std::hypot(spacing.error.noise_sigma_mm, 0.5 * first.size.noise_sigma_mm, 0.5 * second.size.noise_sigma_mm);
  spacing.length_error.artefact_sigma_mm =
      std::hypot(artefact_sigma, 0.5 * first.size.artefact_sigma_mm, 0.5 * second.size.artefact_sigma_mm);
  position.spacing = spacing;
  return position;
}

}  // namespace crosstie::verify
