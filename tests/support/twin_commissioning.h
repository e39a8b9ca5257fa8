#pragma once

#include <map>
#include <string>
#include <utility>
#include <vector>

#include "base/calibration_reader.h"
#include "bundle/commission.h"
#include "calib/calibrate.h"
#include "fixtures/sampled.h"
#include "fixtures/scene.h"
#include "math/probed_sphere.h"

namespace crosstie::tests {

/// Noise of what the twin's cameras see, where no photograph is rendered.
struct TwinNoise {
  double corner_px = 0.03;
  double marker_px = 0.03;
};

/// The head as the twin's boards calibrate it.
inline base::Result<base::Head> calibrated_twin_head(const fixtures::Scene& scene, double corner_px, std::uint64_t seed) {
  calib::CalibrateOptions options;
  options.lens = base::LensModel::kOpenCv5;
  options.cross_validate = false;
  options.threads = 1;
  const auto calibration = calib::calibrate(
      {scene.board->board, {scene.head->left, scene.head->right}, fixtures::sampled_boards(scene, corner_px, seed)}, options);
  if (!calibration) return tl::unexpected(calibration.error());
  if (!calibration->rig) return base::fail(base::ErrorCode::kInternal, "no rig");
  auto cov = base::joint_covariance(*calibration, {scene.head->left, scene.head->right}, true);
  if (!cov) return base::fail(std::move(cov));
  return base::Head{.left_name = scene.head->left,
                    .right_name = scene.head->right,
                    .left = calibration->cameras[0].camera,
                    .right = calibration->cameras[1].camera,
                    .right_from_left = calibration->rig->right_from_left,
                    .cov = *std::move(cov),
                    .temperature_c = scene.head->temperature_c};
}

/// The centres of the balls as the machine touched them, each diameter as listed.
inline base::Result<std::vector<base::ProbedSphere>> touched_spheres(const fixtures::Scene& scene, std::uint64_t seed) {
  std::map<int, std::vector<Eigen::Vector3d>> hits;
  for (const fixtures::ProbeHit& hit : fixtures::probe_hits(scene, seed)) hits[hit.sphere].push_back(hit.tip_mm);
  std::vector<base::ProbedSphere> spheres;
  for (const fixtures::MeasuredSphere& listed : fixtures::measured_spheres(scene, seed)) {
    const auto fit = math::fit_probed_sphere(hits[listed.id], {.stylus_diameter_mm = scene.machine->probing.stylus_diameter_mm,
                                                               .probe_sigma_mm = scene.machine->probing.sigma_mm,
                                                               .diameter_mm = listed.diameter_mm,
                                                               .diameter_sigma_mm = 0.005});
    if (!fit) return tl::unexpected(fit.error());
    spheres.push_back({.id = listed.id, .centre_mm = fit->centre_mm, .cov_mm2 = fit->cov_mm2});
  }
  return spheres;
}

/// Everything that a commissioning of a drawn() scene starts from, by sampled observations.
inline base::Result<bundle::CommissionInput> twin_commission_input(const fixtures::Scene& scene, const TwinNoise& noise,
                                                                   std::uint64_t seed) {
  auto head = calibrated_twin_head(scene, noise.corner_px, seed);
  if (!head) return base::fail(std::move(head));
  auto probed = touched_spheres(scene, seed);
  if (!probed) return base::fail(std::move(probed));
  const fixtures::SceneCross& stated = scene.machine->cross;
  base::Cross cross;
  cross.markers = fixtures::measured_reference(scene, seed).points;
  for (const fixtures::MeasuredSphere& sphere : fixtures::measured_spheres(scene, seed)) {
    cross.spheres.push_back(
        {sphere.id, sphere.xyz_mm, Eigen::Matrix3d(sphere.sigma_mm.cwiseAbs2().asDiagonal()), sphere.diameter_mm});
  }
  cross.measured_at_c = stated.points_temperature_c;
  cross.temperature_c = stated.temperature_c;
  cross.temperature_sigma_c = stated.temperature_sigma_c;
  cross.cte_per_k = stated.cte_per_k;
  cross.cte_sigma_per_k = stated.cte_sigma_per_k;
  bundle::CommissionInput input{.head = *std::move(head),
                                .cross = std::move(cross),
                                .probed = *std::move(probed),
                                .stations = {},
                                .images = fixtures::sampled_markers(scene, fixtures::Purpose::kStation, noise.marker_px, seed),
                                .reading_sigma_mm = scene.machine->axis_sigma_mm};
  const std::vector<double> readings_mm = fixtures::axis_readings_mm(scene, seed);
  for (std::size_t i = 0; i < readings_mm.size(); ++i) {
    const std::string& name = scene.machine->stations[i].name;
    input.stations.push_back({name, readings_mm[i], name + "_l", name + "_r"});
  }
  return input;
}

}  // namespace crosstie::tests
