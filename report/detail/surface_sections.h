#pragma once

#include <string>
#include <vector>

#include "base/surface_verification.h"
#include "report/detail/page.h"

namespace crosstie::report::detail {

/// The parts of a report on surfaces; each returns finished markup.
std::vector<KeyFigure> surface_key_figures(const base::SurfaceVerification& verification);
std::string surface_section(const base::SurfaceDeviations& surface);
std::string shape_section(const base::ShapeDeviations& shape);
std::string edge_section(const base::EdgeVerification& edge);

/// Deviations along a rim as hairs that stand on it, with the band of two sigmas and the limits of the drawing as given; all lengths mm.
std::string hair_diagram(const std::vector<double>& s_mm, const std::vector<double>& deviation_mm,
                         const std::vector<double>& sigma_mm, std::string_view title, std::string_view y_label);

}  // namespace crosstie::report::detail
