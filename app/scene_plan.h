#pragma once

#include <vector>

#include <Eigen/Core>

#include "app/scene_survey.h"
#include "app/session.h"
#include "base/plan.h"
#include "base/result.h"
#include "fixtures/scene.h"

namespace crosstie::app {

struct ScenePlanOptions {
  SurveyOptions survey = {};
  /// Places in machine where sigmas are wanted; empty: the middle of the working volume at mid-travel, and the place where the frame is
  /// least certain.
  std::vector<Eigen::Vector3d> points_mm = {};
  double power = 0.95;
  bool variants = true;  ///< what other numbers of stations, photographs, ... would give
  int rehearsals = 0;    ///< draws by which the predicted sigmas are tested
};

/// What surveys of a scene will give: calibration of the head by its board, photographic network, commissioning, each as far as the scene
/// has it. Errors: kBadInput for a scene with nothing to be measured; those of calibrate, adjust and commission for the scene itself
/// (for variants they stand in the table).
base::Result<base::ScenePlan> plan_scene(const fixtures::Scene& scene, const ScenePlanOptions& options, Session& session);

/// Draws the scene so many times with noise and measures it: errors against the truth over the covariances of the plan, which was made
/// for the same scene.
base::Result<base::Rehearsal> rehearse(const fixtures::Scene& scene, const base::ScenePlan& plan, const SurveyOptions& options,
                                       int draws, Session& session);

}  // namespace crosstie::app
