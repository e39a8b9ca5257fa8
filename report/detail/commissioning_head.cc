#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "report/detail/commissioning_sections.h"
#include "report/detail/html.h"
#include "report/detail/number.h"

namespace crosstie::report::detail {
namespace {

constexpr double kDegrees = 57.295779513082323;
constexpr double kLargeW = 3.29;  // 0.1 % two-sided

std::vector<double> position_sigmas(const base::Pose& pose, const base::Matrix6d& cov) {
  const Eigen::Vector3d sigma = base::position_covariance(pose, cov).diagonal().cwiseMax(0.0).cwiseSqrt();
  return {sigma.x(), sigma.y(), sigma.z()};
}

std::string station_at(const base::Commissioning& result, double axis_mm) {
  const auto found = std::find_if(result.stations.begin(), result.stations.end(),
                                  [&](const base::CommissionedStation& station) { return station.axis_mm == axis_mm; });
  return found == result.stations.end() ? "" : found->name;
}

/// The stations have names; what lies between them has none.
std::string pose_table(const base::Commissioning& result, const std::vector<base::HeadPose>& states) {
  std::vector<double> mm;
  std::vector<double> mrad;
  for (const base::HeadPose& state : states) {
    for (const double sigma : position_sigmas(state.machine_from_rig, state.cov)) mm.push_back(sigma);
    for (Eigen::Index i = 0; i < 3; ++i) mrad.push_back(1e3 * std::sqrt(std::max(0.0, state.cov(i, i))));
  }
  const int decimals = decimals_for_column(mm, 4);
  const int angle_decimals = decimals_for_column(mrad, 4);
  HtmlTable table(
      "machine_from_rig: where the left camera's projection centre is in the machine, with the sigmas of the position and of "
      "turns about "
      "the machine's axes. Rotation as the vector of its axis, as long as its angle. U is twice the sigma.",
      {{"Axis", "mm", "reading", true},
       {"Station", "", "", false},
       {"x", "mm"},
       {"y", "mm"},
       {"z", "mm"},
       {"sx", "mm"},
       {"sy", "mm"},
       {"sz", "mm"},
       {"U", "mm", "k = 2, the largest of the three"},
       {"rx", "\u00b0"},
       {"ry", "\u00b0"},
       {"rz", "\u00b0"},
       {"s rx", "mrad"},
       {"s ry", "mrad"},
       {"s rz", "mrad"}});
  table.limit_rows(400, "result.json, checked_at");
  for (const base::HeadPose& state : states) {
    const std::vector<double> sigmas = position_sigmas(state.machine_from_rig, state.cov);
    std::vector<Cell> row = {number_cell(plain(state.axis_mm, 8), state.axis_mm), text_cell(station_at(result, state.axis_mm))};
    const auto add = [&](double value, int digits) { row.push_back(number_cell(fixed(value, digits), value)); };
    for (const double value : state.machine_from_rig.translation_mm) add(value, decimals);
    for (const double sigma : sigmas) add(sigma, decimals);
    add(2.0 * *std::max_element(sigmas.begin(), sigmas.end()), decimals);
    for (const double value : Eigen::Vector3d(kDegrees * base::rotation_log(state.machine_from_rig.rotation))) add(value, 5);
    for (Eigen::Index i = 0; i < 3; ++i) add(1e3 * std::sqrt(std::max(0.0, state.cov(i, i))), angle_decimals);
    table.add_row(std::move(row));
  }
  return table.html();
}

}  // namespace

std::string commissioning_rig_section(const CommissioningView& view) {
  const base::Head& before_head = view.calibrated;
  const base::Head& now_head = view.result.head;
  if (before_head.cov.size() == 0 || now_head.cov.size() == 0) {
    return paragraph("The rig came without covariance: nothing can be said of its change.");
  }
  const base::Vector6d change = base::difference(before_head.right_from_left, now_head.right_from_left);
  const base::Matrix6d before_cov = before_head.cov.bottomRightCorner<6, 6>();
  const base::Matrix6d now_cov = now_head.cov.bottomRightCorner<6, 6>();
  const base::Matrix6d change_cov = before_cov - now_cov;
  HtmlTable table(
      "right_from_left, as it was calibrated and as it came out together with the cross. The change is small turns about and "
      "shifts along "
      "the right camera's axes; its sigma is that of the difference between a prior and what it became (the difference of the "
      "variances). "
      "Far beyond it, the head has changed since it was calibrated.",
      {{"Component", "", "", false},
       {"Calibrated", ""},
       {"Sigma before", ""},
       {"Now", ""},
       {"Sigma now", ""},
       {"Change", ""},
       {"Change over sigma", ""}});
  static constexpr std::array<const char*, 6> kNames = {"rx [mrad]", "ry [mrad]", "rz [mrad]", "x [mm]", "y [mm]", "z [mm]"};
  const Eigen::Vector3d before_turn = 1e3 * base::rotation_log(before_head.right_from_left.rotation);
  const Eigen::Vector3d now_turn = 1e3 * base::rotation_log(now_head.right_from_left.rotation);
  for (Eigen::Index i = 0; i < 6; ++i) {
    const double per_unit = i < 3 ? 1e3 : 1.0;
    const double before = i < 3 ? before_turn(i) : before_head.right_from_left.translation_mm(i - 3);
    const double now = i < 3 ? now_turn(i) : now_head.right_from_left.translation_mm(i - 3);
    const double sigma_before = per_unit * std::sqrt(std::max(0.0, before_cov(i, i)));
    const double sigma_now = per_unit * std::sqrt(std::max(0.0, now_cov(i, i)));
    const double sigma_change = std::sqrt(std::max(0.0, change_cov(i, i)));
    const int decimals = decimals_for_sigma(sigma_now, 4);
    const double over = sigma_change > 0.0 ? change(i) / sigma_change : 0.0;
    table.add_row({text_cell(kNames[static_cast<std::size_t>(i)]), number_cell(fixed(before, decimals), before),
                   number_cell(fixed(sigma_before, decimals), sigma_before), number_cell(fixed(now, decimals), now),
                   number_cell(fixed(sigma_now, decimals), sigma_now),
                   number_cell(fixed(per_unit * change(i), decimals), per_unit * change(i)),
                   number_cell(fixed(over, 2), over, std::abs(over) > kLargeW ? "warning" : "")});
  }
  std::string html = definition_list(
      {{"Baseline", with_sigma(view.result.baseline_mm, view.result.baseline_sigma_mm, "mm")},
       {"Expanded (k = 2)", expanded(view.result.baseline_sigma_mm, "mm")},
       {"Head's temperature at calibration",
        now_head.temperature_c ? fmt::format("{} \u00b0C", plain(*now_head.temperature_c)) : std::string("not stated")}});
  return html + table.html();
}

std::string commissioning_head_section(const CommissioningView& view) {
  const base::Commissioning& result = view.result;
  std::vector<base::HeadPose> poses = {result.machine_from_rig_at_zero};
  poses.insert(poses.end(), result.checked_at.begin(), result.checked_at.end());
  std::stable_sort(poses.begin(), poses.end(), [](const auto& a, const auto& b) { return a.axis_mm < b.axis_mm; });
  std::string html = pose_table(result, poses);
  if (!result.zero_in_travel) {
    html += paragraph(
        "Reading 0 lies outside of the travel: the pose there is that of the straight axis, and its sigma knows nothing of "
        "error motions out there.",
        "muted");
  }
  html += paragraph(
      "A single stop scatters about this pose by the reading's sigma and the stops' own scatter (stop_cov in result.json); "
      "it is to be added for one stop and averages over many, the pose's own uncertainty does not.");
  return html;
}

}  // namespace crosstie::report::detail
