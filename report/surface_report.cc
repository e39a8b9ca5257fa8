#include "report/surface_report.h"

#include "base/table.h"
#include "base/text.h"
#include "report/detail/page.h"
#include "report/detail/surface_sections.h"
#include "report/detail/verification_sections.h"

namespace crosstie::report {

using base::format_double;
using base::Table;

std::string surface_report(const base::SurfaceVerification& verification, const ReportContext& context,
                           const base::Verification* points) {
  detail::Page page(context);
  std::vector<detail::KeyFigure> figures = detail::surface_key_figures(verification);
  if (points != nullptr) {
    const auto more = detail::verification_key_figures(*points);
    figures.insert(figures.end(), more.begin(), more.end());
  }
  page.key_figures(figures);
  page.warnings(verification.warnings);
  if (verification.surface) page.section("surface", "Surface", detail::surface_section(*verification.surface));
  if (verification.shape) {
    page.warnings(verification.shape->warnings);
    page.section("shape", verification.shape->shape == "cone" ? "Cone" : "Cylinder",
                 detail::shape_section(*verification.shape));
  }
  if (verification.edge) page.section("edge", "Rim of the hole", detail::edge_section(*verification.edge));
  if (points != nullptr) {
    page.warnings(points->warnings);
    page.section("fit", "Best fit of points", detail::verification_fit_section(*points));
    page.section("statistics", "Deviations of points", detail::verification_statistics_section(*points));
    if (!points->points.empty()) page.section("map", "Deviation map of points", detail::verification_plan_section(*points));
    page.section("lengths", "Test lengths", detail::verification_lengths_section(*points));
    page.section("points", "Points", detail::verification_points_section(*points));
    page.section("partners", "Points without a partner", detail::verification_partners_section(*points));
  }
  return page.html();
}

base::Result<> write_surface_tables(const std::filesystem::path& folder, const base::SurfaceVerification& verification) {
  if (verification.surface) {
    Table table;
    table.columns = {"x_mm", "y_mm", "z_mm", "deviation_mm"};
    for (std::size_t i = 0; i < verification.surface->points.size(); ++i) {
      const Eigen::Vector3d& p = verification.surface->points[i];
      table.rows.push_back({format_double(p.x()), format_double(p.y()), format_double(p.z()),
                            format_double(verification.surface->deviations_mm[i])});
    }
    if (auto written = base::write_table(folder / "surface.csv", table); !written) return written;
  }
  if (verification.edge) {
    const base::EdgeVerification& e = *verification.edge;
    Table table;
    table.columns = {"s_mm", "u_mm", "v_mm", "sigma_u_mm", "sigma_v_mm"};
    for (std::size_t i = 0; i < e.count; ++i) {
      table.rows.push_back({format_double(e.s_mm[i]), format_double(e.u_mm[i]), format_double(e.v_mm[i]),
                            format_double(e.sigma_u_mm[i]), format_double(e.sigma_v_mm[i])});
    }
    if (auto written = base::write_table(folder / "edge_deviations.csv", table); !written) return written;
  }
  return {};
}

}  // namespace crosstie::report
