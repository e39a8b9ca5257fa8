// crosstie.adjust()

#include "bundle/adjust.h"

#include <map>
#include <set>
#include <tuple>
#include <variant>

#include <fmt/core.h>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>
#include <nlohmann/json.hpp>

#include "base/point_list.h"
#include "base/result_document.h"
#include "python/arrays.h"
#include "python/call.h"
#include "python/module.h"
#include "python/values.h"

namespace crosstie::python {
namespace {

using Images = std::map<std::string, std::pair<std::string, py::object>>;
using Cameras = std::map<std::string, base::Camera>;
using Bar = std::tuple<int, int, double, double>;
using Bars = std::variant<std::vector<Bar>, std::filesystem::path>;
using Rigs = std::map<std::string, std::pair<std::vector<std::string>, std::vector<std::vector<std::string>>>>;
using Held = std::map<std::string, std::vector<std::string>>;

struct AdjustedRow {
  std::int32_t id;
  bool uncoded;
  std::int32_t rays;
  double xyz_mm[3];
  double cov_mm2[3][3];
  double angle_rad;
  double rms_px;
  double max_w;
};

struct ResidualRow {
  std::int32_t image;
  std::int32_t point;
  double measured_px[2];
  double residual_px[2];
  double sigma_px[2];
  double w;
};

std::vector<base::ScaleBar> bars_of(const Bars& bars) {
  if (const auto* path = std::get_if<std::filesystem::path>(&bars)) return value_of(base::read_scale_bars(*path));
  std::vector<base::ScaleBar> list;
  for (const auto& [id_a, id_b, length_mm, sigma_mm] : std::get<std::vector<Bar>>(bars)) {
    base::ScaleBar& bar = list.emplace_back();
    bar.id_a = id_a;
    bar.id_b = id_b;
    bar.length_mm = length_mm;
    bar.sigma_mm = sigma_mm;
    if (sigma_mm == 0.0) bar.role = base::ScaleBarRole::kDefines;
  }
  return list;
}

base::Network network_of(const Images& images, const Cameras& cameras, const Held& held, const std::set<std::string>& fixed) {
  base::Network network;
  for (const auto& [name, camera] : cameras) {
    const auto stays = held.find(name);
    network.cameras.push_back(
        {name, camera, !fixed.contains(name), stays == held.end() ? std::vector<std::string>{} : stays->second});
  }
  for (const std::string& name : fixed) {
    if (!cameras.contains(name)) throw py::value_error(fmt::format("fixed names '{}', which is none of the cameras", name));
  }
  for (const auto& [name, unused] : held) {
    if (!cameras.contains(name)) throw py::value_error(fmt::format("held names '{}', which is none of the cameras", name));
  }
  for (const auto& [name, seen] : images) {
    base::ImageObservations& image = network.images.emplace_back();
    image.image = name;
    image.camera = seen.first;
    image.observations = observations_from(seen.second);
    if (const auto camera = cameras.find(seen.first); camera != cameras.end()) {
      image.width_px = camera->second.width_px();
      image.height_px = camera->second.height_px();
    }
  }
  return network;
}

py::array rows_of(const std::vector<base::AdjustedPoint>& points) {
  std::vector<AdjustedRow> rows;
  for (const base::AdjustedPoint& point : points) {
    AdjustedRow& row = rows.emplace_back();
    row.id = point.id;
    row.uncoded = point.kind == "uncoded";
    row.rays = point.rays;
    for (int i = 0; i < 3; ++i) {
      row.xyz_mm[i] = point.xyz_mm(i);
      for (int j = 0; j < 3; ++j) row.cov_mm2[i][j] = point.cov_mm2(i, j);
    }
    row.angle_rad = point.angle_rad;
    row.rms_px = point.rms_px;
    row.max_w = point.max_w;
  }
  const auto count = static_cast<py::ssize_t>(rows.size());
  return array_of<AdjustedRow>(std::move(rows), {count});
}

py::array rows_of(const std::vector<base::AdjustedObservation>& residuals) {
  std::vector<ResidualRow> rows;
  for (const base::AdjustedObservation& one : residuals) {
    rows.push_back({one.image,
                    one.point,
                    {one.measured_px.x(), one.measured_px.y()},
                    {one.residual_px.x(), one.residual_px.y()},
                    {one.sigma_px.x(), one.sigma_px.y()},
                    one.w});
  }
  const auto count = static_cast<py::ssize_t>(rows.size());
  return array_of<ResidualRow>(std::move(rows), {count});
}

py::dict result_of(base::AdjustedNetwork&& adjusted) {
  py::dict result = python_of(base::network_json(adjusted));
  result["points"] = rows_of(adjusted.points);
  result["residuals"] = rows_of(adjusted.residuals);
  py::dict lenses;
  for (const base::AdjustedCamera& camera : adjusted.cameras) lenses[py::str(camera.name)] = camera.camera;
  result["lenses"] = lenses;
  result["warnings"] = warnings_list(adjusted.warnings);
  result["covariance"] =
      adjusted.covariance.size() == 0 ? py::object(py::none()) : matrix_array(std::move(adjusted.covariance));
  result["covariance_labels"] = py::cast(adjusted.labels);
  return result;
}

py::dict adjust(const Images& images, const Cameras& cameras, const std::optional<Bars>& scale_bars, bool scale_is_free,
                const py::object& control, const py::object& datum, const Rigs& rigs, const Held& held,
                const std::set<std::string>& fixed, std::optional<double> dot_diameter_mm, bool uncoded, bool reject_outliers,
                double significance, bool full_covariance) {
  base::Network network = network_of(images, cameras, held, fixed);
  if (scale_bars) network.scale_bars = bars_of(*scale_bars);
  network.scale_is_free = scale_is_free;
  network.dot_diameter_mm = dot_diameter_mm;
  for (const auto& [name, rig] : rigs) network.rigs.push_back({name, rig.first, rig.second});
  if (!control.is_none()) {
    for (const PointRow& row : point_rows_from(control)) {
      base::ControlGroup& group = network.control.emplace_back();
      group.ids = {row.id};
      group.xyz_mm = Eigen::Map<const Eigen::Vector3d>(row.xyz_mm);
      group.cov_mm2 = Eigen::Map<const Eigen::Matrix3d>(&row.cov_mm2[0][0]);
    }
  }
  if (!datum.is_none()) {
    for (const PointRow& row : point_rows_from(datum)) {
      base::DatumPoint& point = network.datum.emplace_back();
      point.id = row.id;
      point.xyz_mm = Eigen::Map<const Eigen::Vector3d>(row.xyz_mm);
    }
  }
  bundle::AdjustOptions options;
  options.uncoded = uncoded;
  options.reject_outliers = reject_outliers;
  options.significance = significance;
  options.full_covariance = full_covariance;
  return result_of(call([&](const base::Progress& progress) { return bundle::adjust(network, options, progress); }));
}

}  // namespace

void add_adjust(py::module_& module) {
  PYBIND11_NUMPY_DTYPE(AdjustedRow, id, uncoded, rays, xyz_mm, cov_mm2, angle_rad, rms_px, max_w);
  PYBIND11_NUMPY_DTYPE(ResidualRow, image, point, measured_px, residual_px, sigma_px, w);
  module.def(
      "adjust", &adjust, py::arg("images"), py::arg("cameras"), py::arg("scale_bars") = py::none(), py::kw_only(),
      py::arg("scale_is_free") = false, py::arg("control") = py::none(), py::arg("datum") = py::none(),
      py::arg("rigs") = Rigs{}, py::arg("held") = Held{}, py::arg("fixed") = std::set<std::string>{},
      py::arg("dot_diameter_mm") = py::none(), py::arg("uncoded") = true, py::arg("reject_outliers") = true,
      py::arg("significance") = 0.001, py::arg("full_covariance") = true,
      "Bundle adjustment of a network with self-calibration; no start values of poses and points are needed.\n\n"
      "images           {image: (camera, observations of detect())}\n"
      "cameras          {camera: Camera}: start values; a covariance is what is known of them beforehand\n"
      "scale_bars       [(id_a, id_b, length_mm, sigma_mm)], sigma 0: defines the scale; or a file of scale bars\n"
      "scale_is_free    no scale is known and none is wanted\n"
      "control          array of POINT: coordinates known beforehand, as observations in the frame of the result\n"
      "datum            array of POINT (covariances do not count): the result's frame is fitted to them\n"
      "rigs             {rig: (cameras, [images of one moment, ...])}: cameras on one mount\n"
      "held             {camera: [parameter, ...]} that stay at their start values\n"
      "fixed            names of cameras that are taken as they are\n"
      "dot_diameter_mm  of the markers: a scale that is far from it is refused\n"
      "uncoded          match and adjust dots without a code, too\n\n"
      "Returns the keys of a result of `crosstie adjust` (docs/formats.md), with points as an array (id, uncoded, rays, "
      "xyz_mm\n"
      "(3,), cov_mm2 (3, 3), angle_rad, rms_px, max_w), images [{name, camera, network_from_camera (4, 4), cov (6, 6) [rad, "
      "mm],\n"
      "...}], residuals (image and point are indices), lenses {camera: Camera with covariance}, and covariance (P, P) with\n"
      "covariance_labels. Frame: network; coordinates in mm; covariances times sigma0^2.\n\n"
      "Raises Error with code NO_UNIQUE_SOLUTION where the observations do not determine the network: what is weak is named.");
}

}  // namespace crosstie::python
