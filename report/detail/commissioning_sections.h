#pragma once

#include <string>
#include <vector>

#include "report/commissioning_report.h"
#include "report/detail/page.h"

namespace crosstie::report::detail {

/// The parts of the commissioning report; each returns finished markup.
std::vector<KeyFigure> commissioning_key_figures(const CommissioningView& view);
std::string commissioning_axis_section(const CommissioningView& view);
std::string commissioning_head_section(const CommissioningView& view);
std::string commissioning_rig_section(const CommissioningView& view);
std::string commissioning_spheres_section(const CommissioningView& view);
std::string commissioning_cross_section(const CommissioningView& view);
std::string commissioning_volume_section(const CommissioningView& view);
std::string commissioning_images_section(const CommissioningView& view);
std::string commissioning_adjustment_section(const CommissioningView& view);
std::string commissioning_rejected_section(const CommissioningView& view);

}  // namespace crosstie::report::detail
