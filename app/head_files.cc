#include "app/head_files.h"

#include <algorithm>

#include <fmt/core.h>
#include <nlohmann/json.hpp>

#include "base/calibration_reader.h"
#include "base/commissioning_reader.h"
#include "base/file.h"
#include "base/json_file.h"
#include "base/opencv_stereo.h"

namespace crosstie::app {
namespace {

namespace fs = std::filesystem;
using base::ErrorCode;
using base::Result;

Result<base::Head> head_in(const fs::path& folder) {
  const auto json = base::read_json(folder / "result.json");
  if (!json) return tl::unexpected(json.error());
  if (json->is_object() && json->value("verb", "") == "commission") {
    auto commissioning = base::read_commissioning(folder);
    if (!commissioning) return tl::unexpected(commissioning.error());
    return std::move(commissioning->head);
  }
  const auto calibration = base::read_calibration(folder);
  if (!calibration) return tl::unexpected(calibration.error());
  auto head = head_of(*calibration);
  if (!head) return base::fail(ErrorCode::kBadInput, fmt::format("{}: {}", base::shown(folder), head.error().message));
  return head;
}

}  // namespace

Result<base::Head> head_of(const base::Calibration& calibration) {
  const auto camera = [&](const std::string& name) {
    return std::find_if(calibration.cameras.begin(), calibration.cameras.end(),
                        [&](const base::CalibratedCamera& one) { return one.name == name; });
  };
  if (!calibration.rig) return base::fail(ErrorCode::kBadInput, "the calibration holds no pair of cameras on a rig");
  const auto left = camera(calibration.rig->left);
  const auto right = camera(calibration.rig->right);
  if (left == calibration.cameras.end() || right == calibration.cameras.end()) {
    return base::fail(ErrorCode::kBadInput, "the calibration's rig is of cameras that it does not hold");
  }
  auto cov = base::joint_covariance(calibration, {left->name, right->name}, true);
  if (!cov) return base::fail(std::move(cov));
  return base::Head{.left_name = left->name,
                    .right_name = right->name,
                    .left = left->camera,
                    .right = right->camera,
                    .right_from_left = calibration.rig->right_from_left,
                    .cov = *std::move(cov),
                    .temperature_c = left->temperature_c};
}

Result<HeadFiles> read_head(const std::string& text, int width_px, int height_px) {
  const std::size_t comma = text.find(',');
  if (comma == std::string::npos) {
    const fs::path folder = text;
    auto head = head_in(folder);
    if (!head) return tl::unexpected(head.error());
    return HeadFiles{*std::move(head), {folder / "result.json", folder / "covariance.npy", folder / "covariance.json"}};
  }
  const fs::path intrinsic = text.substr(0, comma);
  const fs::path extrinsic = text.substr(comma + 1);
  auto head = base::read_opencv_stereo(intrinsic, extrinsic, width_px, height_px);
  if (!head) return base::fail(std::move(head));
  return HeadFiles{*std::move(head), {intrinsic, extrinsic}};
}

}  // namespace crosstie::app
