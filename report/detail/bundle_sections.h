#pragma once

#include <string>
#include <vector>

#include "base/network.h"
#include "report/detail/page.h"
#include "report/detail/plan_view.h"

namespace crosstie::report::detail {

/// The parts of the bundle report; each returns finished markup.
std::vector<KeyFigure> bundle_key_figures(const base::AdjustedNetwork& network);
std::string bundle_adjustment_section(const base::AdjustedNetwork& network);
std::string bundle_components_section(const base::AdjustedNetwork& network);
std::string bundle_points_section(const base::AdjustedNetwork& network);
std::string bundle_plan_section(const base::AdjustedNetwork& network);
std::string bundle_images_section(const base::AdjustedNetwork& network);
std::string bundle_cameras_section(const base::AdjustedNetwork& network);
std::string bundle_residuals_section(const base::AdjustedNetwork& network);
std::string bundle_scale_section(const base::AdjustedNetwork& network);
std::string bundle_rigs_section(const base::AdjustedNetwork& network);
std::string bundle_control_section(const base::AdjustedNetwork& network);
std::string bundle_rejected_section(const base::AdjustedNetwork& network);

/// sigma0 has the relative standard deviation 1 / sqrt(2 r) for r degrees of freedom.
double relative_sigma_of_sigma0(const base::AdjustedNetwork& network);
/// Whether the sigmas were taken from the residuals themselves: the adjustment warns of it.
bool sigmas_were_adapted(const base::AdjustedNetwork& network);

/// Points with their ellipses as the plan views draw them.
std::vector<PlanPoint> plan_points(const base::AdjustedNetwork& network);
/// Magnification at which the ellipses can be seen, for the plan views and the 3D view alike.
double ellipse_magnification(const base::AdjustedNetwork& network);

}  // namespace crosstie::report::detail
