#include "app/scene_plan.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include <fmt/format.h>

#include "app/scene_variants.h"
#include "base/parallel.h"
#include "bundle/plan.h"
#include "calib/quality.h"

namespace crosstie::app {
namespace {

using base::CommissionPlan;
using base::ErrorCode;
using base::fail;
using base::PlanVariant;
using base::Result;
using fixtures::Scene;

/// What a scene is measured by.
struct Parts {
  bool board = false;
  bool machine = false;
  bool network = false;  ///< photographs: of a machine's scene only where the cross's coordinates come from them
};

Parts parts_of(const Scene& scene) {
  Parts parts;
  parts.board = scene.board.has_value() && scene.head.has_value();
  parts.machine = scene.machine.has_value() && !scene.machine->stations.empty();
  const bool photographed = std::any_of(scene.views.begin(), scene.views.end(),
                                        [](const fixtures::View& view) { return view.purpose == fixtures::Purpose::kNetwork; });
  parts.network = photographed && (!parts.machine || scene.machine->cross.points_from_adjust);
  return parts;
}

/// Predictions for one scene, measured in one way.
struct Prediction {
  std::optional<base::Calibration> calibration;
  std::optional<base::NetworkPlan> network;
  std::optional<CommissionPlan> machine;
};

/// `calibration` is taken where it is not null: that of another survey of the same board.
Result<Prediction> predict(const Scene& scene, const SurveyOptions& options, double power, const base::Calibration* calibration,
                           const base::Progress& progress) {
  const Parts parts = parts_of(scene);
  const Scene made = surveyed(scene, options);
  Prediction prediction;
  if (calibration != nullptr) {
    prediction.calibration = *calibration;
  } else if (parts.board) {
    auto surveyed_head = survey_head(made, options);
    if (!surveyed_head) return fail(std::move(surveyed_head));
    prediction.calibration = *std::move(surveyed_head);
  }
  if (parts.network) {
    auto network = bundle::plan_network(survey_network(made, options), progress);
    if (!network) return fail(std::move(network));
    prediction.network = *std::move(network);
  }
  if (!parts.machine) return prediction;
  if (!prediction.calibration) return fail(survey_head(made, options));
  const auto input =
      survey_machine(made, *prediction.calibration, prediction.network ? &prediction.network->expected : nullptr, options);
  if (!input) return tl::unexpected(input.error());
  auto machine = bundle::plan_commission(*input, {.power = power}, progress);
  if (!machine) return fail(std::move(machine));
  prediction.machine = *std::move(machine);
  return prediction;
}

/// The middle of the working volume at mid-travel, and where the frame alone is least certain.
std::vector<Eigen::Vector3d> usual_points(const base::Commissioning& expected) {
  std::vector<Eigen::Vector3d> points;
  if (expected.tre.empty()) return points;
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  for (const base::FramePoint& point : expected.tre) middle += point.p_in_rig_mm / static_cast<double>(expected.tre.size());
  points.push_back(expected.frame.machine_from_rig_at_middle * middle);
  const auto worst = std::max_element(expected.tre.begin(), expected.tre.end(), [](const auto& a, const auto& b) {
    return base::worst_sigma(a.cov_mm2) < base::worst_sigma(b.cov_mm2);
  });
  points.push_back(worst->p_in_machine_mm);
  return points;
}

/// Smallest peak to valley of an error motion that is found; not a number where it is not tested.
double smallest(const CommissionPlan& plan, const std::string& name, int order) {
  for (const base::PlannedMotion& motion : plan.motions) {
    if (motion.name == name && motion.order == order) return motion.range_factor * motion.smallest;
  }
  return std::numeric_limits<double>::quiet_NaN();
}

void fill(const Prediction& prediction, const std::vector<Eigen::Vector3d>& points, double image_sigma_px, PlanVariant& row) {
  if (prediction.calibration && prediction.calibration->rig)
    row.baseline_sigma_mm = prediction.calibration->rig->baseline_sigma_mm;
  if (prediction.network) {
    row.network_median_mm = prediction.network->median_mm;
    row.network_max_mm = prediction.network->max_mm;
  }
  if (!prediction.machine) return;
  const CommissionPlan& machine = *prediction.machine;
  row.baseline_sigma_mm = machine.expected.baseline_sigma_mm;
  row.direction_sigma_rad = machine.direction_sigma_rad;
  row.scale_sigma_ppm = machine.expected.frame.axis.scale_sigma_ppm;
  const double eyx = smallest(machine, "EYX", 2);
  const double ezx = smallest(machine, "EZX", 2);
  row.straightness_mm = std::isnan(eyx) || std::isnan(ezx) ? eyx + ezx : std::max(eyx, ezx);
  row.roll_rad = smallest(machine, "EAX", 1);
  row.pitch_rad = smallest(machine, "EBX", 1);
  row.yaw_rad = smallest(machine, "ECX", 1);
  for (const Eigen::Vector3d& place : points) {
    const base::PlannedPoint point = bundle::plan_point(machine.expected, place, image_sigma_px);
    row.points_mm.push_back(base::worst_sigma(point.cov_mm2.value_or(point.frame_cov_mm2)));
  }
}

}  // namespace

Result<base::ScenePlan> plan_scene(const Scene& scene, const ScenePlanOptions& options, Session& session) {
  const Parts parts = parts_of(scene);
  if (!parts.board && !parts.machine && !parts.network) {
    return fail(
        ErrorCode::kBadInput,
        fmt::format("the scene {} has nothing to be measured: neither photographs nor a board nor stations of a machine",
                    scene.name));
  }
  if (!parts.machine && !options.points_mm.empty()) {
    return fail(ErrorCode::kUsage, fmt::format("the scene {} has no machine in which a point could be meant", scene.name));
  }
  auto prediction = predict(scene, options.survey, options.power, nullptr, session.progress());
  if (!prediction) return fail(std::move(prediction));
  std::vector<Eigen::Vector3d> places = options.points_mm;
  if (prediction->machine && places.empty()) places = usual_points(prediction->machine->expected);

  base::ScenePlan plan{
      .scene = scene.name, .image_sigma_px = options.survey.image_sigma_px, .corner_sigma_px = options.survey.corner_sigma_px};
  for (const Eigen::Vector3d& place : places) {
    plan.points.push_back(bundle::plan_point(prediction->machine->expected, place, options.survey.image_sigma_px));
  }
  if (options.variants) {
    PlanVariant& own = plan.variants.emplace_back();
    own.what = "the scene as it is";
    own.as_planned = true;
    fill(*prediction, places, options.survey.image_sigma_px, own);
    const std::vector<SceneVariant> variants = scene_variants(scene, options.survey);
    std::vector<PlanVariant> rows(variants.size());
    auto done = base::parallel_for(variants.size(), session.threads(), "variants", session.progress(), [&](std::size_t i) {
      rows[i].what = variants[i].what;
      rows[i].value = variants[i].value;
      const bool same_board = !variants[i].other_board && prediction->calibration;
      const auto changed =
          predict(variants[i].scene, variants[i].options, options.power, same_board ? &*prediction->calibration : nullptr, {});
      if (changed) {
        fill(*changed, places, variants[i].options.image_sigma_px, rows[i]);
      } else {
        rows[i].failure = changed.error().message;
      }
      return Result<>{};
    });
    if (!done) return fail(std::move(done));
    plan.variants.insert(plan.variants.end(), rows.begin(), rows.end());
  }
  if (prediction->calibration) {
    const base::Calibration& calibration = *prediction->calibration;
    auto maps = calib::calibration_maps(calibration, calib::working_distance_mm(calibration));
    if (!maps) return fail(std::move(maps));
    plan.maps = *std::move(maps);
  }
  plan.calibration = std::move(prediction->calibration);
  plan.machine = std::move(prediction->machine);
  plan.network = std::move(prediction->network);
  if (options.rehearsals > 0) {
    auto rehearsal = rehearse(scene, plan, options.survey, options.rehearsals, session);
    if (!rehearsal) return fail(std::move(rehearsal));
    plan.rehearsal = *std::move(rehearsal);
  }
  return plan;
}

}  // namespace crosstie::app
