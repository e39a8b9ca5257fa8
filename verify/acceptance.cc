#include "verify/acceptance.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include <fmt/format.h>
#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <Eigen/LU>

#include "math/shape_fit.h"
#include "verify/detail/form_range.h"

namespace crosstie::verify {
namespace {

using base::AcceptanceCharacteristic;
using base::AcceptanceValue;
using base::ErrorCode;
using base::fail;
using base::Result;
using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double kDegree = std::numbers::pi / 180.0;
const double kRectangular = std::sqrt(12.0);  // width over standard deviation of a rectangular distribution

/// The convex hull, counter-clockwise (Andrew's monotone chain).
std::vector<Vector2d> hull_of(std::vector<Vector2d> points) {
  std::sort(points.begin(), points.end(),
            [](const Vector2d& a, const Vector2d& b) { return a.x() < b.x() || (a.x() == b.x() && a.y() < b.y()); });
  const auto turn = [](const Vector2d& o, const Vector2d& a, const Vector2d& b) {
    return (a.x() - o.x()) * (b.y() - o.y()) - (a.y() - o.y()) * (b.x() - o.x());
  };
  std::vector<Vector2d> hull;
  for (int pass = 0; pass < 2; ++pass) {
    const std::size_t first = hull.size();
    for (const Vector2d& p : points) {
      while (hull.size() >= first + 2 && turn(hull[hull.size() - 2], hull.back(), p) <= 0.0) hull.pop_back();
      hull.push_back(p);
    }
    hull.pop_back();
    std::reverse(points.begin(), points.end());
  }
  return hull;
}

/// Distance of a point inside of a hull from its border.
double border_distance(const std::vector<Vector2d>& hull, const Vector2d& p) {
  double least = HUGE_VAL;
  for (std::size_t i = 0; i < hull.size(); ++i) {
    const Vector2d side = hull[(i + 1) % hull.size()] - hull[i];
    if (side.norm() > 0.0) least = std::min(least, (side.x() * (p - hull[i]).y() - side.y() * (p - hull[i]).x()) / side.norm());
  }
  return least;
}

Result<math::Plane> plane_through(const base::Cloud& cloud, const std::vector<std::size_t>& members, bool robust) {
  constexpr std::size_t kRobustPoints = 400;
  std::vector<Vector3d> points;
  const std::size_t every = robust ? std::max<std::size_t>(1, members.size() / kRobustPoints) : 1;
  for (std::size_t k = 0; k < members.size(); k += every) points.push_back(cloud.points[members[k]]);
  const auto fit = math::fit_plane(points, {.robust = robust});
  if (!fit) return tl::unexpected(fit.error());
  return fit->shape;
}

}  // namespace

double AcceptanceOptions::cap() const { return cap_rad.value_or((part == 3 ? 240.0 : 120.0) * kDegree); }
double AcceptanceOptions::least_cap() const { return least_cap_rad.value_or((part == 3 ? 180.0 : 90.0) * kDegree); }

Result<> AcceptanceOptions::validate() const {
  const auto bad = [](const char* what) { return fail(ErrorCode::kUsage, fmt::format("acceptance: {}", what)); };
  if (part != 2 && part != 3) return bad("part is 2 or 3");
  if (!(discard_share >= 0.0 && discard_share < 0.5)) return bad("discard_share is not in [0, 0.5)");
  if (!(cap() > 0.0 && cap() <= 2.0 * std::numbers::pi)) return bad("the cap is not in (0, 360] degrees");
  if (!(least_cap() >= 0.0 && least_cap() <= cap())) return bad("the least cap is negative or above the cap");
  if (!(shell > 0.0 && shell < 0.5)) return bad("shell is not in (0, 0.5)");
  if (!(plate_gate_mm > 0.0) || !(plate_border_mm >= 0.0)) return bad("the plate's gate is positive, its border not negative");
  if (least_points < 20) return bad("least_points is 20 or more");
  if (resamples < 2) return bad("resamples is 2 or more");
  return {};
}

Result<base::MeasuredPlane> measure_plane(const base::Cloud& cloud, const PlaneArtefact& artefact,
                                          const AcceptanceOptions& options) {
  if (auto ok = options.validate(); !ok) return fail(std::move(ok));
  if (artefact.near_mm && !(artefact.radius_mm > 0.0)) return fail(ErrorCode::kUsage, "plane: near_mm needs radius_mm");
  std::vector<std::size_t> members;
  for (std::size_t i = 0; i < cloud.points.size(); ++i) {
    if (!artefact.near_mm || (cloud.points[i] - *artefact.near_mm).norm() <= artefact.radius_mm) members.push_back(i);
  }
  const auto few = [&](std::size_t count) {
    return fail(ErrorCode::kNoUniqueSolution,
                fmt::format("plane: {} points of it, {} are needed", count, options.least_points));
  };
  if (members.size() < options.least_points) return few(members.size());
  auto plane = plane_through(cloud, members, true);
  if (!plane) return fail(std::move(plane));
  std::erase_if(members, [&](std::size_t i) {
    return std::abs(math::signed_distance_mm(*plane, cloud.points[i])) > options.plate_gate_mm;
  });
  const Vector3d e1 = plane->normal.unitOrthogonal();
  const Vector3d e2 = plane->normal.cross(e1);
  const auto flat = [&](std::size_t i) {
    const Vector3d off = cloud.points[i] - plane->point_mm;
    return Vector2d(off.dot(e1), off.dot(e2));
  };
  std::vector<Vector2d> places;
  for (const std::size_t i : members) places.push_back(flat(i));
  const std::vector<Vector2d> hull = hull_of(places);
  base::MeasuredPlane result;
  base::FormFigures& figures = result.form_figures;
  std::vector<std::size_t> inside;
  for (std::size_t k = 0; k < members.size(); ++k) {
    if (border_distance(hull, places[k]) >= options.plate_border_mm) inside.push_back(members[k]);
  }
  figures.beyond_cap = members.size() - inside.size();
  figures.count = inside.size();
  if (inside.size() < options.least_points) return few(inside.size());

  const auto permitted = static_cast<std::size_t>(options.discard_share * static_cast<double>(inside.size()));
  std::vector<std::size_t> discarded;
  std::vector<std::size_t> kept = inside;
  for (int round = 0; round < 10; ++round) {
    plane = plane_through(cloud, kept, false);
    if (!plane) return fail(std::move(plane));
    std::vector<std::pair<double, std::size_t>> off;
    for (const std::size_t i : inside) off.emplace_back(-std::abs(math::signed_distance_mm(*plane, cloud.points[i])), i);
    std::sort(off.begin(), off.end());
    std::vector<std::size_t> now;
    for (std::size_t k = 0; k < permitted; ++k) now.push_back(off[k].second);
    std::sort(now.begin(), now.end());
    if (now == discarded) break;
    discarded = std::move(now);
    kept.clear();
    std::set_difference(inside.begin(), inside.end(), discarded.begin(), discarded.end(), std::back_inserter(kept));
  }
  figures.discarded = discarded.size();
  result.point_mm = plane->point_mm;
  result.normal = plane->normal;

  // The kept ones first, then the discarded, which are drawn, too: what may be discarded is part of the rule.
  detail::FormPoints points;
  std::vector<std::size_t> order = kept;
  order.insert(order.end(), discarded.begin(), discarded.end());
  const auto all = static_cast<Eigen::Index>(order.size());
  const auto count = static_cast<Eigen::Index>(kept.size());
  points.deviation_mm.resize(all);
  points.variance_mm2 = Eigen::VectorXd::Zero(all);
  points.design.resize(all, 3);
  for (Eigen::Index k = 0; k < all; ++k) {
    const std::size_t i = order[static_cast<std::size_t>(k)];
    const Vector2d at = flat(i);
    points.place_mm.push_back(at);
    points.deviation_mm(k) = math::signed_distance_mm(*plane, cloud.points[i]);
    points.design.row(k) << 1.0, at.x(), at.y();
    if (!cloud.cov_mm2.empty()) points.variance_mm2(k) = plane->normal.dot(cloud.cov_mm2[i] * plane->normal);
  }
  const auto deviations = points.deviation_mm.head(count);
  figures.rms_mm = std::sqrt(deviations.squaredNorm() / static_cast<double>(count - 3));
  if (!cloud.cov_mm2.empty()) {
    figures.point_sigma_mm = std::sqrt(points.variance_mm2.mean());
    figures.predicted_mm = detail::predicted_range(points.variance_mm2, options.discard_share);
  }
  detail::raise_to_scatter(points, count);
  const detail::Correlation correlation = detail::correlation_of(points);
  figures.independent_share = correlation.share;
  figures.correlation_mm = correlation.place_mm;
  const auto [low, high] = std::minmax_element(deviations.begin(), deviations.end());
  result.flatness.value_mm = *high - *low;
  result.flatness.noise_sigma_mm = detail::range_sigma(points, options.discard_share, correlation.place_mm, options.resamples);
  result.flatness.artefact_sigma_mm = artefact.form_mm / kRectangular;
  for (const Vector2d& p : hull) {
    for (const Vector2d& q : hull) result.length_mm = std::max(result.length_mm, (p - q).norm());
  }
  figures.deviations_mm.assign(deviations.begin(), deviations.end());
  points.place_mm.resize(kept.size());
  figures.places_mm = std::move(points.place_mm);
  return result;
}

namespace {

/// A characteristic, filled position by position.
class Judge {
 public:
  Judge(std::string name, std::string about, std::size_t asked, const std::optional<double>& limit) {
    result_.name = std::move(name);
    result_.about = std::move(about);
    result_.positions_asked = asked;
    result_.limit_mm = limit;
  }
  void add(const std::string& place, const AcceptanceValue& value) {
    if (result_.positions == 0 || std::abs(value.value_mm) > std::abs(result_.value.value_mm)) {
      result_.value = value;
      result_.worst = place;
    }
    ++result_.positions;
    if (result_.limit_mm) {
      constexpr double kCoverage = 2.0;
      const auto level = base::judge_upper_limit(std::abs(value.value_mm), *result_.limit_mm, kCoverage * value.sigma_mm());
      result_.level = std::max(result_.level, level);
    }
  }
  void take(base::Acceptance& acceptance) {
    if (result_.positions == 0) {
      if (result_.limit_mm) {
        acceptance.warnings.push_back(
            {"not_measured", result_.name, fmt::format("{} has a limit, but no position measures it", result_.name)});
      }
      return;
    }
    if (result_.positions < result_.positions_asked) {
      acceptance.warnings.push_back(
          {"too_few_positions", result_.name,
           fmt::format("{}: {} positions, the guideline asks for {}; this is a check in between and no acceptance test",
                       result_.name, result_.positions, result_.positions_asked)});
    }
    acceptance.characteristics.push_back(std::move(result_));
  }

