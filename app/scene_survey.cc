#include "app/scene_survey.h"

#include <algorithm>
#include <map>
#include <set>

#include <fmt/format.h>

#include "app/head_files.h"
#include "app/probed_spheres.h"
#include "calib/calibrate.h"
#include "fixtures/sampled.h"
#include "fixtures/truth.h"

namespace crosstie::app {
namespace {

using base::ErrorCode;
using base::fail;
using base::Result;
using fixtures::Purpose;
using fixtures::Scene;

/// The same scene whose campaign, probe and axis err by nothing; what they say of their sigmas is put back afterwards.
Scene quiet(Scene scene, const SurveyOptions& options) {
  if (options.seed) return scene;
  scene.reference.sigma_mm.setZero();
  for (fixtures::SceneScaleBar& bar : scene.scale_bars) bar.sigma_mm = 0.0;
  if (!scene.machine) return scene;
  scene.machine->cross.sphere_sigma_mm = 0.0;
  scene.machine->probing.sigma_mm = 0.0;
  scene.machine->axis_sigma_mm = 0.0;
  return scene;
}

std::uint64_t seed_of(const SurveyOptions& options) { return options.seed.value_or(1); }

std::vector<base::ImageObservations> markers(const Scene& made, Purpose purpose, const SurveyOptions& options) {
  auto images = fixtures::sampled_markers(made, purpose, options.seed ? options.image_sigma_px : 0.0, seed_of(options));
  const Eigen::Matrix2d cov_px2 = options.image_sigma_px * options.image_sigma_px * Eigen::Matrix2d::Identity();
  for (base::ImageObservations& image : images) {
    for (base::Observation& seen : image.observations) seen.cov_px2 = cov_px2;
  }
  return images;
}

/// Ids on bodies that are elsewhere in some photograph, or that the campaign did not measure.
std::set<int> restless_ids(const Scene& made) {
  std::set<std::string> bodies(made.reference.without.begin(), made.reference.without.end());
  for (const fixtures::View& view : made.views) {
    if (view.purpose != Purpose::kNetwork) continue;
    for (const fixtures::MovedBody& moved : view.moved) bodies.insert(moved.body);
  }
  std::set<int> ids;
  for (const fixtures::Body& body : made.bodies) {
    if (!bodies.contains(body.name)) continue;
    for (const fixtures::Plate& plate : body.plates) ids.insert(plate.id);
  }
  return ids;
}

base::PointList reference_list(const Scene& made, const SurveyOptions& options) {
  base::PointList list = fixtures::measured_reference(quiet(made, options), seed_of(options));
  const std::set<int> restless = restless_ids(made);
  std::erase_if(list.points, [&](const base::ReferencePoint& point) { return restless.contains(point.id); });
  const Eigen::Matrix3d cov_mm2 = made.reference.sigma_mm.array().square().matrix().asDiagonal();
  for (base::ReferencePoint& point : list.points) point.cov_mm2 = cov_mm2;
  return list;
}

/// Markers with the covariance that the adjustment gave them, spheres with that of the campaign, independent of them.
void take_adjusted(const base::AdjustedNetwork& adjusted, base::Cross& cross) {
  cross.markers.clear();
  std::vector<Eigen::Index> rows;
  for (const base::AdjustedPoint& point : adjusted.points) {
    const auto first = std::find(adjusted.labels.begin(), adjusted.labels.end(), fmt::format("point {} x [mm]", point.id));
    if (first == adjusted.labels.end()) continue;
    cross.markers.push_back({point.id, point.xyz_mm, point.cov_mm2});
    for (Eigen::Index axis = 0; axis < 3; ++axis) rows.push_back(first - adjusted.labels.begin() + axis);
  }
  const auto of_markers = static_cast<Eigen::Index>(rows.size());
  const auto all = of_markers + static_cast<Eigen::Index>(3 * cross.spheres.size());
  cross.cov_mm2 = Eigen::MatrixXd::Zero(all, all);
  cross.cov_mm2.topLeftCorner(of_markers, of_markers) = adjusted.covariance(rows, rows);
  for (std::size_t i = 0; i < cross.spheres.size(); ++i) {
    const Eigen::Index at = of_markers + static_cast<Eigen::Index>(3 * i);
    cross.cov_mm2.block<3, 3>(at, at) = cross.spheres[i].cov_mm2;
  }
}

Result<std::vector<base::ProbedSphere>> probed(const Scene& made, const base::Cross& cross, const SurveyOptions& options) {
  const fixtures::Probing& probing = made.machine->probing;
  std::vector<base::ProbedSphere> spheres;
  if (probing.hits == 0) {
    for (const fixtures::MeasuredSphere& one : fixtures::probed_spheres(quiet(made, options), seed_of(options))) {
      spheres.push_back({.id = one.id,
                         .centre_mm = one.xyz_mm,
                         .cov_mm2 = probing.sigma_mm * probing.sigma_mm * Eigen::Matrix3d::Identity()});
    }
    return spheres;
  }
  std::map<int, base::ProbeHits> hits;
  for (const fixtures::ProbeHit& hit : fixtures::probe_hits(quiet(made, options), seed_of(options))) {
    hits[hit.sphere].id = hit.sphere;
    hits[hit.sphere].tips_mm.push_back(hit.tip_mm);
  }
  std::vector<base::Warning> ignored;
  for (const auto& [id, touches] : hits) {
    const auto known = std::find_if(cross.spheres.begin(), cross.spheres.end(),
                                    [id = id](const base::ReferenceSphere& sphere) { return sphere.id == id; });
    auto sphere =
        probed_sphere(touches, known == cross.spheres.end() ? nullptr : &*known,
                      {.stylus_diameter_mm = probing.stylus_diameter_mm, .probe_sigma_mm = probing.sigma_mm}, ignored);
    if (!sphere) return fail(std::move(sphere));
    spheres.push_back(*std::move(sphere));
  }
  return spheres;
}

base::Cross cross_of(const Scene& made, const base::AdjustedNetwork* adjusted, const SurveyOptions& options) {
  const fixtures::SceneCross& stated = made.machine->cross;
  base::Cross cross;
  cross.measured_at_c = stated.points_temperature_c;
  cross.temperature_c = stated.temperature_c;
  cross.temperature_sigma_c = stated.temperature_sigma_c;
  cross.cte_per_k = stated.cte_per_k;
  cross.cte_sigma_per_k = stated.cte_sigma_per_k;
  cross.markers = reference_list(made, options).points;
  for (const fixtures::MeasuredSphere& one : fixtures::measured_spheres(quiet(made, options), seed_of(options))) {
    cross.spheres.push_back({.id = one.id,
                             .centre_mm = one.xyz_mm,
                             .cov_mm2 = stated.sphere_sigma_mm * stated.sphere_sigma_mm * Eigen::Matrix3d::Identity(),
                             .diameter_mm = one.diameter_mm});
  }
  if (stated.points_from_adjust && adjusted != nullptr) take_adjusted(*adjusted, cross);
  return cross;
}

}  // namespace

Scene surveyed(const Scene& scene, const SurveyOptions& options) {
  if (options.seed) return fixtures::drawn(scene, *options.seed);
  Scene stated = scene;
  if (stated.board) stated.board->points_mm = stated.board->board.nominal_points();
  if (stated.machine) {
    fixtures::SceneCross& cross = stated.machine->cross;
    cross.growth = 1.0 + cross.cte_per_k * (cross.temperature_c - cross.points_temperature_c);
  }
  return fixtures::drawn(std::move(stated), 1);
}

Result<base::Calibration> survey_head(const Scene& made, const SurveyOptions& options) {
  if (!made.board || !made.head) {
    return fail(ErrorCode::kBadInput,
                "the scene has no [board] before a [head]: nothing tells how well the head's cameras will be calibrated");
  }
  calib::BoardViews views{made.board->board, {made.head->left, made.head->right}, {}};
  views.images = fixtures::sampled_boards(made, options.seed ? options.corner_sigma_px : 0.0, seed_of(options));
  for (base::BoardImage& image : views.images) {
    for (base::BoardCorner& corner : image.corners) corner.sigma_px = 0.0;
  }
  const auto left = std::find_if(made.cameras.begin(), made.cameras.end(),
                                 [&](const fixtures::SceneCamera& camera) { return camera.name == made.head->left; });
  if (left == made.cameras.end())
    return fail(ErrorCode::kBadInput, "the scene's head has no camera of the name that it states");
  return calib::calibrate(views, {.lens = left->camera->model(),
                                  .sigma_px = options.corner_sigma_px,
                                  .cross_validate = false,
                                  .reject_outliers = options.seed.has_value()});
}

base::PointList true_reference(const Scene& made) { return reference_list(made, {}); }

base::Network survey_network(const Scene& made, const SurveyOptions& options) {
  base::Network network;
  network.images = markers(made, Purpose::kNetwork, options);
  const std::set<int> restless = restless_ids(made);
  std::set<std::string> used;
  for (base::ImageObservations& image : network.images) {
    used.insert(image.camera);
    std::erase_if(image.observations, [&](const base::Observation& seen) { return restless.contains(seen.id); });
  }
  for (const fixtures::SceneCamera& camera : made.cameras) {
    if (used.contains(camera.name)) network.cameras.push_back({.name = camera.name, .camera = *camera.camera});
  }
  const auto bars = fixtures::certified_bars(quiet(made, options), seed_of(options));
  for (std::size_t i = 0; i < bars.size(); ++i) {
    network.scale_bars.push_back(bars[i]);
    network.scale_bars.back().sigma_mm = made.scale_bars[i].sigma_mm;
  }
  network.scale_is_free = network.scale_bars.empty();
  for (const base::ReferencePoint& point : true_reference(made).points) network.datum.push_back({point.id, point.xyz_mm});
  return network;
}

Result<bundle::CommissionInput> survey_machine(const Scene& made, const base::Calibration& calibration,
                                               const base::AdjustedNetwork* adjusted, const SurveyOptions& options) {
  auto head = head_of(calibration);
  if (!head) return fail(std::move(head));
  base::Cross cross = cross_of(made, adjusted, options);
  auto spheres = probed(made, cross, options);
  if (!spheres) return fail(std::move(spheres));
  bundle::CommissionInput input{.head = *std::move(head),
                                .cross = std::move(cross),
                                .probed = *std::move(spheres),
                                .stations = {},
                                .images = markers(made, Purpose::kStation, options)};
  if (made.machine->axis_sigma_mm > 0.0) input.reading_sigma_mm = made.machine->axis_sigma_mm;
  const std::vector<double> readings = fixtures::axis_readings_mm(quiet(made, options), seed_of(options));
  for (std::size_t k = 0; k < readings.size(); ++k) {
    const std::string& name = made.machine->stations[k].name;
    input.stations.push_back({.name = name, .axis_mm = readings[k], .left = name + "_l", .right = name + "_r"});
  }
  return input;
}

}  // namespace crosstie::app
