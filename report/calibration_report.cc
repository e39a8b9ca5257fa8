#include "report/calibration_report.h"

#include "report/detail/calibration_quality.h"
#include "report/detail/calibration_sections.h"
#include "report/detail/page.h"

namespace crosstie::report {

std::string calibration_report(const base::Calibration& calibration, const base::CalibrationQuality& quality,
                               const ReportContext& context) {
  detail::Page page(context);
  page.key_figures(detail::calibration_key_figures(calibration));
  page.warnings(calibration.warnings);
  page.section("validation", "How well it predicts", detail::calibration_validation_section(calibration));
  page.section("cameras", "Cameras", detail::calibration_cameras_section(calibration));
  if (calibration.rig) page.section("rig", "Rig", detail::calibration_rig_section(*calibration.rig));
  if (quality.change)
    page.section("change", "Since the earlier calibration", detail::calibration_change_section(*quality.change));
  if (quality.maps) {
    page.section("uncertainty", "Uncertainty over the image", detail::calibration_maps_section(calibration, *quality.maps));
  }
  if (!quality.epipolar.empty()) {
    page.section("epipolar", "Pairs of images", detail::calibration_epipolar_section(quality.epipolar));
  }
  page.section("residuals", "Residuals and coverage", detail::calibration_residuals_section(calibration));
  page.section("views", "Images", detail::calibration_views_section(calibration));
  page.section("board", "Board", detail::calibration_board_section(calibration.board));
  page.section("trials", "Other ways to the same answer", detail::calibration_trials_section(calibration));
  page.section("rejected", "Left out", detail::calibration_rejected_section(calibration));
  return page.html();
}

}  // namespace crosstie::report
