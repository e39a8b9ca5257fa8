#pragma once

#include <cstdint>
#include <optional>

#include "base/calibration.h"
#include "base/network.h"
#include "base/result.h"
#include "bundle/commission.h"
#include "fixtures/scene.h"

namespace crosstie::app {

/// How a scene of the twin is measured without photographs (fixtures/sampled.h).
struct SurveyOptions {
  double image_sigma_px = 0.03;   ///< of a coordinate of a marker's image
  double corner_sigma_px = 0.06;  ///< of a coordinate of a board's corner
  /// Seed of all that is drawn: board shape, temperatures, noise. Nothing: all is as stated and free of noise, and the sigmas say what
  /// the noise would be.
  std::optional<std::uint64_t> seed = {};
};

/// The scene as the options make it: drawn, or with the board and the cross exactly as stated.
fixtures::Scene surveyed(const fixtures::Scene& scene, const SurveyOptions& options);

/// The head calibrated by the scene's board, with the lens model of the scene's left camera. `made` is what surveyed() gave.
/// kBadInput where the scene has no board.
base::Result<base::Calibration> survey_head(const fixtures::Scene& made, const SurveyOptions& options);

/// The photographic network of the scene: views of the hand cameras, bars; bodies that move between the views, or that the reference
/// did not measure, take no part. Its frame is that of the reference campaign (its true points are the datum).
base::Network survey_network(const fixtures::Scene& made, const SurveyOptions& options);

/// What a commissioning of the scene starts from: the calibrated head, the cross by its campaign or by the scene's own network
/// (`adjusted`), the stations and the probed spheres.
base::Result<bundle::CommissionInput> survey_machine(const fixtures::Scene& made, const base::Calibration& calibration,
                                                     const base::AdjustedNetwork* adjusted, const SurveyOptions& options);

/// True coordinates of the markers in the frame of the reference campaign, without those that survey_network() leaves out.
base::PointList true_reference(const fixtures::Scene& made);

}  // namespace crosstie::app
