#pragma once

#include <string>
#include <vector>

#include "base/plan.h"
#include "report/detail/page.h"

namespace crosstie::report::detail {

/// The parts of the report of a plan; each returns finished markup.
std::vector<KeyFigure> plan_key_figures(const base::ScenePlan& plan);
std::string plan_points_section(const base::ScenePlan& plan);
std::string plan_variants_section(const base::ScenePlan& plan);
std::string plan_head_section(const base::CommissionPlan& plan);
std::string plan_axis_section(const base::CommissionPlan& plan);
std::string plan_network_section(const base::NetworkPlan& plan);
std::string plan_rehearsal_section(const base::Rehearsal& rehearsal);

}  // namespace crosstie::report::detail
