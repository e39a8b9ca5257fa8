#include "bundle/commission.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "bundle/detail/axis_motion.h"
#include "bundle/detail/eccentricity.h"
#include "bundle/detail/head_model.h"
#include "bundle/detail/head_outcome.h"
#include "bundle/detail/head_survey.h"
#include "bundle/detail/outliers.h"
#include "bundle/detail/sphere_pairs.h"
#include "math/cofactors.h"
#include "math/distributions.h"
#include "math/solution.h"

namespace crosstie::bundle {
namespace {

using base::ErrorCode;
using base::fail;
using base::Result;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::Vector3d;

constexpr int kMaxRounds = 40;
constexpr double kSameFactor = 0.01;  // of the image sigmas, at which their estimation ends
constexpr double kSameCentre_px = 1e-3;
constexpr std::size_t kLeastSpheres = 3;

/// The state of one commissioning as it is being solved.
struct Work {
  const CommissionInput& input;
  const CommissionOptions& options;
  detail::HeadSurvey survey;
  detail::SpherePairs spheres;
  detail::HeadState state;
  double factor = 1.0;
  double eccentricity_px = 0.0;
};

/// Reduces the measured ellipse centres to those of the circles. Returns the largest change of a centre.
double reduce_centres(Work& work) {
  double change = 0.0;
  work.eccentricity_px = 0.0;
  const std::size_t count = work.input.cross.markers.size();
  std::vector<std::vector<int>> rays(count);
  for (std::size_t r = 0; r < work.survey.rays.size(); ++r) {
    const detail::HeadRay& ray = work.survey.rays[r];
    if (ray.active && ray.shape_px2.trace() > 0.0) rays[static_cast<std::size_t>(ray.marker)].push_back(static_cast<int>(r));
  }
  const base::Pose right_from_left = work.state.rig_from_right.inverse();
  for (std::size_t m = 0; m < count; ++m) {
    std::vector<detail::CircleView> views;
    for (const int r : rays[m]) {
      const detail::HeadRay& ray = work.survey.rays[static_cast<std::size_t>(r)];
      const detail::HeadImage& image = work.survey.images[static_cast<std::size_t>(ray.image)];
      const base::Pose rig_from_cross = work.survey.stations[static_cast<std::size_t>(image.station)].cross_from_rig->inverse();
      const bool right = image.camera == 1;
      views.push_back({right ? work.input.head.right.model() : work.input.head.left.model(),
                       right ? work.state.right.data() : work.state.left.data(),
                       right ? right_from_left * rig_from_cross : rig_from_cross, ray.shape_px2});
    }
    const auto circle = detail::circle_of(views, work.state.markers[m]);
    if (!circle) continue;
    for (std::size_t i = 0; i < views.size(); ++i) {
      const auto offset = detail::eccentricity_px(views[i], work.state.markers[m], *circle);
      if (!offset) continue;
      detail::HeadRay& ray = work.survey.rays[static_cast<std::size_t>(rays[m][i])];
      const Eigen::Vector2d reduced = ray.ellipse_px - *offset;
      change = std::max(change, (reduced - ray.measured_px).norm());
      work.eccentricity_px = std::max(work.eccentricity_px, offset->norm());
      ray.measured_px = reduced;
    }
  }
  return change;
}

struct Solved {
  detail::HeadModel head;
  math::Solution solution;
};

Result<Solved> solve_once(Work& work, const detail::AxisModel* axis, const base::Progress& progress) {
  auto head = detail::build_head_model(work.input, work.survey, work.spheres, work.state, work.factor, axis);
  if (!head) return fail(std::move(head));
  auto solution = math::solve(head->model, math::no_null_space, {}, progress);
  if (!solution) return fail(std::move(solution));
  detail::read_back(*head, work.state, work.survey);
  return Solved{std::move(*head), std::move(*solution)};
}

/// One more factor for the sigmas of the image points, that makes their residuals true.
double image_factor(const Solved& at) {
  double square = 0.0;
  double redundancy = 0.0;
  for (std::size_t g = 0; g < at.head.groups.size(); ++g) {
    if (at.head.groups[g].kind != detail::HeadGroup::Kind::kImagePoint) continue;
    square += at.solution.rows.residual(static_cast<int>(g)).squaredNorm();
    redundancy += at.solution.residual_cofactors()[g].trace();
  }
  return redundancy > 1.0 ? std::sqrt(square / redundancy) : 1.0;
}

/// Takes out the image points whose residuals no chance explains: the largest, and those of other images and markers that are at least
/// half as large. Returns how many.
int reject_rays(Work& work, const Solved& at) {
  struct Suspect {
    double w = 0.0;
    std::size_t ray = 0;
  };
  std::vector<Suspect> suspects;
  int count = 0;
  for (std::size_t g = 0; g < at.head.groups.size(); ++g) {
    if (at.head.groups[g].kind != detail::HeadGroup::Kind::kImagePoint) continue;
    ++count;
    const double w = detail::standardised(at.solution.rows.residual(static_cast<int>(g)), at.solution.residual_cofactors()[g]);
    suspects.push_back({w, static_cast<std::size_t>(at.head.groups[g].index)});
  }
  const double limit = std::sqrt(0.5 * math::chi_square_quantile(1.0 - work.options.rejection_significance / count, 2.0));
  std::sort(suspects.begin(), suspects.end(), [](const auto& a, const auto& b) { return a.w > b.w; });
  int rejected = 0;
  std::vector<int> markers;
  for (const Suspect& suspect : suspects) {
    if (suspect.w < limit || suspect.w < 0.5 * suspects.front().w) break;
    detail::HeadRay& ray = work.survey.rays[suspect.ray];
    if (std::find(markers.begin(), markers.end(), ray.marker) != markers.end()) continue;
    markers.push_back(ray.marker);
    ray.active = false;
    ray.w = suspect.w;
    ray.reason = fmt::format("blunder: its residual is {:.1f} times what the sigmas allow", suspect.w);
    ++rejected;
  }
  return rejected;
}

/// The same of the markers' places against the list, then of the spheres; one at a time.
Result<bool> reject_places(Work& work, const Solved& at) {
  auto residuals = detail::listed_residuals(work.input, work.state, at.head, at.solution);
  if (!residuals) return fail(std::move(residuals));
  std::size_t worst = 0;
  for (std::size_t m = 1; m < residuals->size(); ++m) {
    if ((*residuals)[m].w > (*residuals)[worst].w) worst = m;
  }
  const double level = work.options.rejection_significance;
  const auto limit = [&](std::size_t count) {
    return std::sqrt(math::chi_square_quantile(1.0 - level / static_cast<double>(count), 3.0) / 3.0);
  };
  if (!residuals->empty() && (*residuals)[worst].w > limit(residuals->size())) {
    for (detail::HeadRay& ray : work.survey.rays) {
      if (!ray.active || ray.marker != static_cast<int>(worst)) continue;
      ray.active = false;
      ray.w = (*residuals)[worst].w;
      ray.reason = fmt::format(
          "the marker lies {:.3f} mm from its place in the list of the cross ({:.1f} times what the sigmas allow): "
          "it was moved or damaged",
          (*residuals)[worst].residual_mm.norm(), ray.w);
    }
    return true;
  }
  std::size_t active = 0;
  double worst_w = 0.0;
  std::size_t culprit = 0;
  for (const detail::SpherePair& pair : work.spheres.pairs) active += pair.active ? 1U : 0U;
  for (std::size_t g = 0; g < at.head.groups.size(); ++g) {
    if (at.head.groups[g].kind != detail::HeadGroup::Kind::kSphere) continue;
    const double w = detail::standardised(at.solution.rows.residual(static_cast<int>(g)), at.solution.residual_cofactors()[g]);
    if (w <= worst_w) continue;
    worst_w = w;
    culprit = static_cast<std::size_t>(at.head.groups[g].index);
  }
  if (worst_w <= limit(std::max<std::size_t>(active, 1))) return false;
  detail::SpherePair& pair = work.spheres.pairs[culprit];
  const auto& ball = work.input.probed[static_cast<std::size_t>(pair.probed)];
  const bool minimal = !(ball.axes[0] && ball.axes[1] && ball.axes[2]);
  if (active <= kLeastSpheres || minimal) return false;  // said by the group's warning
  pair.active = false;
  pair.reason = fmt::format("blunder: the other spheres put it elsewhere, {:.1f} times what the sigmas allow", worst_w);
  work.spheres.datum = fmt::format("best fit of {} spheres", active - 1);
  return true;
}

/// The network without the axis: lenses, rig, cross and the head at each station by itself, cleared of what contradicts.
Result<Solved> solve_free(Work& work, const base::Progress& progress) {
  for (int round = 0;; ++round) {
    progress("adjusting", static_cast<std::size_t>(round), kMaxRounds);
    auto solved = solve_once(work, nullptr, progress);
    if (!solved) return solved;
    if (round >= kMaxRounds) return solved;
    bool again = reduce_centres(work) > kSameCentre_px;
    if (work.options.estimate_image_sigma) {
      const double more = image_factor(*solved);
      again = again || std::abs(more - 1.0) > kSameFactor;
      work.factor *= more > 0.0 ? more : 1.0;
    }
    if (again) continue;
    if (reject_rays(work, *solved) > 0) continue;
    auto rejected = reject_places(work, *solved);
    if (!rejected) return fail(std::move(rejected));
    if (!*rejected) return solved;
  }
}

Result<detail::StationPoses> station_poses(const Work& work, const Solved& at) {
  auto cofactors = math::Cofactors::make(at.solution.equations, at.solution.equations.null_space());
  if (!cofactors) return fail(std::move(cofactors));
  detail::StationPoses stations;
  std::vector<int> blocks{at.head.machine_from_cross};
  for (std::size_t k = 0; k < work.survey.stations.size(); ++k) {
    if (at.head.stations[k] < 0) continue;
    const detail::HeadStation& station = work.survey.stations[k];
    blocks.push_back(at.head.stations[k]);
    stations.names.push_back(station.name);
    stations.axis_mm.push_back(station.axis_mm);
    stations.machine_from_rig.push_back(work.state.machine_from_cross * *station.cross_from_rig);
  }
  const auto count = static_cast<Index>(stations.names.size());
  MatrixXd jacobian = MatrixXd::Zero(6 * count, 6 + 6 * count);
  const base::Matrix6d adjoint = work.state.machine_from_cross.adjoint();
  for (Index k = 0; k < count; ++k) {
    jacobian.block<6, 6>(6 * k, 0) = base::Matrix6d::Identity();
    jacobian.block<6, 6>(6 * k, 6 + 6 * k) = adjoint;
  }
  stations.cov = jacobian * cofactors->joint(blocks) * jacobian.transpose();
  return stations;
}

/// The point of the carriage that lies in the middle of what the head saw of the cross, where it is when the carriage is in the middle.
Vector3d middle_of_view(const Work& work, const Vector3d& direction, double middle_mm) {
  Vector3d sum = Vector3d::Zero();
  int count = 0;
  for (const detail::HeadRay& ray : work.survey.rays) {
    if (!ray.active) continue;
    const auto station = static_cast<std::size_t>(work.survey.images[static_cast<std::size_t>(ray.image)].station);
    const Vector3d marker = work.state.machine_from_cross * work.state.markers[static_cast<std::size_t>(ray.marker)];
    sum += marker - direction * (work.survey.stations[station].axis_mm - middle_mm);
    ++count;
  }
  return count > 0 ? Vector3d(sum / count) : sum;
}

Result<> check_input(const CommissionInput& input) {
  if (auto valid = input.cross.validate(); !valid) return valid;
  if (!(input.reading_sigma_mm > 0.0) || !std::isfinite(input.reading_sigma_mm)) {
    return fail(ErrorCode::kBadInput,
                fmt::format("the sigma of an axis reading must be positive, not {} mm", input.reading_sigma_mm));
  }
  return {};
}

}  // namespace

Result<> CommissionOptions::validate() const {
  const auto share = [](double value) { return value > 0.0 && value < 0.5; };
  const auto sigma = [](const std::optional<double>& value) { return !value || (*value >= 0.0 && std::isfinite(*value)); };
  if (!share(significance) || !share(rejection_significance)) {
    return fail(ErrorCode::kUsage, "levels of significance lie between 0 and 0.5");
  }
  if (!(tolerance_px > 0.0) || !sigma(stop_sigma_mm) || !sigma(stop_sigma_rad) || (pivot_mm && !pivot_mm->allFinite())) {
    return fail(ErrorCode::kUsage, "the tolerance must be positive, the sigmas of stops not negative, the pivot finite");
  }
  return {};
}

Result<base::Commissioning> commission(const CommissionInput& input, const CommissionOptions& options,
                                       const base::Progress& progress) {
  if (auto valid = options.validate(); !valid) return fail(std::move(valid));
  if (auto valid = check_input(input); !valid) return fail(std::move(valid));
  auto spheres = detail::pair_spheres(input.cross, input.probed);
  if (!spheres) return fail(std::move(spheres));
  auto survey = detail::survey_head(input);
  if (!survey) return fail(std::move(survey));
  if (auto oriented = detail::orient_stations(input, options, *survey); !oriented) return fail(std::move(oriented));
  Work work{input, options, std::move(*survey), std::move(*spheres), {}, 1.0, 0.0};
  work.state = detail::start_state(input, work.spheres.machine_from_cross);

  for (;;) {
    auto free = solve_free(work, progress);
    if (!free) return fail(std::move(free));
    auto stations = station_poses(work, *free);
    if (!stations) return fail(std::move(stations));
    auto straight = detail::straight_axis(*stations);
    if (!straight) return fail(std::move(straight));
    bool rejected = false;
    for (std::size_t n = 0; n < stations->names.size(); ++n) {
      if (straight->reasons[n].empty()) continue;
      rejected = true;
      for (std::size_t k = 0; k < work.survey.stations.size(); ++k) {
        if (work.survey.stations[k].name != stations->names[n]) continue;
        for (const int r : work.survey.rays_of(static_cast<int>(k)))
          work.survey.rays[static_cast<std::size_t>(r)].active = false;
        work.survey.stations[k].reason = straight->reasons[n];
      }
    }
    if (rejected) continue;

    detail::AxisModel axis;
    const auto [least, most] = std::minmax_element(stations->axis_mm.begin(), stations->axis_mm.end());
    axis.carriage.direction = straight->direction;
    axis.carriage.across.col(0) = straight->direction.unitOrthogonal();
    axis.carriage.across.col(1) = straight->direction.cross(axis.carriage.across.col(0));
    axis.carriage.middle_mm = 0.5 * (*least + *most);
    axis.carriage.half_mm = 0.5 * (*most - *least);
    axis.carriage.pivot_mm = options.pivot_mm ? *options.pivot_mm + straight->direction * axis.carriage.middle_mm
                                              : middle_of_view(work, straight->direction, axis.carriage.middle_mm);
    axis.scale_ppm = straight->scale_ppm;
    const detail::AxisMotion motion =
        detail::find_motion(*stations, axis.carriage, axis.scale_ppm, input.reading_sigma_mm, options);
    axis.carriage.terms = motion.taken();
    axis.at_middle = motion.at_middle;
    axis.stop_sigma_mm = motion.stop_sigma_mm;
    axis.stop_sigma_rad = motion.stop_sigma_rad;
    auto solved = solve_once(work, &axis, progress);
    if (!solved) return fail(std::move(solved));
    return detail::head_outcome({input, options, work.survey, work.spheres, work.state, solved->head, solved->solution, axis,
                                 motion, *stations, work.factor, work.eccentricity_px});
  }
}

}  // namespace crosstie::bundle
