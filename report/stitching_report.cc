#include "report/stitching_report.h"

#include <algorithm>

#include "report/detail/plan_view.h"
#include "report/detail/stitching_sections.h"

namespace crosstie::report {
namespace {

/// The markers from where they spread most, for those who see no 3D view.
std::string flat_view(const base::Stitching& stitching) {
  std::vector<detail::PlanPoint> points;
  for (const base::StitchedMarker& marker : stitching.markers) {
    detail::PlanPoint& point = points.emplace_back();
    point.id = marker.id;
    point.xyz_mm = marker.xyz_mm;
    point.cov_mm2 = marker.cov_mm2;
  }
  if (points.size() < 3) return {};
  const auto [horizontal, vertical] = detail::plan_axes(points).front();
  return detail::plan_view(
      points, "Markers with their error ellipses",
      {.horizontal = horizontal, .vertical = vertical, .magnification = detail::plan_magnification(points, 0.02)});
}

}  // namespace

std::string stitching_report(const base::Stitching& stitching, const base::Cloud& merged, const ReportContext& context) {
  detail::Page page(context);
  page.key_figures(detail::stitching_key_figures(stitching, merged.points.size()));
  page.section("stations", "Where the stations are", detail::stitching_stations_section(stitching));
  page.section("sources", "Which source tells which direction", detail::stitching_sources_section(stitching));
  page.section("overlap", "How the surfaces agree", detail::stitching_overlap_section(stitching));
  page.scene("The merged cloud", detail::stitching_scene(stitching, merged), flat_view(stitching));
  page.section("drift", "Drift along the row", detail::stitching_drift_section(stitching));
  page.section("markers", "Markers", detail::stitching_markers_section(stitching));
  page.section("matching", "Matching of the surfaces (ICP)", detail::stitching_matching_section(stitching));
  return page.html();
}

}  // namespace crosstie::report
