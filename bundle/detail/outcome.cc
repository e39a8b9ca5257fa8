#include "bundle/detail/outcome.h"

#include <algorithm>
#include <cmath>
#include <initializer_list>
#include <tuple>

#include <fmt/format.h>
#include <Eigen/Cholesky>

#include "bundle/detail/frame.h"
#include "bundle/detail/rank.h"
#include "bundle/detail/summary.h"
#include "bundle/detail/triangulate.h"
#include "math/cofactors.h"
#include "math/distributions.h"

namespace crosstie::bundle::detail {
namespace {

using base::AdjustedNetwork;
using base::fail;
using base::Result;

constexpr int kMostPointsWithFullCovariance = 2000;

std::string scale_name(const Survey& survey) {
  for (const Bar& bar : survey.bars) {
    if (bar.bar.role == base::ScaleBarRole::kDefines) return fmt::format("defined by {}-{}", bar.bar.id_a, bar.bar.id_b);
  }
  const bool bars = std::any_of(survey.bars.begin(), survey.bars.end(),
                                [](const Bar& bar) { return bar.bar.role == base::ScaleBarRole::kUsed; });
  if (!survey.control.empty()) return bars ? "control points and scale bars" : "control points";
  if (survey.scale_is_free) return survey.datum.empty() ? "free" : "datum points";
  return "scale bars";
}

/// Of some blocks in all their tangent directions, zero for those that are held.
Eigen::MatrixXd cofactors_of(const Estimate& at, const math::Cofactors& cofactors, std::initializer_list<int> blocks) {
  std::vector<int> free;
  int size = 0;
  for (const int b : blocks) {
    const math::Block& block = at.network.model.blocks[static_cast<std::size_t>(b)];
    for (const int i : block.free) free.push_back(size + i);
    size += block.tangent_size();
  }
  Eigen::MatrixXd all = Eigen::MatrixXd::Zero(size, size);
  all(free, free) = cofactors.joint(std::vector<int>(blocks));
  return all;
}

/// Indices into the result's lists, -1 for what does not take part.
struct Places {
  std::vector<int> image;
  std::vector<int> point;
};

void add_cameras(const Survey& survey, const State& state, const Estimate& at, const math::Cofactors& cofactors,
                 double variance, AdjustedNetwork& result) {
  for (std::size_t c = 0; c < survey.cameras.size(); ++c) {
    base::AdjustedCamera camera{survey.cameras[c].name, survey.cameras[c].camera, false};
    const int block = at.network.camera_block[c];
    if (block >= 0) {
      const math::Block& values = at.network.model.blocks[static_cast<std::size_t>(block)];
      auto adjusted =
          base::Camera::make(camera.camera.model(), camera.camera.width_px(), camera.camera.height_px(), state.lenses[c]);
      if (adjusted && !values.free.empty()) {
        camera.camera = *adjusted;
        camera.estimated = true;
        camera.camera.set_covariance(variance * cofactors_of(at, cofactors, {block}));
      }
    }
    result.cameras.push_back(std::move(camera));
  }
}

/// Of an image's pose. On a rig network_from_camera = network_from_rig * rig_from_camera, so that
/// delta = delta_rig + Ad(network_from_rig) delta_mount.
base::Matrix6d pose_cofactors(const Survey& survey, const Estimate& at, const math::Cofactors& cofactors, std::size_t image) {
  const int pose = at.network.image_block[image];
  const int mount = survey.station_of_image[image] >= 0
                        ? at.network.mount_block[static_cast<std::size_t>(survey.camera_of_image[image])]
                        : -1;
  if (mount < 0) return cofactors_of(at, cofactors, {pose});
  const base::Pose network_from_rig =
      math::pose_from_values(at.network.model.blocks[static_cast<std::size_t>(pose)].values.data());
  Eigen::Matrix<double, 6, 12> jacobian;
  jacobian << base::Matrix6d::Identity(), network_from_rig.adjoint();
  return jacobian * cofactors_of(at, cofactors, {pose, mount}) * jacobian.transpose();
}

void add_rigs(const Survey& survey, const State& state, const Estimate& at, const math::Cofactors& cofactors, double variance,
              AdjustedNetwork& result) {
  for (std::size_t r = 0; r < survey.rigs.size(); ++r) {
    base::AdjustedRig rig;
    rig.name = survey.rigs[r].name;
    for (const int camera : survey.rigs[r].cameras) {
      const auto c = static_cast<std::size_t>(camera);
      const int block = at.network.mount_block[c];
      if (block < 0 && !survey.leads_rig(camera)) continue;
      base::AdjustedMount mount{survey.cameras[c].name, state.mounts[c].value_or(base::Pose{})};
      if (block >= 0) mount.cov = variance * cofactors_of(at, cofactors, {block});
      rig.mounts.push_back(std::move(mount));
    }
    for (const Station& station : survey.stations) {
      if (station.rig != static_cast<int>(r)) continue;
      rig.stations += std::any_of(station.images.begin(), station.images.end(),
                                  [&](int image) { return at.network.image_block[static_cast<std::size_t>(image)] >= 0; });
    }
    result.rigs.push_back(std::move(rig));
  }
}

void add_control(const Survey& survey, const State& state, const Estimate& at, AdjustedNetwork& result) {
  std::vector<double> w(survey.control.size(), 0.0);
  for (int g = 0; g < at.rows.group_count(); ++g) {
    const int control = at.network.control_of_group[static_cast<std::size_t>(g)];
    if (control < 0) continue;
    w[static_cast<std::size_t>(control)] =
        standardised(at.rows.residual(g), at.residual_cofactors()[static_cast<std::size_t>(g)]);
  }
  for (std::size_t c = 0; c < survey.control.size(); ++c) {
    const Control& control = survey.control[c];
    for (std::size_t k = 0; k < control.points.size(); ++k) {
      const auto& adjusted = state.points[static_cast<std::size_t>(control.points[k])];
      if (!adjusted) continue;
      const auto at_point = 3 * static_cast<Eigen::Index>(k);
      result.control.push_back({survey.ids[static_cast<std::size_t>(control.points[k])],
                                *adjusted - control.xyz_mm.segment<3>(at_point), control.sigma_mm.segment<3>(at_point), w[c]});
    }
  }
  std::sort(result.control.begin(), result.control.end(), [](const auto& a, const auto& b) { return a.id < b.id; });
}

Places add_images_and_points(const Survey& survey, const State& state, const Estimate& at, const math::Cofactors& cofactors,
                             double variance, AdjustedNetwork& result) {
  Places places{std::vector<int>(survey.images.size(), -1), std::vector<int>(survey.ids.size(), -1)};
  for (std::size_t i = 0; i < survey.images.size(); ++i) {
    const int block = at.network.image_block[i];
    if (block < 0) continue;
    places.image[i] = static_cast<int>(result.images.size());
    base::AdjustedImage image;
    image.name = survey.images[i];
    image.camera = survey.cameras[static_cast<std::size_t>(survey.camera_of_image[i])].name;
    image.network_from_camera = *state.poses[i];
    image.cov = variance * pose_cofactors(survey, at, cofactors, i);
    result.images.push_back(std::move(image));
  }
  for (std::size_t p = 0; p < survey.ids.size(); ++p) {
    const int block = at.network.point_block[p];
    if (block < 0) continue;
    places.point[p] = static_cast<int>(result.points.size());
    base::AdjustedPoint point;
    point.id = survey.ids[p];
    if (p >= survey.coded_points) point.kind = "uncoded";
    point.xyz_mm = *state.points[p];
    point.cov_mm2 = variance * cofactors_of(at, cofactors, {block});
    std::vector<int> rays;
    for (const int r : survey.rays_of_point[p]) {
      if (state.active[static_cast<std::size_t>(r)]) rays.push_back(r);
    }
    point.angle_rad = largest_angle(survey, state, rays);
    result.points.push_back(std::move(point));
  }
  return places;
}

void add_residuals(const Survey& survey, const Estimate& at, const Weights& weights, const Places& places,
                   AdjustedNetwork& result) {
  double total = 0.0;
  int count = 0;
  for (int g = 0; g < at.rows.group_count(); ++g) {
    const int r = at.network.ray_of_group[static_cast<std::size_t>(g)];
    if (r < 0) continue;
    const Ray& ray = survey.rays[static_cast<std::size_t>(r)];
    const Eigen::Matrix2d cov = weights.covariance(r);
    const Eigen::Matrix2d factor = cov.llt().matrixL();
    const Eigen::MatrixXd& cofactor = at.residual_cofactors()[static_cast<std::size_t>(g)];
    base::AdjustedObservation observation;
    observation.image = places.image[static_cast<std::size_t>(ray.image)];
    observation.point = places.point[static_cast<std::size_t>(ray.point)];
    observation.measured_px = ray.measured_px;
    observation.residual_px = factor * at.rows.residual(g);
    observation.sigma_px = cov.diagonal().cwiseSqrt();
    observation.redundancy = (factor * cofactor * factor.inverse()).diagonal();
    observation.w = standardised(at.rows.residual(g), cofactor);
    base::AdjustedImage& image = result.images[static_cast<std::size_t>(observation.image)];
    base::AdjustedPoint& point = result.points[static_cast<std::size_t>(observation.point)];
    const double square = observation.residual_px.squaredNorm();
    image.rms_px += square;
    point.rms_px += square;
    total += square;
    ++image.rays;
    ++point.rays;
    ++count;
    point.max_w = std::max(point.max_w, observation.w);
    const double least = observation.redundancy.minCoeff();
    point.least_redundancy = point.rays == 1 ? least : std::min(point.least_redundancy, least);
    image.max_px = std::max(image.max_px, std::sqrt(square));
    point.max_px = std::max(point.max_px, std::sqrt(square));
    result.residuals.push_back(observation);
  }
  for (auto& image : result.images) image.rms_px = std::sqrt(image.rms_px / std::max(1, image.rays));
  for (auto& point : result.points) point.rms_px = std::sqrt(point.rms_px / std::max(1, point.rays));
  result.rms_px = count > 0 ? std::sqrt(total / count) : 0.0;
}

void add_bars(const Survey& survey, const State& state, const Estimate& at, const math::Cofactors& cofactors, double variance,
              AdjustedNetwork& result) {
  for (std::size_t i = 0; i < survey.bars.size(); ++i) {
    const Bar& bar = survey.bars[i];
    const int a = at.network.point_block[static_cast<std::size_t>(bar.point_a)];
    const int b = at.network.point_block[static_cast<std::size_t>(bar.point_b)];
    if (a < 0 || b < 0) continue;
    const Eigen::Vector3d difference =
        *state.points[static_cast<std::size_t>(bar.point_a)] - *state.points[static_cast<std::size_t>(bar.point_b)];
    base::AdjustedScaleBar adjusted{bar.bar, difference.norm(), 0.0, 0.0};
    Eigen::Matrix<double, 6, 1> gradient;
    gradient << difference.normalized(), -difference.normalized();
    adjusted.sigma_mm = std::sqrt(std::max(0.0, variance * gradient.dot(cofactors_of(at, cofactors, {a, b}) * gradient)));
    const double error = adjusted.measured_mm - bar.bar.length_at_temperature_mm();
    if (bar.bar.role == base::ScaleBarRole::kUsed) {
      for (int g = 0; g < at.rows.group_count(); ++g) {
        if (at.network.bar_of_group[static_cast<std::size_t>(g)] != static_cast<int>(i)) continue;
        const double controlled = at.residual_cofactors()[static_cast<std::size_t>(g)](0, 0);
        if (controlled > 1e-6) adjusted.w = at.rows.residual(g)(0) / std::sqrt(controlled);
      }
    } else if (bar.bar.role == base::ScaleBarRole::kCheck) {
      const double sigma = std::hypot(adjusted.sigma_mm, bar.bar.sigma_mm);
      if (sigma > 0.0) adjusted.w = error / sigma;
    }
    result.scale_bars.push_back(adjusted);
  }
}

}  // namespace

Result<AdjustedNetwork> make_outcome(const Survey& survey, const AdjustOptions& options, const State& state, const Estimate& at,
                                     const Weights& weights, const Reasons& reasons) {
  auto cofactors = math::Cofactors::make(at.equations, datum_conditions(survey, at.network, at.equations.null_space()));
  if (!cofactors) return fail(std::move(cofactors));
  AdjustedNetwork result;
  result.datum = datum_name(survey, state, static_cast<int>(at.equations.null_space().cols()));
  result.scale = scale_name(survey);
  result.sigma0 = at.sigma0();
  result.sigma0_px = result.sigma0 * weights.unit_sigma_px(state.active);
  result.model_sigma_px = weights.model_sigma_px();
  result.uncoded_model_sigma_px = weights.uncoded_model_sigma_px();
  result.observations = at.observations;
  result.unknowns = at.unknowns;
  result.conditions = static_cast<int>(at.equations.null_space().cols());
  result.redundancy = at.redundancy;
  result.chi2_p = at.redundancy > 0 ? math::chi_square_two_sided(at.square_sum, at.redundancy) : 1.0;
  count_observations(at, result);
  count_unknowns(at, result);
  result.iterations = state.iterations;
  result.last_step = at.last_step;
  result.structural_rank = structural_rank(at.rows, at.equations.parameters());
  // The normal equations were refused if one more eigenvalue were zero.
  result.rank = at.unknowns - result.conditions;
  std::tie(result.least_eigenvalue, result.weakest) = at.equations.weakest();
  // Without redundancy there is nothing to judge the a priori sigmas by: they are taken as they are.
  const double variance = at.redundancy > 0 ? result.sigma0 * result.sigma0 : 1.0;

  add_cameras(survey, state, at, *cofactors, variance, result);
  const Places places = add_images_and_points(survey, state, at, *cofactors, variance, result);
  add_residuals(survey, at, weights, places, result);
  add_coverage(result);
  add_significance(at, result);
  add_rigs(survey, state, at, *cofactors, variance, result);
  add_bars(survey, state, at, *cofactors, variance, result);
  add_control(survey, state, at, result);

  const std::vector<double> w = standardised_of_rays(survey, state, at, weights);
  for (std::size_t r = 0; r < survey.rays.size(); ++r) {
    if (state.active[r]) continue;
    const Ray& ray = survey.rays[r];
    result.rejected.push_back({survey.images[static_cast<std::size_t>(ray.image)],
                               survey.ids[static_cast<std::size_t>(ray.point)], reasons.ray[r], w[r]});
  }
  for (std::size_t i = 0; i < survey.images.size(); ++i) {
    if (survey.rays_of_image[i].empty()) {
      result.rejected.push_back({survey.images[i], base::kNoId, "image not oriented: no coded marker was read in it", 0.0});
    }
  }
  if (options.full_covariance && static_cast<int>(result.points.size()) <= kMostPointsWithFullCovariance) {
    result.covariance = variance * cofactors->full();
    result.labels = at.network.model.parameters().labels();
  }
  return result;
}

}  // namespace crosstie::bundle::detail