 private:
  AcceptanceCharacteristic result_;
};

void about_points(const std::string& place, const base::FormFigures& figures, std::vector<base::Warning>& warnings) {
  constexpr double kBeyondNoise = 1.5;
  if (figures.predicted_mm > 0.0 && figures.rms_mm > kBeyondNoise * figures.point_sigma_mm) {
    warnings.push_back({"beyond_noise", place,
                        fmt::format("{}: the deviations are {:.1f} times what the points' own sigmas say; form, calibration or "
                                    "sigmas that are too small",
                                    place, figures.rms_mm / figures.point_sigma_mm)});
  }
}

/// Adds the warning, with its message, where a size is not what the guideline asks for.
void about_size(base::Warning warning, double size, double low, double high, double diagonal,
                std::vector<base::Warning>& warnings) {
  if (!(diagonal > 0.0) || (size >= low * diagonal && size <= high * diagonal)) return;
  warning.message =
      fmt::format("{}: {:.1f} mm; the guideline asks for {} of the measuring volume's diagonal of {:.0f} mm", warning.subject,
                  size, high < 10.0 ? fmt::format("{} to {}", low, high) : fmt::format("at least {}", low), diagonal);
  warnings.push_back(std::move(warning));
}

}  // namespace

base::Acceptance judge_acceptance(std::vector<base::AcceptancePosition> positions, const AcceptanceLimits& limits, int part,
                                  double volume_diagonal_mm) {
  base::Acceptance acceptance;
  acceptance.part = part;
  Judge form("PF", "probing error, form: range of the radial deviations from the least-squares sphere", 10, limits.form_mm);
  Judge size("PS", "probing error, size: measured less calibrated diameter", 10, limits.size_mm);
  Judge spacing("SD", "sphere-spacing error: measured less calibrated distance of two centres", 7, limits.spacing_mm);
  Judge flatness("F", "flatness measurement error: range of the deviations from the least-squares plane", 6,
                 limits.flatness_mm);
  Judge length("E", "length measurement error: of the length over both spheres", 7, limits.length_mm);
  for (const base::AcceptancePosition& position : positions) {
    for (const base::MeasuredSphere& sphere : position.spheres) {
      const std::string place = position.spheres.size() > 1 ? position.name + ", sphere " + sphere.name : position.name;
      form.add(place, sphere.form);
      size.add(place, sphere.size);
      about_points(place, sphere.form_figures, acceptance.warnings);
      about_size(base::Warning{"sphere_size", place, ""}, sphere.diameter_mm, 0.1, 0.2, volume_diagonal_mm,
                 acceptance.warnings);
      if (std::abs(sphere.size_bias_mm) > sphere.size.sigma_mm()) {
        acceptance.warnings.push_back(
            {"noise_bias", place,
             fmt::format(
                 "{}: noise alone changes the least-squares diameter by {:+.4f} mm, more than its sigma; PS has it in it",
                 place, sphere.size_bias_mm)});
      }
    }
    if (position.spacing) {
      spacing.add(position.name, position.spacing->error);
      if (part == 3) length.add(position.name, position.spacing->length_error);
      about_size(base::Warning{"bar_length", position.name, ""}, position.spacing->calibrated_mm, 0.3, HUGE_VAL,
                 volume_diagonal_mm, acceptance.warnings);
    }
    if (position.plane) {
      flatness.add(position.name, position.plane->flatness);
      about_points(position.name, position.plane->form_figures, acceptance.warnings);
      about_size(base::Warning{"plate_length", position.name, ""}, position.plane->length_mm, 0.5, HUGE_VAL, volume_diagonal_mm,
                 acceptance.warnings);
    }
  }
  for (Judge* judge : {&form, &size, &spacing, &length, &flatness}) judge->take(acceptance);
  acceptance.positions = std::move(positions);
  return acceptance;
}

}  // namespace crosstie::verify
