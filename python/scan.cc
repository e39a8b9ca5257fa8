// crosstie.scan()

#include <array>
#include <filesystem>
#include <optional>

#include <fmt/core.h>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>
#include <nlohmann/json.hpp>

#include "app/head_files.h"
#include "app/scan_head.h"
#include "app/scan_view.h"
#include "app/steps_scan.h"
#include "base/parallel.h"
#include "base/pattern_sequence.h"
#include "base/result_document.h"
#include "python/arrays.h"
#include "python/call.h"
#include "python/module.h"
#include "python/values.h"
#include "scan/head_test.h"
#include "scan/markers.h"

namespace crosstie::python {
namespace {

using base::ErrorCode;
using base::Progress;
using base::Result;

/// The images of one camera, one for each pattern, where their arrays are.
class Stack {
 public:
  Stack(const py::sequence& images, double white_level) {
    for (const py::object image : images) images_.emplace_back(image, white_level);
  }
  [[nodiscard]] std::size_t size() const { return images_.size(); }
  [[nodiscard]] const base::ImageView& at(std::size_t pattern) const { return images_[pattern].view(); }

 private:
  std::vector<ArrayImage> images_;
};

Result<base::PhaseMap> decode(const Stack& stack, const base::PatternSequence& sequence, const scan::DecodeOptions& options,
                              const char* camera, const Progress& progress) {
  if (stack.size() != sequence.patterns.size()) {
    return base::fail(ErrorCode::kBadInput,
                      fmt::format("{}: {} images of {} patterns", camera, stack.size(), sequence.patterns.size()));
  }
  auto decoder = scan::Decoder::make(sequence, stack.at(0).width, stack.at(0).height, options);
  if (!decoder) return base::fail(std::move(decoder));
  for (std::size_t i = 0; i < stack.size(); ++i) {
    if (progress.cancelled()) return base::cancelled("scan");
    if (auto added = decoder->add(static_cast<int>(i), owned(stack.at(i))); !added)
      return base::fail(added.error().code, fmt::format("{} image {}: {}", camera, i, added.error().message));
  }
  auto map = decoder->finish(progress);
  if (!map) return base::fail(map.error().code, fmt::format("{}: {}", camera, map.error().message));
  return map;
}

struct Scanned {
  base::Head head;
  app::ScanParts parts;
};

/// What scan_step() of app/steps_scan.cc does between reading and writing.
Result<Scanned> compute(const std::array<Stack, 2>& stacks, const std::filesystem::path& manifest, app::ScanTask& task,
                        const scan::MarkerOptions* markers, std::array<base::ImageObservations, 2> seen,
                        const Progress& progress) {
  const auto sequence = base::read_pattern_manifest(manifest);
  if (!sequence) return tl::unexpected(sequence.error());
  if (stacks[0].size() == 0) return base::fail(ErrorCode::kBadInput, "left: no images");
  auto head = app::read_head(task.head, stacks[0].at(0).width, stacks[0].at(0).height);
  if (!head) return base::fail(std::move(head));
  Scanned scanned{std::move(head->head), {}};
  app::ScanParts& parts = scanned.parts;
  const Progress silent{{}, progress.stop};
  auto decoded = base::parallel_for(2, task.decode.threads, "phases", silent, [&](std::size_t camera) -> Result<> {
    auto map = decode(stacks[camera], *sequence, task.decode, camera == 0 ? "left" : "right", silent);
    if (!map) return base::fail(std::move(map));
    parts.maps[camera] = *std::move(map);
    return {};
  });
  if (!decoded) return base::fail(std::move(decoded));
  auto depths = scan::match(parts.maps[0], parts.maps[1], scanned.head, task.match, progress);
  if (!depths) return base::fail(std::move(depths));
  parts.depths = *std::move(depths);
  auto tested = app::tested_head(task, scanned.head, parts.maps, parts.depths, progress);
  if (!tested) return base::fail(std::move(tested));
  parts.head_test = *std::move(tested);
  auto cloud = scan::make_cloud(parts.depths, parts.maps[0], scanned.head, task.cloud, progress);
  if (!cloud) return base::fail(std::move(cloud));
  parts.cloud = *std::move(cloud);
  if (markers == nullptr) return scanned;
  parts.observations = std::move(seen);
  const auto& [left, right] = parts.observations;
  parts.on_markers = scan::mask_markers(parts.cloud, scanned.head, left, right, *markers);
  auto points = scan::marker_points(parts.cloud, scanned.head, left, right, task.cloud.filter_radius_px, *markers);
  if (!points) return base::fail(std::move(points));
  parts.markers = *std::move(points);
  return scanned;
}

py::array status_array(std::vector<base::PhaseStatus>&& status, int width, int height) {
  return array_of<std::uint8_t>(std::move(status), {height, width});
}

py::array rows_of(const std::vector<base::ScannedMarker>& markers) {
  std::vector<PointRow> rows;
  for (const base::ScannedMarker& marker : markers) {
    PointRow& row = rows.emplace_back();
    row.id = marker.id;
    for (int i = 0; i < 3; ++i) {
      row.xyz_mm[i] = marker.p_in_rig_mm(i);
      for (int j = 0; j < 3; ++j) row.cov_mm2[i][j] = marker.cov_mm2(i, j);
    }
  }
  const auto count = static_cast<py::ssize_t>(rows.size());
  return array_of<PointRow>(std::move(rows), {count});
}

py::dict scan(const py::sequence& left, const py::sequence& right, const std::filesystem::path& manifest,
              const std::string& rig, double min_depth_mm, double max_depth_mm, int guard_px, int filter_px,
              double max_grazing_rad, double white_level, const std::optional<std::pair<py::object, py::object>>& markers,
              double thickness_mm, std::optional<double> dot_diameter_mm, std::optional<double> max_off_curve_px) {
  const std::array<Stack, 2> stacks = {Stack(left, white_level), Stack(right, white_level)};
  app::ScanTask task;
  task.head = rig;
  task.match.min_depth_mm = min_depth_mm;
  task.match.max_depth_mm = max_depth_mm;
  task.match.guard_px = guard_px;
  task.cloud.filter_radius_px = filter_px;
  task.cloud.max_grazing_rad = max_grazing_rad;
  task.max_off_curve_px = max_off_curve_px;
  std::array<base::ImageObservations, 2> seen;
  scan::MarkerOptions marker_options;
  if (markers) {
    seen[0].observations = observations_from(markers->first);
    seen[1].observations = observations_from(markers->second);
    marker_options.thickness_mm = thickness_mm;
    marker_options.dot_radius_mm = 0.5 * dot_diameter_mm.value_or(0.0);
  }
  Scanned scanned = call([&](const Progress& progress) {
    return compute(stacks, manifest, task, markers ? &marker_options : nullptr, std::move(seen), progress);
  });
  app::ScanParts& parts = scanned.parts;
  const py::object summary = python_of(base::scan_json(app::summarise(task, scanned.head, parts)));
  py::dict result = cloud_dict(std::move(parts.cloud.cloud));
  result["depth_mm"] = array_of<float>(std::move(parts.cloud.depth_mm), {parts.depths.height, parts.depths.width});
  result["status_left"] = status_array(std::move(parts.maps[0].status), parts.maps[0].width, parts.maps[0].height);
  result["status_right"] = status_array(std::move(parts.maps[1].status), parts.maps[1].width, parts.maps[1].height);
  result["markers"] = rows_of(parts.markers);
  result["summary"] = summary;
  return result;
}

}  // namespace

void add_scan(py::module_& module) {
  const scan::MatchOptions match;
  const scan::CloudOptions cloud;
  module.def(
      "scan", &scan, py::arg("left"), py::arg("right"), py::arg("manifest"), py::arg("rig"), py::kw_only(),
      py::arg("min_depth_mm") = match.min_depth_mm, py::arg("max_depth_mm") = match.max_depth_mm,
      py::arg("guard_px") = match.guard_px, py::arg("filter_px") = cloud.filter_radius_px,
      py::arg("max_grazing_rad") = cloud.max_grazing_rad, py::arg("white_level") = 0.0, py::arg("markers") = py::none(),
      py::arg("thickness_mm") = 0.0, py::arg("dot_diameter_mm") = py::none(), py::arg("max_off_curve_px") = py::none(),
      "Fringe images of two calibrated cameras -> a cloud with a sigma for each point.\n\n"
      "left, right       (patterns, rows, columns) of uint8 or uint16, or sequences of (rows, columns): one image for each\n"
      "                  pattern of the manifest, in its order\n"
      "manifest          patterns.json: what each image shows\n"
      "rig               folder of a result of calibrate or commission, or 'INTRINSIC.yml,EXTRINSIC.yml' of OpenCV\n"
      "min_depth_mm      of z in the left camera's frame, and max_depth_mm\n"
      "guard_px          pixels nearer than this to the end of a surface are left out\n"
      "filter_px         average depths over squares of 2 n + 1 pixels; 0: none\n"
      "max_grazing_rad   largest angle between normal and viewing ray\n"
      "markers           (left, right): observations of detect() in both white images; points on them are left out, and\n"
      "                  they are measured. thickness_mm: from the wall to the dots' plane; dot_diameter_mm: else as seen\n"
      "max_off_curve_px  distance from the epipolar curves from which on the calibration is refused; 0: never\n\n"
      "Returns a cloud dict (read_cloud()) in the rig's frame, the left camera's: points (N, 3) [mm], normals (N, 3) towards "
      "the\n"
      "camera, fields with sigma_mm (N,) along the viewing ray, calibration_mm, light, modulation, column, row; and\n"
      "depth_mm      (rows, columns) float32: z of each pixel of the left image, not a number where no point is\n"
      "status_left, status_right  (rows, columns) uint8: 0 valid, 1 dark, 2 saturated, 3 undecided, 4 disturbed\n"
      "markers       array of POINT in the rig's frame, covariances of the cameras' noise\n"
      "summary       the keys of a result of `crosstie scan` (docs/formats.md), without edges\n\n"
      "The edge pixels of `crosstie scan` are not among them. Raises Error for movement, changed light, and a calibration\n"
      "that is not the head's, by name.");
}

}  // namespace crosstie::python
