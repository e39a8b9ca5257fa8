#include "report/model_comparison_report.h"

#include <array>
#include <cmath>
#include <limits>

#include <fmt/format.h>

#include "base/table.h"
#include "base/text.h"
#include "report/detail/html.h"
#include "report/detail/image_map.h"
#include "report/detail/image_plots.h"
#include "report/detail/number.h"
#include "report/detail/page.h"

namespace crosstie::report {
namespace {

using base::ModelComparison;
using base::ProjectionDifference;
using detail::number_cell;
using detail::text_cell;

constexpr double kDegrees = 57.295779513082323;

std::string place(const ProjectionDifference& difference) {
  return difference.distance_mm > 0.0 ? fmt::format("at {} mm", detail::plain(difference.distance_mm, 6)) : "at infinity";
}

double rotation_rad(const ProjectionDifference& difference) { return base::rotation_log(difference.b_from_a.rotation).norm(); }

std::vector<detail::KeyFigure> key_figures(const ProjectionDifference& difference) {
  std::vector<detail::KeyFigure> figures;
  const auto& test = difference.test;
  const std::string predicted =
      test ? fmt::format("{} px predicted by both covariances", detail::significant(test->rms_sigma_px))
           : "no prediction: a model is without covariance";
  figures.push_back({"Difference after the implied motion (rms)", fmt::format("{} px", detail::significant(difference.rms_px)),
                     predicted, test && test->exceeded() ? "fail" : ""});
  figures.push_back({"Largest", fmt::format("{} px", detail::significant(difference.max_px)),
                     fmt::format("of {} cells, {}", detail::counted(difference.cells), place(difference)), ""});
  figures.push_back({"Without the motion (rms)", fmt::format("{} px", detail::significant(difference.rms_before_px)),
                     fmt::format("largest {} px", detail::significant(difference.max_before_px)), ""});
  std::string motion = fmt::format("{}\u00b0", detail::significant(kDegrees * rotation_rad(difference)));
  if (difference.distance_mm > 0.0)
    motion += fmt::format(", {} mm", detail::significant(difference.b_from_a.translation_mm.norm()));
  figures.push_back({"Implied motion of the camera's frame", motion, "turn, and shift where the distance is finite", ""});
  if (test) {
    figures.push_back({"Over the prediction", detail::significant(difference.rms_px / test->rms_sigma_px),
                       fmt::format("p {}; {} degrees of freedom in effect", detail::probability(test->p),
                                   detail::significant(test->degrees, 2)),
                       test->exceeded() ? "fail" : ""});
  }
  return figures;
}

std::string meaning(const ModelComparison& comparison) {
  const ProjectionDifference& difference = comparison.difference;
  std::string text = detail::paragraph(fmt::format(
      "Every arrow begins at a pixel of {} and ends where {} sees the same point, {}. A camera that is turned a little "
      "sees nearly the same picture as one whose principal point is moved; so the motion of the camera's frame that "
      "explains most is taken out first: it goes into the poses, and no measurement notices it. What is left is how "
      "much the models really differ.",
      comparison.a.name, comparison.b.name, place(difference)));
  if (!difference.test) {
    return text +
           detail::paragraph("One of the models comes without covariance: nothing tells how large the difference may be.");
  }
  const base::DifferenceTest& test = *difference.test;
  return text +
         detail::paragraph(fmt::format(
             "{} Both covariances, taken as independent, predict an rms of {} px; {} px or more would come about by chance "
             "with "
             "p {}. Calibrations that share images are not independent and should differ by less.",
             test.exceeded() ? "The models differ by more than their covariances predict: the camera has changed between them, "
                               "or a sigma of one of them is not true."
                             : "The models differ by no more than their covariances predict.",
             detail::significant(test.rms_sigma_px), detail::significant(difference.rms_px), detail::probability(test.p)));
}

/// Lengths of a field; cells that did not count stay blank.
Eigen::VectorXd lengths(const ProjectionDifference& difference, const Eigen::Matrix2Xd& field) {
  Eigen::VectorXd values = field.colwise().norm();
  for (Eigen::Index i = 0; i < values.size(); ++i) {
    if (!difference.compared[static_cast<std::size_t>(i)]) values(i) = std::numeric_limits<double>::quiet_NaN();
  }
  return values;
}

std::string arrows(const ProjectionDifference& difference, const Eigen::Matrix2Xd& field, const std::string& title) {
  std::vector<detail::ImagePoint> points;
  for (Eigen::Index i = 0; i < field.cols(); ++i) {
    if (!difference.compared[static_cast<std::size_t>(i)] || !field.col(i).allFinite()) continue;
    points.push_back({difference.grid.middle_px(static_cast<int>(i)), field.col(i), ""});
  }
  return detail::residual_vectors(points, {difference.grid.width_px, difference.grid.height_px}, title);
}

std::string maps(const ProjectionDifference& difference) {
  const Eigen::VectorXd after = lengths(difference, difference.difference_px);
  std::vector<std::string> figures = {
      detail::figure(detail::image_map(difference.grid, after, "Difference after the implied motion", "difference"),
                     "Length of the difference. Cells in which a model is not calibrated do not count and stay blank."),
      detail::figure(arrows(difference, difference.difference_px, "Difference after the implied motion"), "Its direction."),
      detail::figure(detail::image_map(difference.grid, lengths(difference, difference.before_px),
                                       "Difference without the motion", "difference"),
                     "Both models in one frame: mostly what the motion takes out."),
      detail::figure(arrows(difference, difference.before_px, "Difference without the motion"), "Its direction.")};
  if (difference.sigma_px.size() > 0) {
    Eigen::VectorXd sigma = difference.sigma_px;
    for (Eigen::Index i = 0; i < sigma.size(); ++i) {
      if (!difference.compared[static_cast<std::size_t>(i)]) sigma(i) = std::numeric_limits<double>::quiet_NaN();
    }
    figures.push_back(detail::figure(detail::image_map(difference.grid, sigma, "Predicted sigma of the difference", "sigma"),
                                     "What both covariances predict for the difference after the motion."));
    if (difference.test) {
      figures.push_back(detail::figure(detail::image_map(difference.grid, after.cwiseQuotient(sigma),
                                                         "Difference over its sigma", "difference", {.unit = "sigmas"}),
                                       "Where it is large everywhere the models differ; neighbouring cells are correlated."));
    }
  }
  return detail::figures(figures);
}

std::string quantile_table(const ProjectionDifference& difference) {
  detail::HtmlTable table("Share of the compared cells whose difference is at most so large.",
                          {{"Share", "%"}, {"After the motion", "px"}, {"Without it", "px"}, {"Predicted sigma", "px"}});
  for (const base::DifferenceQuantile& one : base::quantiles(difference)) {
    const auto cell = [](double value) {
      return std::isfinite(value) ? number_cell(detail::significant(value), value) : text_cell("\u2013");
    };
    table.add_row({number_cell(detail::plain(100.0 * one.share), one.share), cell(one.after_px), cell(one.before_px),
                   cell(one.sigma_px)});
  }
  return table.html();
}

std::string motion_table(const ProjectionDifference& difference) {
  detail::HtmlTable table(
      "b_from_a: the motion that was taken out, about and along the camera's axes (x right, y down, z forward).",
      {{"Component", "", "", false}, {"Value", ""}, {"Unit", "", "", false}});
  const Eigen::Vector3d turn = kDegrees * base::rotation_log(difference.b_from_a.rotation);
  for (int i = 0; i < 3; ++i) {
    table.add_row({text_cell(fmt::format("turn about {}", "xyz"[i])), number_cell(detail::significant(turn(i), 4), turn(i)),
                   text_cell("\u00b0")});
  }
  for (int i = 0; i < 3 && difference.distance_mm > 0.0; ++i) {
    const double shift = difference.b_from_a.translation_mm(i);
    table.add_row({text_cell(fmt::format("shift along {}", "xyz"[i])), number_cell(detail::significant(shift, 4), shift),
                   text_cell("mm")});
  }
  return table.html();
}

std::string parameter_table(const base::NamedModel& model) {
  const base::Camera& camera = model.camera;
  detail::HtmlTable table(fmt::format("{}: {}, {} x {} px.", model.name, base::lens_model_name(camera.model()),
                                      camera.width_px(), camera.height_px()),
                          {{"Parameter", "", "", false}, {"Value", ""}, {"Sigma", ""}, {"U", "", "k = 2"}});
  table.limit_rows(60, "result.json");
  const auto names = base::parameter_names(camera.model());
  for (std::size_t i = 0; i < names.size(); ++i) {
    const auto k = static_cast<Eigen::Index>(i);
    const double value = camera.parameters()(k);
    const bool known = camera.covariance().size() > 0;
    const double sigma = known ? std::sqrt(std::max(0.0, camera.covariance()(k, k))) : 0.0;
    const int decimals = detail::decimals_for_sigma(sigma, 6);
    table.add_row({text_cell(std::string(names[i])), number_cell(detail::fixed(value, decimals), value),
                   known ? number_cell(detail::fixed(sigma, decimals), sigma) : text_cell("\u2013"),
                   known ? number_cell(detail::fixed(2.0 * sigma, decimals), 2.0 * sigma) : text_cell("\u2013")});
  }
  return table.html();
}

}  // namespace

std::string model_comparison_report(const ModelComparison& comparison, const ReportContext& context) {
  detail::Page page(context);
  page.key_figures(key_figures(comparison.difference));
  page.section("meaning", "What it says", meaning(comparison));
  page.section("maps", "Over the image", maps(comparison.difference));
  page.section("quantiles", "How large, how often", quantile_table(comparison.difference));
  page.section("motion", "Implied motion", motion_table(comparison.difference));
  page.section("models", "The models", parameter_table(comparison.a) + parameter_table(comparison.b));
  return page.html();
}

base::Result<> write_difference_table(const std::filesystem::path& path, const ProjectionDifference& difference) {
  base::Table table;
  table.columns = {"x_px", "y_px", "dx_px", "dy_px", "before_dx_px", "before_dy_px", "sigma_px", "compared"};
  const auto text = [](double value) { return std::isfinite(value) ? base::format_double(value) : std::string(); };
  for (int i = 0; i < difference.grid.count(); ++i) {
    const Eigen::Vector2d at = difference.grid.middle_px(i);
    std::vector<std::string> row;
    for (const double value : {at.x(), at.y(), difference.difference_px(0, i), difference.difference_px(1, i),
                               difference.before_px(0, i), difference.before_px(1, i)}) {
      row.push_back(text(value));
    }
    row.push_back(difference.sigma_px.size() > 0 ? text(difference.sigma_px(i)) : std::string());
    row.emplace_back(difference.compared[static_cast<std::size_t>(i)] ? "1" : "0");
    table.rows.push_back(std::move(row));
  }
  return base::write_table(path, table);
}

}  // namespace crosstie::report
