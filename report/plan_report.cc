#include "report/plan_report.h"

#include "report/detail/calibration_quality.h"
#include "report/detail/page.h"
#include "report/detail/plan_sections.h"
#include "report/detail/volume_section.h"

namespace crosstie::report {

std::string plan_report(const base::ScenePlan& plan, const std::vector<VolumeMap>& volume, const ReportContext& context) {
  detail::Page page(context);
  page.key_figures(detail::plan_key_figures(plan));
  if (!plan.points.empty()) page.section("points", "At the planned points", detail::plan_points_section(plan));
  if (!plan.variants.empty()) page.section("variants", "What if", detail::plan_variants_section(plan));
  if (plan.machine) {
    page.section("head", "Where the head will be", detail::plan_head_section(*plan.machine));
    if (!volume.empty()) {
      page.section("volume", "Uncertainty over the working volume", detail::volume_section(volume));
    }
    page.section("axis", "The X axis", detail::plan_axis_section(*plan.machine));
  }
  if (plan.network) page.section("network", "Points of the network", detail::plan_network_section(*plan.network));
  if (plan.calibration && plan.maps) {
    page.section("uncertainty", "Calibration of the head", detail::calibration_maps_section(*plan.calibration, *plan.maps));
  }
  if (plan.rehearsal) page.section("rehearsal", "Rehearsals", detail::plan_rehearsal_section(*plan.rehearsal));
  return page.html();
}

}  // namespace crosstie::report
