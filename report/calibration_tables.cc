#include "report/calibration_tables.h"

#include <cmath>
#include <initializer_list>
#include <map>

#include "base/table.h"
#include "base/text.h"

namespace crosstie::report {
namespace {

using base::Calibration;
using base::format_double;
using base::Result;
using base::Table;

void append(std::vector<std::string>& row, const Eigen::Ref<const Eigen::VectorXd>& values) {
  for (Eigen::Index i = 0; i < values.size(); ++i) row.push_back(format_double(values(i)));
}

Table cameras_table(const Calibration& calibration) {
  Table table;
  table.columns = {"camera", "model", "width_px", "height_px", "parameter", "value", "sigma", "significance_p"};
  for (const base::CalibratedCamera& one : calibration.cameras) {
    const auto names = base::parameter_names(one.camera.model());
    for (std::size_t i = 0; i < names.size(); ++i) {
      const auto k = static_cast<Eigen::Index>(i);
      const double p = k < one.significance_p.size() ? one.significance_p(k) : std::nan("");
      table.rows.push_back(
          {one.name, std::string(base::lens_model_name(one.camera.model())), std::to_string(one.camera.width_px()),
           std::to_string(one.camera.height_px()), std::string(names[i]), format_double(one.camera.parameters()(k)),
           format_double(std::sqrt(std::max(0.0, one.camera.covariance()(k, k)))), std::isfinite(p) ? format_double(p) : ""});
    }
  }
  return table;
}

Table views_table(const Calibration& calibration) {
  Table table;
  table.columns = {"image",    "camera", "station", "corners", "rejected", "rms_px", "max_px", "distance_mm",
                   "tilt_rad", "qw",     "qx",      "qy",      "qz",       "x_mm",   "y_mm",   "z_mm"};
  for (const base::CalibratedView& view : calibration.views) {
    std::vector<std::string> row = {view.image, view.camera, calibration.stations[static_cast<std::size_t>(view.station)].name,
                                    std::to_string(view.corners), std::to_string(view.rejected)};
    append(row, Eigen::Vector4d(view.rms_px, view.max_px, view.distance_mm, view.tilt_rad));
    const Eigen::Quaterniond& q = view.board_from_camera.rotation;
    append(row, Eigen::Vector4d(q.w(), q.x(), q.y(), q.z()));
    append(row, view.board_from_camera.translation_mm);
    table.rows.push_back(std::move(row));
  }
  return table;
}

Table board_table(const base::CalibratedBoard& board) {
  Table table;
  table.columns = {"index",      "column",     "row",        "x_mm",  "y_mm",  "z_mm",
                   "sigma_x_mm", "sigma_y_mm", "sigma_z_mm", "dx_mm", "dy_mm", "dz_mm"};
  const Eigen::Matrix3Xd nominal = board.board.nominal_points();
  for (Eigen::Index i = 0; i < board.points.cols(); ++i) {
    const auto index = static_cast<int>(i);
    std::vector<std::string> row = {std::to_string(index), std::to_string(index % board.board.columns),
                                    std::to_string(index / board.board.columns)};
    append(row, board.points.col(i));
    append(row, board.sigma.col(i));
    append(row, board.points.col(i) - nominal.col(i));
    table.rows.push_back(std::move(row));
  }
  return table;
}

/// Why a corner took no part, by image and corner; -1 stands for the whole image.
std::map<std::pair<std::string, int>, std::string> reasons(const Calibration& calibration) {
  std::map<std::pair<std::string, int>, std::string> found;
  for (const base::RejectedCorner& one : calibration.rejected) found.emplace(std::pair{one.image, one.corner}, one.reason);
  return found;
}

Table corners_table(const Calibration& calibration, std::span<const base::BoardImage> images) {
  std::map<std::pair<std::string, int>, const base::CalibrationResidual*> used;
  for (const base::CalibrationResidual& one : calibration.residuals) {
    const base::CalibratedView& view = calibration.views[static_cast<std::size_t>(one.view)];
    used.emplace(std::pair{view.camera + "/" + view.image, one.corner}, &one);
  }
  const auto rejected = reasons(calibration);
  Table table;
  table.columns = {"image", "camera",        "corner",        "column",   "row", "x_px",
                   "y_px",  "residual_x_px", "residual_y_px", "sigma_px", "w",   "rejected_because"};
  for (const base::BoardImage& image : images) {
    for (const base::BoardCorner& corner : image.corners) {
      std::vector<std::string> row = {image.image, image.camera, std::to_string(corner.index),
                                      std::to_string(corner.index % calibration.board.board.columns),
                                      std::to_string(corner.index / calibration.board.board.columns)};
      append(row, corner.px);
      const auto found = used.find({image.camera + "/" + image.image, corner.index});
      if (found != used.end()) {
        append(row, found->second->residual_px);
        append(row, Eigen::Vector2d(found->second->sigma_px, found->second->w));
        row.emplace_back("");
      } else {
        row.insert(row.end(), 4, "");
        auto why = rejected.find({image.image, corner.index});
        if (why == rejected.end()) why = rejected.find({image.image, -1});
        row.push_back(why != rejected.end() ? why->second : "it took no part");
      }
      table.rows.push_back(std::move(row));
    }
  }
  return table;
}

/// Numbers that there are; the others stay empty.
void append_known(std::vector<std::string>& row, std::initializer_list<double> values) {
  for (const double value : values) row.push_back(std::isfinite(value) ? format_double(value) : "");
}

Table uncertainty_table(const Calibration& calibration, const base::CalibrationMaps& maps) {
  Table table;
  table.columns = {"camera", "x_px", "y_px", "sigma_px", "minor_px", "sigma_mm", "calibrated"};
  for (std::size_t c = 0; c < maps.cameras.size(); ++c) {
    const base::ProjectionSigmas& map = maps.cameras[c];
    for (int i = 0; i < map.grid.count(); ++i) {
      std::vector<std::string> row = {calibration.cameras[c].name};
      append(row, map.grid.middle_px(i));
      append_known(row, {map.sigma_px(i), map.minor_px(i), map.sigma_mm(i)});
      row.emplace_back(map.calibrated[static_cast<std::size_t>(i)] ? "1" : "0");
      table.rows.push_back(std::move(row));
    }
  }
  return table;
}

Table triangulation_table(const base::TriangulationSigmas& rig, const base::TriangulationSigmas& boards) {
  Table table;
  table.columns = {"x_px", "y_px", "rig_depth_mm", "rig_across_mm", "boards_depth_mm", "boards_across_mm", "calibrated"};
  for (int i = 0; i < rig.grid.count(); ++i) {
    std::vector<std::string> row;
    append(row, rig.grid.middle_px(i));
    append_known(row, {rig.sigma_depth_mm(i), rig.sigma_across_mm(i), boards.sigma_depth_mm(i), boards.sigma_across_mm(i)});
    row.emplace_back(rig.calibrated[static_cast<std::size_t>(i)] ? "1" : "0");
    table.rows.push_back(std::move(row));
  }
  return table;
}

}  // namespace

Result<> write_calibration_tables(const std::filesystem::path& folder, const Calibration& calibration,
                                  std::span<const base::BoardImage> images) {
  if (auto ok = base::write_table(folder / "cameras.csv", cameras_table(calibration)); !ok) return ok;
  if (auto ok = base::write_table(folder / "views.csv", views_table(calibration)); !ok) return ok;
  if (auto ok = base::write_table(folder / "board.csv", board_table(calibration.board)); !ok) return ok;
  return base::write_table(folder / "corners.csv", corners_table(calibration, images));
}

Result<> write_map_tables(const std::filesystem::path& folder, const Calibration& calibration,
                          const base::CalibrationMaps& maps) {
  if (auto ok = base::write_table(folder / "uncertainty.csv", uncertainty_table(calibration, maps)); !ok) return ok;
  if (!maps.in_rig || !maps.on_boards) return {};
  return base::write_table(folder / "triangulation.csv", triangulation_table(*maps.in_rig, *maps.on_boards));
}

}  // namespace crosstie::report
