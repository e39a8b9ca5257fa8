#include "base/calibration_reader.h"

#include <algorithm>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "base/detail/result_reading.h"
#include "base/file.h"
#include "base/npy.h"

namespace crosstie::base {
namespace {

using detail::Json;
using detail::Unreadable;

CalibratedArea area_of(const Json& json, int width_px, int height_px) {
  CalibratedArea area(width_px, height_px);
  constexpr int kCells = CalibratedArea::kCells;
  const Eigen::VectorXd counts = detail::numbers(json.at("counts"), Eigen::Index{kCells} * kCells);
  for (int row = 0; row < kCells; ++row) {
    for (int column = 0; column < kCells; ++column) {
      const double count = counts(row * kCells + column);
      if (!(count >= 0.0 && count < 1e9)) throw Unreadable("area holds a count that is none");
      area.set_count(column, row, static_cast<int>(count));
    }
  }
  return area;
}

CalibratedCamera camera_of(const Json& json) {
  CalibratedCamera one{.name = json.at("name"), .camera = detail::lens_of(json)};
  one.views = json.at("views");
  one.corners = json.at("corners");
  one.rms_px = json.at("rms_px");
  if (const Json& heldout = json.at("rms_heldout_px"); !heldout.is_null()) one.rms_heldout_px = heldout;
  if (const Json& temperature = json.at("temperature_c"); !temperature.is_null()) one.temperature_c = temperature;
  one.area = area_of(json.at("area"), one.camera.width_px(), one.camera.height_px());
  one.camera.set_valid_region(one.area.outline_px());
  return one;
}

CalibratedRig rig_of(const Json& json) {
  CalibratedRig rig;
  rig.left = json.at("left");
  rig.right = json.at("right");
  rig.right_from_left = detail::pose_of(json.at("right_from_left"));
  rig.cov = detail::symmetric(json.at("cov"), 6);
  rig.baseline_mm = json.at("baseline_mm");
  rig.baseline_sigma_mm = json.at("baseline_sigma_mm");
  rig.stations = json.at("stations");
  return rig;
}

Certificate certificate_of(const Json& json) {
  Certificate certificate;
  if (json.is_null()) return certificate;
  certificate.number = json.at("number");
  for (const auto& [key, day] :
       {std::pair{"issued", &certificate.issued}, std::pair{"valid_until", &certificate.valid_until}}) {
    if (json.at(key).is_null()) continue;
    const auto date = parse_date(json.at(key).get<std::string>());
    if (!date) throw Unreadable(date.error().message);
    *day = *date;
  }
  return certificate;
}

CalibratedBoard board_of(const Json& json) {
  CalibratedBoard found;
  const auto pattern = pattern_from_name(json.at("pattern").get<std::string>());
  if (!pattern) throw Unreadable("an unknown pattern of the board");
  found.board.pattern = *pattern;
  found.board.columns = json.at("columns");
  found.board.rows = json.at("rows");
  found.board.pitch_mm = json.at("pitch_mm");
  found.board.temperature_c = json.at("temperature_c");
  found.board.cte_per_k = json.at("cte_per_k");
  found.board.free = json.at("shape") == "free";
  found.board.certificate = certificate_of(json.at("certificate"));
  return found;
}

Calibration calibration_of(const Json& json) {
  detail::check_verb(json, "calibrate");
  Calibration calibration;
  for (const Json& camera : json.at("cameras")) calibration.cameras.push_back(camera_of(camera));
  if (calibration.cameras.empty() || calibration.cameras.size() > 2) throw Unreadable("one or two cameras were expected");
  if (const Json& rig = json.at("rig"); !rig.is_null()) {
    calibration.rig = rig_of(rig);
    if (calibration.cameras.size() != 2 || calibration.rig->left != calibration.cameras[0].name ||
        calibration.rig->right != calibration.cameras[1].name) {
      throw Unreadable("the rig is not that of the cameras");
    }
  }
  calibration.board = board_of(json.at("board"));
  calibration.sigma0 = json.at("sigma0");
  calibration.sigma0_px = json.at("sigma0_px");
  calibration.rms_px = json.at("rms_px");
  calibration.observations = json.at("observations");
  calibration.unknowns = json.at("unknowns");
  calibration.redundancy = json.at("redundancy");
  return calibration;
}

/// The rows of the joint covariance that belong to a lens, -1 for parameters that were held.
std::vector<Eigen::Index> rows_of(const Calibration& calibration, const CalibratedCamera& camera) {
  std::vector<Eigen::Index> rows;
  for (const std::string_view parameter : parameter_names(camera.camera.model())) {
    rows.push_back(detail::row_of(calibration.labels, fmt::format("camera {} {}", camera.name, parameter)).value_or(-1));
  }
  return rows;
}

}  // namespace

Result<Calibration> read_calibration(const std::filesystem::path& folder) {
  auto calibration = detail::read_result(folder, calibration_of);
  if (!calibration) return calibration;
  auto covariance = read_covariance(folder);
  if (!covariance) return fail(std::move(covariance));
  calibration->covariance = std::move(covariance->matrix);
  calibration->labels = std::move(covariance->labels);
  for (const CalibratedCamera& camera : calibration->cameras) {
    const auto rows = rows_of(*calibration, camera);
    if (std::any_of(rows.begin(), rows.end(), [](Eigen::Index row) { return row >= 0; })) continue;
    return fail(ErrorCode::kBadInput,
                fmt::format("{}: covariance.json names no parameter of camera {}", shown(folder), camera.name));
  }
  return calibration;
}

Result<Eigen::MatrixXd> joint_covariance(const Calibration& calibration, const std::vector<std::string>& cameras,
                                         bool with_rig) {
  std::vector<Eigen::Index> rows;
  for (const std::string& name : cameras) {
    const auto camera = std::find_if(calibration.cameras.begin(), calibration.cameras.end(),
                                     [&](const CalibratedCamera& one) { return one.name == name; });
    if (camera == calibration.cameras.end()) {
      return fail(ErrorCode::kBadInput, fmt::format("the calibration knows no camera {}", name));
    }
    const auto own = rows_of(calibration, *camera);
    rows.insert(rows.end(), own.begin(), own.end());
  }
  if (with_rig) {
    const auto first = std::find_if(calibration.labels.begin(), calibration.labels.end(),
                                    [](const std::string& label) { return label.starts_with("rig "); });
    if (calibration.labels.end() - first < 6) return fail(ErrorCode::kBadInput, "the calibration knows no rig");
    for (Eigen::Index i = 0; i < 6; ++i) rows.push_back(first - calibration.labels.begin() + i);
  }
  const auto size = static_cast<Eigen::Index>(rows.size());
  Eigen::MatrixXd joint = Eigen::MatrixXd::Zero(size, size);
  for (Eigen::Index i = 0; i < size; ++i) {
    for (Eigen::Index k = 0; k < size; ++k) {
      const Eigen::Index row = rows[static_cast<std::size_t>(i)];
      const Eigen::Index column = rows[static_cast<std::size_t>(k)];
      if (row >= 0 && column >= 0) joint(i, k) = calibration.covariance(row, column);
    }
  }
  return joint;
}

}  // namespace crosstie::base
