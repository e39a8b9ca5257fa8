#include "report/edge_report.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <fmt/format.h>
#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>

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
    figures.push_back(
        {"From the fitted nominal", fmt::format("rms {} mm", detail::significant(*view.rms_u_mm, 2)), view.nominal, ""});
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

/// The curve in its own plane with the deviations as hairs, drawn larger than they are.
std::string plan_view(const EdgeView& view) {
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  for (const base::EdgePoint& point : view.curve.points)
    middle += point.point_mm / static_cast<double>(view.curve.points.size());
  Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();
  for (const base::EdgePoint& point : view.curve.points) {
    spread += (point.point_mm - middle) * (point.point_mm - middle).transpose();
    normal += point.normal;
  }
  // Its longest extent lies to the right, and it is seen from the head.
  const Eigen::Vector3d right = Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(spread).eigenvectors().col(2);
  const Eigen::Vector3d up = normal.cross(right).normalized();
  const auto seen = [&](const Eigen::Vector3d& p) { return Eigen::Vector2d(right.dot(p - middle), up.dot(p - middle)); };
  Eigen::Vector2d low = Eigen::Vector2d::Zero(), high = Eigen::Vector2d::Zero();
  double most = 1e-6;
  for (std::size_t i = 0; i < view.curve.points.size(); ++i) {
    low = low.cwiseMin(seen(view.curve.points[i].point_mm));
    high = high.cwiseMax(seen(view.curve.points[i].point_mm));
    most = std::max(most, std::abs(view.off_u_mm[i]));
  }
  constexpr double kShareOfSize = 0.08;
  const double reach = kShareOfSize * (high - low).maxCoeff();
  const double factor = std::pow(10.0, std::floor(std::log10(reach / most)));
  low.array() -= reach;
  high.array() += reach;
  detail::PlotOptions options;
  options.equal_scale = true;
  options.width_px = 1040.0;
  detail::Plot plot("The rim from the head", "deviations from the nominal as hairs, enlarged",
                    detail::make_axis(low.x(), high.x(), 10, false), detail::make_axis(low.y(), high.y(), 6, false), "mm", "mm",
                    options);
  for (std::size_t i = 0; i < view.curve.points.size(); ++i) {
    const base::EdgePoint& point = view.curve.points[i];
    const Eigen::Vector2d from = seen(point.point_mm);
    const Eigen::Vector2d to = seen(point.point_mm + factor * view.off_u_mm[i] * point.normal.cross(point.tangent));
    const std::array<double, 2> x = {from.x(), to.x()};
    const std::array<double, 2> y = {from.y(), to.y()};
    plot.curve(x, y, "curve c1");
    plot.point(from.x(), from.y(), "dot", "",
               fmt::format("{} mm along the arc: u {} mm", detail::fixed(point.s_mm, 0), detail::fixed(view.off_u_mm[i], 3)),
               1.5);
  }
  plot.legend("curve c1", fmt::format("deviation, {} times its size", detail::fixed(factor, 0)));
  return plot.str();
}

/// The correction of the nominal along the path, with two sigmas.
std::string correction_plot(const base::ToolPath& path) {
  std::vector<double> s, u, v, low, high;
  double reach = 1e-3;
  for (const base::ToolPathPoint& point : path.points) {
    s.push_back(point.s_mm);
    u.push_back(point.correction_u_mm);
    v.push_back(point.correction_v_mm);
    low.push_back(point.correction_u_mm - 2.0 * point.sigma_u_mm);
    high.push_back(point.correction_u_mm + 2.0 * point.sigma_u_mm);
    reach = std::max({reach, std::abs(low.back()), std::abs(high.back()), std::abs(v.back())});
  }
  detail::PlotOptions options;
  options.width_px = 1040.0;
  detail::Plot plot("Correction of the path", "what the measured rim adds to the nominal path",
                    detail::make_axis(0.0, s.back(), 10, false), detail::make_axis(-reach, reach), "way along the path [mm]",
                    "correction [mm]", options);
  plot.band(s, low, high, "band");
  plot.curve(s, u, "curve c1");
  plot.curve(s, v, "curve c2");
  plot.legend("curve c1", "u, across the rim into the opening");
  plot.legend("curve c2", "v, along the normal");
  plot.legend("band", "two sigmas of u");
  return plot.str();
}

std::string path_section(const base::ToolPath& path) {
  double most_u = 0.0, sigma_u = 0.0, sigma_torch = 0.0, nominal_mm = 0.0;
  for (std::size_t i = 0; i < path.points.size(); ++i) {
    const base::ToolPathPoint& point = path.points[i];
    most_u = std::max(most_u, std::abs(point.correction_u_mm));
    sigma_u = std::max(sigma_u, point.sigma_u_mm);
    sigma_torch = std::max(sigma_torch, point.sigma_torch_rad.maxCoeff());
    if (i > 0 && point.source != base::PathSource::kMeasured) nominal_mm += point.s_mm - path.points[i - 1].s_mm;
  }
  constexpr double kDegrees = 57.29577951308232;
  return detail::definition_list(
             {{"Length", fmt::format("{} mm, {} points, {}", detail::fixed(path.length_mm, 1), path.points.size(),
                                     path.closed ? "closed" : "open")},
              {"Time on the way", fmt::format("{} s", detail::fixed(path.duration_s, 1))},
              {"Torch", fmt::format("bevel {} degrees, lead {} degrees, {} mm from the workpiece, {} mm into the opening",
                                    detail::fixed(kDegrees * path.bevel_rad, 1), detail::fixed(kDegrees * path.lead_rad, 1),
                                    detail::fixed(path.standoff_mm, 2), detail::fixed(path.offset_mm, 2))},
              {"Largest correction across the rim", fmt::format("{} mm", detail::fixed(most_u, 3))},
              {"Largest sigma across the rim",
               fmt::format("{} mm, {}", detail::significant(sigma_u, 2), detail::expanded(sigma_u, "mm"))},
              {"Largest sigma of the torch's direction",
               fmt::format("{} degrees, {}", detail::significant(kDegrees * sigma_torch, 2),
                           detail::expanded(kDegrees * sigma_torch, "degrees"))},
              {"Not measured",
               nominal_mm > 0.0 ? fmt::format("{} mm follow the nominal", detail::fixed(nominal_mm, 1)) : "nothing"},
              {"Files", "path.json, path.csv, path.dxf, path.ngc"}}) +
         detail::figure(
             correction_plot(path),
             "What the measured rim adds to the nominal where the part lies. Where the rim was not seen the correction "
             "fades out and sigma grows.",
             true);
}

