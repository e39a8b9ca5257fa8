#include "report/bundle_report.h"

#include "report/detail/bundle_sections.h"
#include "report/detail/page.h"
#include "report/detail/scene.h"

namespace crosstie::report {

std::string bundle_report(const base::AdjustedNetwork& network, const ReportContext& context) {
  detail::Page page(context);
  page.key_figures(detail::bundle_key_figures(network));
  page.warnings(network.warnings);
  page.section("adjustment", "Adjustment", detail::bundle_adjustment_section(network));
  if (!network.variance_components.empty())
    page.section("components", "Are the stated sigmas true", detail::bundle_components_section(network));
  if (!network.points.empty()) {
    page.scene(
        "Network in 3D", detail::network_scene(network, detail::ellipse_magnification(network)),
        detail::paragraph(
            "The 3D view needs JavaScript and WebGL. The plan views below show the same points with their ellipses.", "muted"));
    page.section("plan", "Points and their precision", detail::bundle_plan_section(network));
  }
  page.section("points", "Points", detail::bundle_points_section(network));
  page.section("scale", "Scale bars", detail::bundle_scale_section(network));
  if (!network.rigs.empty()) page.section("rigs", "Rigs", detail::bundle_rigs_section(network));
  if (!network.control.empty()) page.section("control", "Control points", detail::bundle_control_section(network));
  page.section("images", "Images", detail::bundle_images_section(network));
  page.section("cameras", "Cameras", detail::bundle_cameras_section(network));
  page.section("residuals", "Residuals", detail::bundle_residuals_section(network));
  page.section("rejected", "Left out", detail::bundle_rejected_section(network));
  return page.html();
}

}  // namespace crosstie::report
