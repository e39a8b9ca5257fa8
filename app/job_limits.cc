// [limits]

#include "app/job_sections.h"

namespace crosstie::app {

void read_limits(const JobTable& root, Job& job) {
  const auto table = root.table("limits");
  if (!table) return;
  table->check_keys("limits",
                    {"sigma0_px",        "scale_bar_w",        "control_w",        "heldout_rms_px",       "halves_ratio",
                     "area_not_covered", "prior_ratio",        "sphere_w",         "rig_change_w",         "epipolar_px",
                     "seam_mm",          "calibration_change", "off_axis_w",       "frame_u_mm",           "baseline_sigma_mm",
                     "point_sigma_mm",   "deviation_rms_mm",   "deviation_max_mm", "surface_tolerance_mm", "surface_p95_mm",
                     "edge_rms_mm",      "length_mpe_a_mm",    "length_mpe_k"});
  JobLimits& limits = job.limits;
  table->number("sigma0_px", limits.sigma0_px);
  table->number("scale_bar_w", limits.scale_bar_w);
  table->number("control_w", limits.control_w);
  table->number("heldout_rms_px", limits.heldout_rms_px);
  table->number("halves_ratio", limits.halves_ratio);
  table->number("area_not_covered", limits.area_not_covered);
  table->number("prior_ratio", limits.prior_ratio);
  table->number("sphere_w", limits.sphere_w);
  table->number("rig_change_w", limits.rig_change_w);
  table->number("epipolar_px", limits.epipolar_px);
  table->number("seam_mm", limits.seam_mm);
  table->number("calibration_change", limits.calibration_change);
  table->number("off_axis_w", limits.off_axis_w);
  table->number("frame_u_mm", limits.frame_u_mm);
  table->number("baseline_sigma_mm", limits.baseline_sigma_mm);
  table->number("point_sigma_mm", limits.point_sigma_mm);
  table->number("deviation_rms_mm", limits.deviation_rms_mm);
  table->number("deviation_max_mm", limits.deviation_max_mm);
  table->number("surface_tolerance_mm", limits.surface_tolerance_mm);
  table->number("surface_p95_mm", limits.surface_p95_mm);
  table->number("edge_rms_mm", limits.edge_rms_mm);
  table->number("length_mpe_a_mm", limits.length_mpe_a_mm);
  table->number("length_mpe_k", limits.length_mpe_k);
}

}  // namespace crosstie::app
