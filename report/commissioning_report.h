#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "base/machine.h"
#include "report/context.h"

namespace crosstie::report {

/// Expanded uncertainty (k = 2, worst direction) of where a point lies in the machine's frame, over a plane of the working volume: what
/// the frame contributes (target registration error); the noise of a later scan and of a single stop are not in it.
struct VolumeMap {
  std::string title;
  std::string x_label;
  std::string y_label;
  double x_low = 0.0;
  double x_high = 1.0;
  double y_low = 0.0;
  double y_high = 1.0;
  Eigen::MatrixXd expanded_mm;  ///< rows along y from low to high, columns along x
};

/// What the report shows: the result with what it started from, and its axis and volume at many places.
struct CommissioningView {
  const base::Commissioning& result;
  const base::Head& calibrated;  ///< the head before
  const base::Cross& cross;
  std::vector<base::HeadPose> along;  ///< over the travel, from end to end
  std::vector<VolumeMap> volume;
};

/// One self-contained HTML page on a commissioning: verdicts, rig before and after, the axis with its error motions, where the head
/// is at each station, spheres with leave-one-out deviations, uncertainty over the working volume, image residuals, what was left out.
/// It opens offline and holds no date: the same input gives the same bytes.
std::string commissioning_report(const CommissioningView& view, const ReportContext& context);

}  // namespace crosstie::report
