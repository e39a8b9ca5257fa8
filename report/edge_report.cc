#include "report/edge_report.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <fmt/format.h>

#include "report/detail/html.h"
#include "report/detail/number.h"
#include "report/detail/page.h"
#include "report/detail/plot.h"

namespace crosstie::report {
namespace {

using detail::number_cell;
using detail::text_cell;

std::vector<double> arc_of(const base::EdgeCurve& curve) {
  std::vector<double> s;
  for (const base::EdgePoint& point : curve.points) s.push_back(point.s_mm);
  return s;
}

std::vector<double> sigmas_of(const base::EdgeCurve& curve, double base::EdgePoint::*member) {
  std::vector<double> sigmas;
  for (const base::EdgePoint& point : curve.points) sigmas.push_back(point.*member);
  return sigmas;
}

std::vector<detail::KeyFigure> key_figures(const EdgeView& view) {
  const double sigma_u = detail::median(sigmas_of(view.curve, &base::EdgePoint::sigma_u_mm));
  const double sigma_v = detail::median(sigmas_of(view.curve, &base::EdgePoint::sigma_v_mm));
  double missing = 0.0;
  for (const base::EdgeGap& gap : view.curve.gaps) missing += gap.length_mm;
  std::vector<detail::KeyFigure> figures = {
      {"Length", fmt::format("{} mm", detail::fixed(view.curve.length_mm, 2)),
       fmt::format("{} points, {}", view.curve.points.size(), view.curve.closed ? "closed" : "open"), ""},
      {"Gaps", std::to_string(view.curve.gaps.size()),
       view.curve.gaps.empty() ? std::string("none") : fmt::format("{} mm together, not bridged", detail::fixed(missing, 1)),
       view.curve.gaps.empty() ? "" : "warning"},
      {"Sigma across (median)", fmt::format("{} mm", detail::significant(sigma_u, 2)), detail::expanded(sigma_u, "mm"), ""},
      {"Sigma along the normal (median)", fmt::format("{} mm", detail::significant(sigma_v, 2)),
       detail::expanded(sigma_v, "mm"), ""}};
  if (view.rms_u_mm) {
    figures.push_back({"Nominal", fmt::format("rms {} mm", detail::significant(*view.rms_u_mm, 2)), view.nominal, ""});
  }
  return figures;
}

/// Deviations along the arc: the hairs are drawn to scale against the arc's own length.
std::string hair_diagram(const EdgeView& view) {
  const std::vector<double> s = arc_of(view.curve);
  const std::vector<double> sigma = sigmas_of(view.curve, &base::EdgePoint::sigma_u_mm);
  double reach = 1e-3;
  for (std::size_t i = 0; i < s.size(); ++i) reach = std::max(reach, std::abs(view.off_u_mm[i]) + 2.0 * sigma[i]);
  detail::PlotOptions options;
  options.width_px = 1040.0;
  detail::Plot plot("Deviation from the nominal", "hairs from the nominal to each point",
                    detail::make_axis(0.0, s.back(), 10, false), detail::make_axis(-reach, reach), "arc length [mm]", "u [mm]",
                    options);
  std::vector<double> low, high;
  for (const double value : sigma) {
    low.push_back(-2.0 * value);
    high.push_back(2.0 * value);
  }
  plot.band(s, low, high, "band");
  for (std::size_t i = 0; i < s.size(); ++i) {
    const std::array<double, 2> x = {s[i], s[i]};
    const std::array<double, 2> y = {0.0, view.off_u_mm[i]};
    plot.curve(x, y, "curve c1");
    plot.point(s[i], view.off_u_mm[i], "dot", "", fmt::format("{} mm", detail::fixed(view.off_u_mm[i], 3)), 2.0);
  }
  plot.legend("band", "two sigmas");
  return plot.str();
}

std::string sigma_plot(const EdgeView& view) {
  const std::vector<double> s = arc_of(view.curve);
  const std::vector<double> u = sigmas_of(view.curve, &base::EdgePoint::sigma_u_mm);
  const std::vector<double> v = sigmas_of(view.curve, &base::EdgePoint::sigma_v_mm);
  const double highest = std::max(*std::max_element(u.begin(), u.end()), *std::max_element(v.begin(), v.end()));
  detail::Plot plot("Sigmas along the arc", "sigma across the rim and along the normal",
                    detail::make_axis(0.0, s.back(), 8, false), detail::make_axis(0.0, highest), "arc length [mm]",
                    "sigma [mm]");
  plot.curve(s, u, "curve c1");
  plot.curve(s, v, "curve c2");
  plot.legend("curve c1", "across the rim");
  plot.legend("curve c2", "along the normal");
  return plot.str();
}

std::string camera_plot(const EdgeView& view) {
  const std::vector<double> s = arc_of(view.curve);
  double reach = 1e-3;
  for (const auto& camera : view.camera_off_mm) {
    for (const double off : camera) {
      if (std::isfinite(off)) reach = std::max(reach, std::abs(off));
    }
  }
  detail::Plot plot("Cameras against each other", "each camera's rim from that of both",
                    detail::make_axis(0.0, s.back(), 8, false), detail::make_axis(-reach, reach), "arc length [mm]", "u [mm]");
  for (std::size_t camera = 0; camera < 2; ++camera) {
    const char* style = camera == 0 ? "dot" : "dot out";
    for (std::size_t i = 0; i < s.size(); ++i) {
      const double off = view.camera_off_mm[camera][i];
      if (std::isfinite(off)) plot.point(s[i], off, style, "", "", 2.0);
    }
    plot.legend(style, camera == 0 ? "left" : "right");
  }
  return plot.str();
}

/// The edge pixels of an image with the curve over them.
std::string overlay(const EdgeView& view, std::size_t camera) {
  constexpr double kMargin = 15.0;
  const base::EdgePixels& edges = view.edges[camera];
  Eigen::Vector2d low = Eigen::Vector2d::Constant(std::numeric_limits<double>::infinity());
  Eigen::Vector2d high = -low;
  for (const Eigen::Vector2d& at : view.curve_px[camera]) {
    low = low.cwiseMin(at);
    high = high.cwiseMax(at);
  }
  if (!low.allFinite() || !high.allFinite()) return "";
  low.array() -= kMargin;
  high.array() += kMargin;
  detail::PlotOptions options;
  options.equal_scale = true;
  options.y_down = true;
  detail::Plot plot(fmt::format("{} image", edges.camera), "edge pixels by class, and the curve",
                    detail::make_axis(low.x(), high.x(), 6, false), detail::make_axis(low.y(), high.y(), 6, false), "x [px]",
                    "y [px]", options);
  for (const base::EdgePixel& pixel : edges.pixels) {
    if ((pixel.at_px.array() < low.array()).any() || (pixel.at_px.array() > high.array()).any()) continue;
    const char* colour = pixel.kind == base::EdgeClass::kMaterial ? "#2a9d4a"
                         : pixel.kind == base::EdgeClass::kShadow ? "#5a78d0"
                                                                  : "#d08a2a";
    plot.point(pixel.at_px.x(), pixel.at_px.y(), "dot", colour, "", 1.2);
  }
  for (const Eigen::Vector2d& at : view.curve_px[camera]) plot.point(at.x(), at.y(), "dot", "#c0202a", "", 2.0);
  return plot.str();
}

std::string tables(const EdgeView& view) {
  detail::HtmlTable fates("What became of the edge pixels in the region.", {{"Fate", "", "", false}, {"Pixels", ""}});
  for (const auto& [fate, count] : view.fates)
    fates.add_row({text_cell(fate), number_cell(detail::counted(count), static_cast<double>(count))});
  std::string html = fates.html();
  if (!view.curve.gaps.empty()) {
    detail::HtmlTable gaps("Parts of the rim without points; nothing was drawn across them.",
                           {{"Ends at", "mm", "arc length", true}, {"Length", "mm"}, {"Why", "", "", false}});
    for (const base::EdgeGap& gap : view.curve.gaps) {
      gaps.add_row({number_cell(detail::fixed(gap.from_mm, 1), gap.from_mm),
                    number_cell(detail::fixed(gap.length_mm, 1), gap.length_mm), text_cell(gap.reason)});
    }
    html += gaps.html();
  }
  return html;
}

}  // namespace

std::string edge_report(const EdgeView& view, const ReportContext& context) {
  detail::Page page(context);
  page.key_figures(key_figures(view));
  if (!view.off_u_mm.empty()) {
    page.section(
        "hairs", "Deviation from the nominal",
        detail::figure(
            hair_diagram(view),
            "Each hair leads from the nominal to a measured point, across the rim in the surface; positive u is to the left of "
            "the way as seen from the head. The band is two sigmas wide to either side.",
            true));
  }
  page.section(
      "sigmas", "Precision along the arc",
      detail::figures({detail::figure(sigma_plot(view),
                                      fmt::format("All parts together. Roughness of the rim beyond the sigmas of its points: "
                                                  "factor {}, contained in them.",
                                                  detail::fixed(view.roughness_factor, 2))),
                       detail::figure(camera_plot(view),
                                      "A chamfer or burr, or another edge taken for this one, shows as a difference.")}));
  page.section(
      "images", "Edge pixels",
      detail::paragraph("Material edges are green, shadows blue, paint orange; the curve's points are red.") +
          detail::figures({detail::figure(overlay(view, 0), "Left image."), detail::figure(overlay(view, 1), "Right image.")}));
  page.section("fates", "What was left out", tables(view));
  return page.html();
}

}  // namespace crosstie::report