std::string part_section(const EdgePart& part) {
  constexpr double kDegrees = 57.29577951308232;
  const Eigen::Vector3d& at = part.machine_from_part.translation_mm;
  const Eigen::Vector3d turn = kDegrees * base::rotation_log(part.machine_from_part.rotation);
  detail::HtmlTable table(fmt::format("The part's frame in the machine, held by: {}.", part.source),
                          {{"Coordinate", "", "", false}, {"Value", ""}, {"Sigma", ""}, {"Unit", "", "", false}});
  const std::array<const char*, 3> axes = {"x", "y", "z"};
  for (Eigen::Index i = 0; i < 3; ++i) {
    const double sigma = std::sqrt(std::max(0.0, part.cov(3 + i, 3 + i)));
    table.add_row({text_cell(fmt::format("origin {}", axes[static_cast<std::size_t>(i)])),
                   number_cell(detail::fixed(at(i), 3), at(i)), number_cell(detail::significant(sigma, 2), sigma),
                   text_cell("mm")});
  }
  for (Eigen::Index i = 0; i < 3; ++i) {
    const double sigma = kDegrees * std::sqrt(std::max(0.0, part.cov(i, i)));
    table.add_row({text_cell(fmt::format("turn about {}", axes[static_cast<std::size_t>(i)])),
                   number_cell(detail::fixed(turn(i), 4), turn(i)), number_cell(detail::significant(sigma, 2), sigma),
                   text_cell("degrees")});
  }
  std::string html = table.html();
  if (part.sigma0) {
    html += detail::paragraph(
        fmt::format("Residuals of what holds it over their sigmas (sigma0): {}.", detail::fixed(*part.sigma0, 2)));
  }
  return html;
}

/// The edge pixels of an image with the curve over them.
std::string overlay(const EdgeImage& image) {
  constexpr double kMargin = 15.0;
  Eigen::Vector2d low = Eigen::Vector2d::Constant(std::numeric_limits<double>::infinity());
  Eigen::Vector2d high = -low;
  for (const Eigen::Vector2d& at : image.curve_px) {
    low = low.cwiseMin(at);
    high = high.cwiseMax(at);
  }
  if (!low.allFinite() || !high.allFinite()) return "";
  low.array() -= kMargin;
  high.array() += kMargin;
  detail::PlotOptions options;
  options.equal_scale = true;
  options.y_down = true;
  detail::Plot plot(fmt::format("{} image", image.name), "edge pixels by class, and the curve",
                    detail::make_axis(low.x(), high.x(), 6, false), detail::make_axis(low.y(), high.y(), 6, false), "x [px]",
                    "y [px]", options);
  for (const base::EdgePixel& pixel : image.pixels) {
    if ((pixel.at_px.array() < low.array()).any() || (pixel.at_px.array() > high.array()).any()) continue;
    const char* colour = pixel.kind == base::EdgeClass::kMaterial ? "#2a9d4a"
                         : pixel.kind == base::EdgeClass::kShadow ? "#5a78d0"
                                                                  : "#d08a2a";
    plot.point(pixel.at_px.x(), pixel.at_px.y(), "", colour, "", 1.2);
  }
  for (const Eigen::Vector2d& at : image.curve_px) plot.point(at.x(), at.y(), "", "#c0202a", "", 1.6);
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
    const std::string from =
        view.off_from_placed ? "the nominal where the part lies" : "the nominal as it was fitted to the rim";
    page.section(
        "hairs", "Deviation from the nominal",
        detail::figure(plan_view(view),
                       fmt::format("The rim as the head sees it; hairs lead from {} outwards or inwards.", from), true) +
            detail::figure(
                hair_diagram(view),
                fmt::format("Each hair leads from {} to a measured point, across the rim in the surface; positive u is to "
                            "the left of the way as seen from the head. The band is two sigmas wide to either side.",
                            from),
                true));
  }
  if (view.path) page.section("path", "The torch's path", path_section(*view.path));
  if (view.part) page.section("part", "Where the part lies", part_section(*view.part));
  page.section(
      "sigmas", "Precision along the arc",
      detail::figures({detail::figure(sigma_plot(view),
                                      fmt::format("All parts together. Roughness of the rim beyond the sigmas of its points: "
                                                  "factor {}, contained in them.",
                                                  detail::fixed(view.roughness_factor, 2))),
                       detail::figure(camera_plot(view),
                                      "A chamfer or burr, or another edge taken for this one, shows as a difference.")}));
  std::vector<std::string> images;
  for (const EdgeImage& image : view.images) {
    const std::string drawn = overlay(image);
    if (!drawn.empty()) images.push_back(detail::figure(drawn, image.name + "."));
  }
  page.section("images", "Edge pixels",
               detail::paragraph("Material edges are green, shadows blue, paint orange; the curve's points are red.") +
                   detail::figures(images));
  page.section("fates", "What was left out", tables(view));
  return page.html();
}

}  // namespace crosstie::report
