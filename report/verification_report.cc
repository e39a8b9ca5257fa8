#include "report/verification_report.h"

#include "report/detail/page.h"
#include "report/detail/scene.h"
#include "report/detail/verification_sections.h"

namespace crosstie::report {

std::string verification_report(const base::Verification& verification, const ReportContext& context) {
  detail::Page page(context);
  page.key_figures(detail::verification_key_figures(verification));
  page.warnings(verification.warnings);
  page.section("fit", "Best fit", detail::verification_fit_section(verification));
  page.section("statistics", "Deviations", detail::verification_statistics_section(verification));
  if (!verification.points.empty()) {
    page.section("map", "Deviation map", detail::verification_plan_section(verification));
    page.scene(
        "Deviations in 3D", detail::verification_scene(verification, detail::deviation_magnification(verification)),
        detail::paragraph("The 3D view needs JavaScript and WebGL. The deviation map above shows the same arrows.", "muted"));
  }
  page.section("lengths", "Test lengths", detail::verification_lengths_section(verification));
  page.section("points", "Points", detail::verification_points_section(verification));
  if (!verification.by_position.points.empty() || !verification.by_position.unpaired.empty()) {
    page.section("uncoded", "Uncoded targets", detail::verification_position_section(verification));
  }
  page.section("partners", "Points without a partner", detail::verification_partners_section(verification));
  return page.html();
}

}  // namespace crosstie::report
