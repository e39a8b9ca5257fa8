#pragma once

#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "base/pose.h"
#include "base/result.h"
#include "bundle/commission.h"

namespace crosstie::bundle::detail {

/// The image of a marker of the cross.
struct HeadRay {
  int image = 0;                                          ///< index into HeadSurvey::images
  int marker = 0;                                         ///< index into the cross's markers
  Eigen::Vector2d ellipse_px = Eigen::Vector2d::Zero();   ///< as measured
  Eigen::Vector2d measured_px = Eigen::Vector2d::Zero();  ///< reduced to the circle's centre
  Eigen::Matrix2d cov_px2 = Eigen::Matrix2d::Identity();
  Eigen::Matrix2d shape_px2 = Eigen::Matrix2d::Zero();  ///< see shape_of
  bool active = true;
  std::string reason = {};  ///< why it is not
  double w = 0.0;
};

struct HeadImage {
  std::string name;
  int station = 0;
  int camera = 0;  ///< 0 left, 1 right
};

struct HeadStation {
  std::string name;
  double axis_mm = 0.0;
  std::optional<base::Pose> cross_from_rig = {};
  std::string reason = {};  ///< why it takes no part; empty: it does
};

/// The photographs of the cross, sorted out.
struct HeadSurvey {
  std::vector<HeadStation> stations;  ///< by reading
  std::vector<HeadImage> images;
  std::vector<HeadRay> rays;
  std::vector<base::Warning> warnings;

  [[nodiscard]] std::vector<int> rays_of(int station) const;  ///< indices of active ones
};

/// kBadInput: a station's image that is not there, is named twice, or has another size than its camera; not finite readings;
/// kNoUniqueSolution where no marker of the cross is seen at all.
base::Result<HeadSurvey> survey_head(const CommissionInput& input);

/// Where each station's head stands, from three rays at a time (RANSAC on the generalised absolute pose), refined on all that agree;
/// rays farther than options.tolerance_px from there become inactive. Stations that cannot be oriented get a reason.
/// kBadInput where a station's photographs are swapped; kNoUniqueSolution where fewer than two stations are oriented.
base::Result<> orient_stations(const CommissionInput& input, const CommissionOptions& options, HeadSurvey& survey);

}  // namespace crosstie::bundle::detail
