#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "base/machine.h"
#include "base/phase_map.h"
#include "base/result.h"
#include "base/scan_summary.h"
#include "scan/match.h"

namespace crosstie::scan {

/// A place that both cameras see.
struct CurveSample {
  Eigen::Vector2d left_px = Eigen::Vector2d::Zero();
  Eigen::Vector3d p_in_rig_mm = Eigen::Vector3d::Zero();  ///< on the left pixel's ray, at about the right depth
  double off_px = 0.0;                                    ///< of its right image from the epipolar curve of the left one
  double sigma_px = 0.0;
};

/// Two directions of fringes: medians over parts of the left image of the distances of the places with equal phases.
std::vector<CurveSample> phase_samples(const DepthMap& depths, const base::Head& head);

/// One direction: where texture of the surface, in the mean of the fringe images, is seen by the right camera. A place of the left image
/// is found on the line of equal phase in the right one, by correlation over patches with free gain and offset; their slope and residuals
/// give the sigma. Patches that are flat, or look different from both sides, give nothing.
base::Result<std::vector<CurveSample>> texture_samples(const base::PhaseMap& left, const base::PhaseMap& right,
                                                       const DepthMap& depths, const base::Head& head);

std::vector<CurveSample> marker_samples(const std::vector<base::ScannedMarker>& markers, const base::Head& head);

/// Whether the head's cameras still stand to each other as calibrated. The distance between them and what they share cannot be told: no
/// distance from a curve changes with it. Not done with fewer than 3 samples.
base::HeadTest test_head(const base::Head& head, const std::vector<CurveSample>& samples, const std::string& source);

/// kBadInput with the term that explains most where the distances exceed `limit_px` by more than 5 sigmas, or where one term does by itself:
/// beyond 5 sigmas of noise and calibration together, with distances of more than a fifth of the limit (lenses are not known better).
/// That needs a head whose calibration has a covariance. A limit of 0 or less: nothing is refused.
base::Result<> judge_head(const base::HeadTest& test, double limit_px);

}  // namespace crosstie::scan
