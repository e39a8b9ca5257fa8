#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "report/detail/error_motion.h"
#include "report/detail/html.h"
#include "report/detail/number.h"
#include "report/detail/plan_sections.h"

namespace crosstie::report::detail {
namespace {

using base::CommissionPlan;
using base::PlannedMotion;
using base::ScenePlan;

std::string place(const Eigen::Vector3d& at) {
  return fmt::format("{}, {}, {}", fixed(at.x(), 1), fixed(at.y(), 1), fixed(at.z(), 1));
}

Cell mm_cell(double value) { return std::isfinite(value) ? number_cell(significant(value), value) : text_cell("\u2013"); }

}  // namespace

std::vector<KeyFigure> plan_key_figures(const ScenePlan& plan) {
  std::vector<KeyFigure> figures;
  for (const base::PlannedPoint& point : plan.points) {
    const double sigma = base::worst_sigma(point.cov_mm2.value_or(point.frame_cov_mm2));
    figures.push_back(
        {fmt::format("U at {}", place(point.p_in_machine_mm)), fmt::format("{} mm", significant(2.0 * sigma)),
         fmt::format("k = 2, worst direction; {}",
                     point.cov_mm2 ? "one target measured there" : "by the frame alone: the cameras do not both see it"),
         ""});
  }
  if (plan.machine) {
    const CommissionPlan& machine = *plan.machine;
    figures.push_back({"Direction of the axis", fmt::format("{} \u00b5rad", significant(1e6 * machine.direction_sigma_rad)),
                       "standard deviation, the larger one across it", ""});
    figures.push_back({"Scale of the axis", fmt::format("{} ppm", significant(machine.expected.frame.axis.scale_sigma_ppm)),
                       fmt::format("standard deviation; from {} ppm on found", significant(machine.scale_smallest_ppm)), ""});
    for (const PlannedMotion& motion : machine.motions) {
      if (motion.name != "EBX" || motion.order != 1) continue;
      figures.push_back(
          {"Smallest pitch that is found",
           fmt::format("{} \u00b5rad", significant(1e6 * motion.range_factor * motion.smallest)),
           fmt::format("over the travel, with {} % power at the level {}", plain(100.0 * machine.power), plain(machine.level)),
           ""});
    }
  }
  if (plan.network) {
    figures.push_back(
        {"Points of the network (median)", fmt::format("{} mm", significant(plan.network->median_mm)),
         fmt::format("standard deviation in the worst direction; largest {} mm", significant(plan.network->max_mm)), ""});
  }
  if (plan.calibration && plan.calibration->rig) {
    figures.push_back({"Baseline by the board", fmt::format("{} mm", significant(plan.calibration->rig->baseline_sigma_mm)),
                       "standard deviation", ""});
  }
  if (plan.rehearsal) {
    const auto holds = std::count_if(plan.rehearsal->quantities.begin(), plan.rehearsal->quantities.end(),
                                     [](const base::RehearsedQuantity& one) { return one.holds(); });
    const auto all = static_cast<std::ptrdiff_t>(plan.rehearsal->quantities.size());
    figures.push_back({"Confirmed by rehearsals", fmt::format("{} of {} quantities", holds, all),
                       fmt::format("{} draws, {} without a result", plan.rehearsal->draws, plan.rehearsal->failed),
                       holds < all || plan.rehearsal->failed > 0 ? "warning" : ""});
  }
  return figures;
}

std::string plan_points_section(const ScenePlan& plan) {
  HtmlTable table(
      fmt::format(
          "Standard deviations of a place in machine, in its worst direction and along the machine's axes. By the frame: "
          "where the head's frame puts it. Measured: one target there, seen by both cameras with {} px in each coordinate, by "
          "the joint covariance of lenses, rig and frame.",
          plain(plan.image_sigma_px)),
      {{"Place", "mm", "x, y, z in machine", false},
       {"Reading", "mm", "where the head stands before it"},
       {"By the frame", "mm"},
       {"Measured", "mm"},
       {"sx", "mm"},
       {"sy", "mm"},
       {"sz", "mm"},
       {"U", "mm", "k = 2, worst direction"}});
  for (const base::PlannedPoint& point : plan.points) {
    const Eigen::Matrix3d& cov = point.cov_mm2 ? *point.cov_mm2 : point.frame_cov_mm2;
    std::vector<Cell> row = {
        text_cell(place(point.p_in_machine_mm)), number_cell(fixed(point.axis_mm, 1), point.axis_mm),
        mm_cell(base::worst_sigma(point.frame_cov_mm2)),
        point.cov_mm2 ? mm_cell(base::worst_sigma(*point.cov_mm2)) : text_cell("not seen by both", "prose")};
    for (int i = 0; i < 3; ++i) row.push_back(mm_cell(std::sqrt(std::max(0.0, cov(i, i)))));
    row.push_back(mm_cell(2.0 * base::worst_sigma(cov)));
    table.add_row(std::move(row));
  }
  return table.html();
}

std::string plan_head_section(const CommissionPlan& plan) {
  HtmlTable table(
      "Standard deviations of machine_from_rig at the stations: of where the left camera's projection centre is, and of turns "
      "about the "
      "machine's axes.",
      {{"Axis", "mm", "reading"},
       {"sx", "mm"},
       {"sy", "mm"},
       {"sz", "mm"},
       {"U", "mm", "k = 2, the largest of the three"},
       {"s rx", "\u00b5rad"},
       {"s ry", "\u00b5rad"},
       {"s rz", "\u00b5rad"},
       {"One stop", "mm", "by its reading, to be added for a single stop"}});
  for (const base::HeadPose& pose : plan.expected.checked_at) {
    const Eigen::Vector3d place_sigma =
        base::position_covariance(pose.machine_from_rig, pose.cov).diagonal().cwiseMax(0.0).cwiseSqrt();
    const Eigen::Vector3d stop =
        base::position_covariance(pose.machine_from_rig, pose.stop_cov).diagonal().cwiseMax(0.0).cwiseSqrt();
    std::vector<Cell> row = {number_cell(fixed(pose.axis_mm, 1), pose.axis_mm)};
    for (const double sigma : place_sigma) row.push_back(mm_cell(sigma));
    row.push_back(mm_cell(2.0 * place_sigma.maxCoeff()));
    for (int i = 0; i < 3; ++i) row.push_back(mm_cell(1e6 * std::sqrt(std::max(0.0, pose.cov(i, i)))));
    row.push_back(mm_cell(stop.maxCoeff()));
    table.add_row(std::move(row));
  }
  return table.html();
}

std::string plan_axis_section(const CommissionPlan& plan) {
  HtmlTable table(fmt::format("Error motions after ISO 230-1, each a Legendre polynomial over the travel. Smallest: what is "
                              "found with a power of {} % "
                              "at the level {}; smaller ones stay in the data and are in no sigma.",
                              plain(100.0 * plan.power), plain(plan.level)),
                  {{"Motion", "", "", false},
                   {"What it is", "", "", false},
                   {"Order", ""},
                   {"Sigma", "", "of the coefficient"},
                   {"Smallest", "", "coefficient"},
                   {"Smallest over the travel", "", "peak to valley"},
                   {"Unit", "", "", false},
                   {"In the scene", "", "whether the scene's own is so large that it is part of the axis", false}});
  for (const PlannedMotion& motion : plan.motions) {
    const ShownMotion* shown = shown_motion(motion.name);
    if (shown == nullptr) continue;
    const double unit = shown->per_unit;
    table.add_row({text_cell(motion.name), text_cell(shown->name), number_cell(std::to_string(motion.order), motion.order),
                   mm_cell(unit * motion.sigma), mm_cell(unit * motion.smallest),
                   mm_cell(unit * motion.range_factor * motion.smallest), text_cell(shown->unit),
                   text_cell(motion.in_model ? "yes" : "no", motion.in_model ? "" : "muted")});
  }
  return table.html();
}

std::string plan_network_section(const base::NetworkPlan& plan) {
  HtmlTable table(fmt::format("Standard deviations of the points in the datum {}; scale from {}.", plan.expected.datum,
                              plan.expected.scale),
                  {{"Id", ""},
                   {"sx", "mm"},
                   {"sy", "mm"},
                   {"sz", "mm"},
                   {"U", "mm", "k = 2, worst direction"},
                   {"Rays", ""},
                   {"Angle", "\u00b0", "largest between two rays"}});
  table.limit_rows(400, "result.json, network");
  constexpr double kDegrees = 57.295779513082323;
  for (const base::AdjustedPoint& point : plan.expected.points) {
    std::vector<Cell> row = {number_cell(std::to_string(point.id), point.id)};
    for (int i = 0; i < 3; ++i) row.push_back(mm_cell(std::sqrt(std::max(0.0, point.cov_mm2(i, i)))));
    row.push_back(mm_cell(2.0 * base::worst_sigma(point.cov_mm2)));
    row.push_back(number_cell(std::to_string(point.rays), point.rays));
    row.push_back(number_cell(fixed(kDegrees * point.angle_rad, 0), point.angle_rad));
    table.add_row(std::move(row));
  }
  return table.html();
}

std::string plan_rehearsal_section(const base::Rehearsal& rehearsal) {
  HtmlTable table(
      "Every draw measures the scene with noise, as the survey would. Square: errors against the truth over the planned "
      "covariance, e' C\u207b\u00b9 e, "
      "mean over the draws; it should be its degrees of freedom, within bounds that hold in 99.9 % of all cases. Error motions "
      "that are "
      "there but too small to be found are in no sigma and raise it.",
      {{"Quantity", "", "", false},
       {"Degrees of freedom", ""},
       {"Mean square", ""},
       {"Lower bound", ""},
       {"Upper bound", ""},
       {"Finding", "", "", false}});
  for (const base::RehearsedQuantity& one : rehearsal.quantities) {
    table.add_row({text_cell(one.name), number_cell(std::to_string(one.dof), one.dof),
                   number_cell(fixed(one.square, 2), one.square), number_cell(fixed(one.low, 2), one.low),
                   number_cell(fixed(one.high, 2), one.high),
                   text_cell(one.holds() ? "holds" : "beyond its bounds", one.holds() ? "ok" : "warning")});
  }
  std::string html = table.html();
  if (rehearsal.failed > 0) {
    html += paragraph(fmt::format("{} of {} draws gave no result; the first: {}", rehearsal.failed, rehearsal.draws,
                                  rehearsal.first_failure));
  }
  return html;
}

}  // namespace crosstie::report::detail
