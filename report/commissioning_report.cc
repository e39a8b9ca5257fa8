#include "report/commissioning_report.h"

#include "report/detail/commissioning_sections.h"
#include "report/detail/page.h"

namespace crosstie::report {

std::string commissioning_report(const CommissioningView& view, const ReportContext& context) {
  detail::Page page(context);
  page.key_figures(detail::commissioning_key_figures(view));
  page.warnings(view.result.warnings);
  page.section("head", "Where the head is", detail::commissioning_head_section(view));
  page.section("volume", "Uncertainty over the working volume", detail::commissioning_volume_section(view));
  page.section("axis", "The X axis", detail::commissioning_axis_section(view));
  page.section("spheres", "Spheres", detail::commissioning_spheres_section(view));
  page.section("rig", "The rig, before and now", detail::commissioning_rig_section(view));
  page.section("cross", "The cross", detail::commissioning_cross_section(view));
  page.section("images", "Stations and images", detail::commissioning_images_section(view));
  page.section("adjustment", "Adjustment", detail::commissioning_adjustment_section(view));
  page.section("rejected", "Left out", detail::commissioning_rejected_section(view));
  return page.html();
}

}  // namespace crosstie::report
