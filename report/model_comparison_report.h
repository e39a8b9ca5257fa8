#pragma once

#include <filesystem>
#include <string>

#include "base/model_comparison.h"
#include "base/result.h"
#include "report/context.h"

namespace crosstie::report {

/// How two models of one camera differ, as one HTML file that needs nothing else: what it means, maps of the difference after the implied
/// motion and without it, quantiles, the motion, predicted sigmas where both models have a covariance, parameters side by side.
std::string model_comparison_report(const base::ModelComparison& comparison, const ReportContext& context);

/// The difference in every cell: x_px,y_px,dx_px,dy_px,before_dx_px,before_dy_px,sigma_px,compared; empty where there is none.
base::Result<> write_difference_table(const std::filesystem::path& path, const base::ProjectionDifference& difference);

}  // namespace crosstie::report
