#include "report/head_check_report.h"

#include <array>

#include <fmt/format.h>

#include "report/detail/html.h"
#include "report/detail/number.h"
#include "report/detail/page.h"

namespace crosstie::report {
namespace {

using namespace detail;  // NOLINT(google-build-using-namespace): the building blocks of all reports

std::string tests_table(const base::HeadCheck& check) {
  HtmlTable table(
      fmt::format("Each test with the probability p of a value at least this far off if nothing had moved. It accuses "
                  "below its share of the level {}.",
                  plain(check.level)),
      {{"Test", "", "", false},
       {"Value", ""},
       {"Sigma", ""},
       {"Unit", "", "", false},
       {"Chi-square", ""},
       {"Degrees of freedom", ""},
       {"p", ""},
       {"Finding", "", "", false}});
  for (const base::HeadCheck::Test& test : check.tests) {
    table.add_row({text_cell(test.name), number_cell(significant(test.value), test.value),
                   test.sigma > 0.0 ? number_cell(significant(test.sigma, 2), test.sigma) : text_cell("\u2013"),
                   text_cell(test.unit), number_cell(significant(test.statistic), test.statistic),
                   number_cell(std::to_string(test.dof), test.dof), number_cell(significant(test.p, 2), test.p),
                   text_cell(test.accused ? "accused" : "holds", test.accused ? "fail" : "ok")});
  }
  return table.html();
}

std::string change_table(const std::string& caption, const base::Vector6d& change, const base::Vector6d& sigma,
                         const std::array<bool, 6>& seen) {
  static constexpr std::array<const char*, 6> kNames = {"rx [mrad]", "ry [mrad]", "rz [mrad]", "x [mm]", "y [mm]", "z [mm]"};
  HtmlTable table(caption,
                  {{"Component", "", "", false}, {"Change", ""}, {"Sigma", ""}, {"U (k = 2)", ""}, {"Over sigma", ""}});
  for (Eigen::Index i = 0; i < 6; ++i) {
    const char* name = kNames[static_cast<std::size_t>(i)];
    if (!seen[static_cast<std::size_t>(i)]) {
      table.add_row(
          {text_cell(name), text_cell("not seen", "muted"), text_cell("\u2013"), text_cell("\u2013"), text_cell("\u2013")});
      continue;
    }
    const double per_unit = i < 3 ? 1e3 : 1.0;
    const double value = per_unit * change(i);
    const double s = per_unit * sigma(i);
    const int decimals = decimals_for_sigma(s, 4);
    table.add_row({text_cell(name), number_cell(fixed(value, decimals), value), number_cell(fixed(s, decimals), s),
                   number_cell(fixed(2.0 * s, decimals), 2.0 * s),
                   number_cell(s > 0.0 ? fixed(value / s, 2) : "\u2013", s > 0.0 ? value / s : 0.0)});
  }
  return table.html();
}

}  // namespace

std::string head_check_report(const base::HeadCheck& check, const std::string& verdict, const ReportContext& context) {
  Page page(context);
  page.key_figures({{"Verdict", std::string(base::verdict_name(check.verdict)), verdict,
                     check.verdict == base::HeadCheck::Verdict::kHolds ? "" : "fail"},
                    {"Axis reading", fmt::format("{} mm", plain(check.axis_mm, 7)), "", ""},
                    {"Markers", fmt::format("{} in both images", check.common_markers),
                     fmt::format("{} images of the cross's markers", check.cross_markers), ""},
                    {"Epipolar residual, rms", fmt::format("{} px", significant(check.epipolar_rms_px, 2)), "", ""},
                    {"Against the cross, rms", fmt::format("{} px", significant(check.rms_px, 2)), "pose free", ""}});
  page.warnings(check.warnings);
  page.section("tests", "Tests", paragraph(check.message) + tests_table(check));
  page.section("rig", "The cameras against each other",
               change_table("right_from_left now against the commissioning: small turns and shifts.", check.rig_change,
                            check.rig_change_sigma, check.rig_seen));
  std::array<bool, 6> head_seen{};
  head_seen.fill(check.cross_markers > 0);
  page.section("head", "The head against the cross",
               change_table("machine_from_rig now, through the cross, against the frame: small turns and shifts in machine.",
                            check.head_change, check.head_change_sigma, head_seen));
  return page.html();
}

}  // namespace crosstie::report
