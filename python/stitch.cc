// crosstie.stitch()

#include "registration/stitch.h"

#include <filesystem>
#include <optional>

#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>
#include <nlohmann/json.hpp>

#include "app/head_files.h"
#include "base/commissioning_reader.h"
#include "base/stitching_document.h"
#include "python/arrays.h"
#include "python/call.h"
#include "python/module.h"
#include "python/values.h"
#include "registration/merge.h"

namespace crosstie::python {
namespace {

namespace fs = std::filesystem;
using base::Progress;
using base::Result;

/// A station before its surface is made.
struct Given {
  registration::StationScan scan;
  std::optional<base::Cloud> cloud;
};

Given station_from(const py::dict& dict) {
  const auto given = [&](const char* key) { return dict.contains(key) && !dict[key].is_none(); };
  Given station;
  station.scan.name = dict["name"].cast<std::string>();
  if (given("axis_mm")) station.scan.axis_mm = dict["axis_mm"].cast<double>();
  if (given("start")) station.scan.start = pose_from(dict["start"]);
  if (given("cloud")) station.cloud = cloud_from(dict["cloud"].cast<py::dict>());
  if (given("markers")) {
    for (const PointRow& row : point_rows_from(dict["markers"])) {
      registration::Sighting& seen = station.scan.markers.emplace_back();
      seen.id = row.id;
      seen.p_in_rig_mm = Eigen::Map<const Eigen::Vector3d>(row.xyz_mm);
      seen.cov_mm2 = Eigen::Map<const Eigen::Matrix3d>(&row.cov_mm2[0][0]);
    }
  }
  return station;
}

registration::MarkerReference reference_from(const py::object& array, bool own_frame) {
  const std::vector<PointRow> rows = point_rows_from(array);
  registration::MarkerReference reference;
  reference.own_frame = own_frame;
  const auto size = 3 * static_cast<Eigen::Index>(rows.size());
  reference.points.xyz_mm.resize(size);
  reference.points.cov_mm2 = Eigen::MatrixXd::Zero(size, size);
  Eigen::Index at = 0;
  for (const PointRow& row : rows) {
    reference.points.ids.push_back(row.id);
    reference.points.xyz_mm.segment<3>(at) = Eigen::Map<const Eigen::Vector3d>(row.xyz_mm);
    reference.points.cov_mm2.block<3, 3>(at, at) = Eigen::Map<const Eigen::Matrix3d>(&row.cov_mm2[0][0]);
    at += 3;
  }
  return reference;
}

Result<std::optional<registration::CommissionedHead>> read_commissioned(const std::optional<fs::path>& commission,
                                                                        const std::optional<fs::path>& calibration) {
  using Found = std::optional<registration::CommissionedHead>;
  if (commission) {
    const auto commissioning = base::read_commissioning(*commission);
    if (!commissioning) return tl::unexpected(commissioning.error());
    auto head = registration::CommissionedHead::of(*commissioning);
    if (!head) return base::fail(std::move(head));
    return Found(*std::move(head));
  }
  if (!calibration) return Found();
  const auto head = app::read_head(calibration->string(), 0, 0);
  if (!head) return tl::unexpected(head.error());
  return Found(registration::CommissionedHead::calibrated(head->head));
}

struct Stitched {
  base::Stitching stitching;
  base::Cloud cloud;
};

Result<Stitched> compute(std::vector<Given>& stations, registration::StitchInput& input,
                         const std::optional<fs::path>& commission, const std::optional<fs::path>& calibration,
                         const registration::StitchOptions& options, const registration::SurfaceOptions& surface,
                         const registration::MergeOptions& merge, const Progress& progress) {
  auto commissioned = read_commissioned(commission, calibration);
  if (!commissioned) return base::fail(std::move(commissioned));
  input.commissioned = *std::move(commissioned);
  for (Given& station : stations) {
    if (progress.cancelled()) return base::cancelled("stitch");
    if (station.cloud) {
      auto made = registration::Surface::make(*station.cloud, surface);
      if (!made) return base::fail(made.error().code, station.scan.name + ": " + made.error().message);
      station.scan.surface = *std::move(made);
    }
    input.stations.push_back(std::move(station.scan));
  }
  auto stitching = registration::stitch(input, options, progress);
  if (!stitching) return base::fail(std::move(stitching));
  Stitched stitched{*std::move(stitching), {}};
  const auto head = input.commissioned ? std::optional(input.commissioned->head) : std::nullopt;
  registration::CloudMerger merger(stitched.stitching, merge, head);
  for (std::size_t k = 0; k < stations.size(); ++k) {
    if (progress.cancelled()) return base::cancelled("stitch");
    if (!stations[k].cloud) continue;
    if (auto added = merger.add(static_cast<int>(k), *stations[k].cloud); !added) return base::fail(std::move(added));
  }
  stitched.cloud = merger.finish();
  return stitched;
}

py::dict stitch(const py::sequence& given, const std::optional<fs::path>& commission,
                const std::optional<fs::path>& calibration, const py::object& reference, bool reference_in_part, double cell_mm,
                std::optional<double> sigma_mm, std::optional<double> reach_mm) {
  std::vector<Given> stations;
  for (const py::object station : given) stations.push_back(station_from(py::dict(station)));
  registration::StitchInput input;
  if (!reference.is_none()) input.reference = reference_from(reference, reference_in_part);
  registration::StitchOptions options;
  options.start_reach_mm = reach_mm;
  registration::SurfaceOptions surface;
  surface.sigma_mm = sigma_mm;
  registration::MergeOptions merge;
  merge.cell_mm = cell_mm;
  merge.sigma_mm = sigma_mm;
  Stitched stitched = call([&](const Progress& progress) {
    return compute(stations, input, commission, calibration, options, surface, merge, progress);
  });
  py::dict result = python_of(base::stitching_json(stitched.stitching));
  result["frame"] = stitched.stitching.frame;
  result["cloud"] = cloud_dict(std::move(stitched.cloud));
  result["warnings"] = warnings_list(stitched.stitching.warnings);
  result["covariance"] = matrix_array(std::move(stitched.stitching.covariance));
  result["covariance_labels"] = py::cast(stitched.stitching.labels);
  return result;
}

}  // namespace

void add_stitch(py::module_& module) {
  module.def(
      "stitch", &stitch, py::arg("stations"), py::kw_only(), py::arg("commission") = py::none(),
      py::arg("calibration") = py::none(), py::arg("reference") = py::none(), py::arg("reference_in_part") = false,
      py::arg("cell_mm") = registration::MergeOptions{}.cell_mm, py::arg("sigma_mm") = py::none(),
      py::arg("reach_mm") = py::none(),
      "Scans of several stations -> one frame and one cloud, by markers, axis and surfaces in one adjustment.\n\n"
      "stations           [{'name': str, 'cloud': cloud dict in the rig's frame, 'markers': array of POINT in the rig's "
      "frame,\n"
      "                   'axis_mm': reading of the axis, 'start': (4, 4) machine_from_rig}]; all but name are optional\n"
      "commission         folder of its result: ties the stations to the machine; or\n"
      "calibration        folder of a result of calibrate: the head's covariance alone; neither: the head is taken as exact\n"
      "reference          array of POINT: coordinates of the markers; reference_in_part: in a frame of their own\n"
      "cell_mm            edge of the cells in which points of the merged cloud become one\n"
      "sigma_mm           of a point, for clouds without the field sigma_mm\n"
      "reach_mm           how far partners are sought in the first round\n\n"
      "Returns the keys of a result of `crosstie stitch` (docs/formats.md): frame, stations [{name, machine_from_rig (4, 4), "
      "cov\n"
      "(6, 6) [rad, mm], directions, ...}], overlap, markers, rejected; and cloud (points in `frame`, normals, cov_mm2 (N, 3, "
      "3)\n"
      "with all that is known of it), covariance (P, P) with covariance_labels, warnings.\n\n"
      "Raises Error with code NO_UNIQUE_SOLUTION where something leaves a station free: which one, in which directions.");
}

}  // namespace crosstie::python
