// the edge of a hole as files and as a page

#include "app/edge_result.h"

#include <algorithm>
#include <limits>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <nlohmann/json.hpp>

#include "base/table.h"
#include "base/text.h"

namespace crosstie::app {
namespace {

using base::Result;
using nlohmann::ordered_json;

ordered_json form_json(const edge::FormComponent& component) {
  return {{"sigma_mm", component.sigma_mm()}, {"length_mm", component.length_mm()}};
}

ordered_json nominal_json(const edge::NominalFit& fit) {
  ordered_json sigmas = ordered_json::array();
  ordered_json sizes = ordered_json::object();
  const auto names = edge::size_names(fit.nominal.kind);
  for (std::size_t i = 0; i < fit.nominal.size_mm.size(); ++i) {
    sizes[names[i] + "_mm"] = fit.nominal.size_mm[i];
    sigmas.push_back(fit.size_sigma_mm(i));
  }
  ordered_json left_out = ordered_json::array();
  for (const edge::ForeignStretch& stretch : fit.left_out) {
    left_out.push_back({{"from_mm", stretch.from_mm},
                        {"length_mm", stretch.length_mm},
                        {"points", stretch.points.size()},
                        {"most_u_mm", stretch.most_u_mm}});
  }
  const Eigen::Vector3d& at = fit.frame_from_hole.translation_mm;
  const Eigen::Vector3d normal = fit.frame_from_hole.rotation * Eigen::Vector3d::UnitZ();
  return {{"type", edge::name_of(fit.nominal.kind)},
          {"params", sizes},
          {"sigmas", sigmas},
          {"centre_mm", {at.x(), at.y(), at.z()}},
          {"normal", {normal.x(), normal.y(), normal.z()}},
          {"rms_u_mm", fit.rms_u_mm},
          {"rms_v_mm", fit.rms_v_mm},
          {"sigma0", fit.sigma0},
          {"redundancy", fit.redundancy},
          {"form", {{"across", form_json(fit.form.across)}, {"along_normal", form_json(fit.form.along_normal)}}},
          {"left_out", left_out}};
}

/// Who saw a point.
std::string source_of(const edge::HoleEdge& hole, std::size_t i) {
  if (hole.curve.stations.size() > 1) {
    std::vector<std::string> names;
    for (const int station : hole.curve.points[i].stations)
      names.push_back(hole.curve.stations[static_cast<std::size_t>(station)]);
    return fmt::format("{}", fmt::join(names, "+"));
  }
  const auto& pixels = hole.points[i].pixels;
  return pixels[0] > 0 && pixels[1] > 0 ? "both" : pixels[0] > 0 ? "left" : "right";
}

bool is_near(const std::vector<Eigen::Vector2d>& curve_px, const Eigen::Vector2d& at) {
  constexpr double kNear_px = 15.0;
  return std::any_of(curve_px.begin(), curve_px.end(), [&](const Eigen::Vector2d& p) { return (p - at).norm() < kNear_px; });
}

}  // namespace

ordered_json edge_json(const edge::HoleEdge& hole, const std::optional<edge::NominalFit>& fit) {
  ordered_json gaps = ordered_json::array();
  for (const base::EdgeGap& gap : hole.curve.gaps)
    gaps.push_back({{"from_mm", gap.from_mm}, {"length_mm", gap.length_mm}, {"reason", gap.reason}});
  const auto& counts = hole.counts;
  return {{"length_mm", hole.curve.length_mm},
          {"closed", hole.curve.closed},
          {"points", hole.curve.points.size()},
          {"gaps", gaps},
          {"nominal", fit ? nominal_json(*fit) : ordered_json()},
          {"rms_mm", fit ? ordered_json(fit->rms_mm) : ordered_json()},
          {"roughness_factor", hole.roughness_factor},
          {"edge_pixels",
           {{"used", counts.used},
            {"shadow", counts.shadow},
            {"elsewhere", counts.elsewhere},
            {"no_surface", counts.no_surface},
            {"off_face", counts.off_face},
            {"inwards", counts.inwards},
            {"masked", counts.masked},
            {"stray", counts.stray},
            {"inner", counts.inner}}}};
}

Result<> write_edge(const std::filesystem::path& path, const edge::HoleEdge& hole) {
  base::Table table;
  table.path = path;
  table.columns = {"s_mm", "x_mm", "y_mm", "z_mm", "sigma_u_mm",       "sigma_v_mm",       "nx",    "ny",
                   "nz",   "tx",   "ty",   "tz",   "sigma_tilt_u_rad", "sigma_tilt_t_rad", "source"};
  for (std::size_t i = 0; i < hole.curve.points.size(); ++i) {
    const base::EdgePoint& point = hole.curve.points[i];
    std::vector<std::string> row;
    for (const double value : {point.s_mm, point.point_mm.x(), point.point_mm.y(), point.point_mm.z(), point.sigma_u_mm,
                               point.sigma_v_mm, point.normal.x(), point.normal.y(), point.normal.z(), point.tangent.x(),
                               point.tangent.y(), point.tangent.z(), point.sigma_tilt_rad.x(), point.sigma_tilt_rad.y()}) {
      row.push_back(base::format_double(value));
    }
    row.push_back(source_of(hole, i));
    table.rows.push_back(std::move(row));
  }
  return base::write_table(path, table);
}

report::EdgeView edge_view(const edge::HoleEdge& hole, const std::optional<edge::NominalFit>& fit) {
  report::EdgeView view;
  view.curve = hole.curve;
  view.roughness_factor = hole.roughness_factor;
  if (fit) {
    view.rms_u_mm = fit->rms_u_mm;
    view.rms_v_mm = fit->rms_v_mm;
    view.nominal = std::string(edge::name_of(fit->nominal.kind));
    const auto names = edge::size_names(fit->nominal.kind);
    for (std::size_t i = 0; i < fit->nominal.size_mm.size(); ++i)
      view.nominal += fmt::format(", {} {:.3f} mm, sigma {:.3f} mm", names[i], fit->nominal.size_mm[i], fit->size_sigma_mm(i));
    if (fit->deviations.points.size() == hole.curve.points.size()) {
      for (Eigen::Index i = 0; i < fit->deviations.uv_mm.cols(); ++i) {
        view.off_u_mm.push_back(fit->deviations.uv_mm(0, i));
        view.off_v_mm.push_back(fit->deviations.uv_mm(1, i));
      }
    }
  }
  for (std::size_t camera = 0; camera < 2; ++camera) {
    for (const edge::RimPoint& point : hole.points) {
      view.camera_off_mm[camera].push_back(point.pixels[camera] > 0 ? point.off_mm[camera]
                                                                    : std::numeric_limits<double>::quiet_NaN());
    }
  }
  const auto& counts = hole.counts;
  view.fates = {{"used", counts.used},
                {"not where the rim is expected", counts.elsewhere},
                {"a shadow's, not a material edge", counts.shadow},
                {"without depths on the material side", counts.no_surface},
                {"on another surface than the face: ledge, far rim, cut face", counts.off_face},
                {"with the hole on the wrong side: outer contours", counts.inwards},
                {"on a marker or magnet", counts.masked},
                {"contradicting neighbours or the other camera", counts.stray},
                {"far side of a chamfer", counts.inner}};
  return view;
}

void add_edge_images(const edge::StationView& station, const base::EdgeCurve& curve, report::EdgeView& view) {
  const base::Head& head = *station.head;
  const base::Pose rig_from_frame = station.frame_from_rig.inverse();
  for (std::size_t camera = 0; camera < 2; ++camera) {
    const base::Camera& lens = camera == 0 ? head.left : head.right;
    report::EdgeImage image;
    image.name = fmt::format("{}{}{}", curve.stations.size() > 1 ? station.name : "", curve.stations.size() > 1 ? ", " : "",
                             camera == 0 ? head.left_name : head.right_name);
    for (const base::EdgePoint& point : curve.points) {
      const Eigen::Vector3d p_in_rig = rig_from_frame * point.point_mm;
      const auto at = lens.project(camera == 0 ? p_in_rig : head.right_from_left * p_in_rig);
      const bool inside =
          at && at->x() >= 0.0 && at->y() >= 0.0 && at->x() <= lens.width_px() - 1.0 && at->y() <= lens.height_px() - 1.0;
      if (inside) image.curve_px.push_back(*at);
    }
    for (const base::EdgePixel& pixel : station.edges[camera]->pixels) {
      if (is_near(image.curve_px, pixel.at_px)) image.pixels.push_back(pixel);
    }
    view.images.push_back(std::move(image));
  }
}

std::string edge_summary(const edge::HoleEdge& hole, const std::optional<edge::NominalFit>& fit) {
  std::string said = fmt::format("{} points over {:.1f} mm, {}, {} gaps", hole.curve.points.size(), hole.curve.length_mm,
                                 hole.curve.closed ? "closed" : "open", hole.curve.gaps.size());
  if (!fit) return said;
  said += fmt::format("; {}", edge::name_of(fit->nominal.kind));
  for (std::size_t i = 0; i < fit->nominal.size_mm.size(); ++i)
    said += fmt::format(" {:.3f} mm (sigma {:.3f})", fit->nominal.size_mm[i], fit->size_sigma_mm(i));
  said += fmt::format(", rms {:.3f} mm", fit->rms_mm);
  double left_out_mm = 0.0;
  for (const edge::ForeignStretch& stretch : fit->left_out) left_out_mm += stretch.length_mm;
  return fit->left_out.empty() ? said : said + fmt::format(", {:.1f} mm of the rim left out", left_out_mm);
}

}  // namespace crosstie::app
