#include "app/head_files.h"

#include <fmt/core.h>

#include "base/calibration_reader.h"
#include "base/file.h"
#include "base/opencv_stereo.h"

namespace crosstie::app {
namespace {

namespace fs = std::filesystem;
using base::ErrorCode;
using base::Result;

Result<HeadFiles> from_calibration(const fs::path& folder) {
  auto calibration = base::read_calibration(folder);
  if (!calibration) return base::fail(std::move(calibration));
  if (!calibration->rig || calibration->cameras.size() != 2) {
    return base::fail(ErrorCode::kBadInput,
                      fmt::format("{}: the calibration holds no pair of cameras on a rig", base::shown(folder)));
  }
  auto covariance = base::joint_covariance(*calibration, {calibration->rig->left, calibration->rig->right}, true);
  if (!covariance) return base::fail(std::move(covariance));
  const bool in_order = calibration->cameras[0].name == calibration->rig->left;
  const auto& left = calibration->cameras[in_order ? 0 : 1];
  const auto& right = calibration->cameras[in_order ? 1 : 0];
  return HeadFiles{
      {left.name, right.name, left.camera, right.camera, calibration->rig->right_from_left, *std::move(covariance), {}},
      {folder / "result.json"}};
}

}  // namespace

Result<HeadFiles> read_head(const std::string& text, int width_px, int height_px) {
  const std::size_t comma = text.find(',');
  if (comma == std::string::npos) return from_calibration(text);
  const fs::path intrinsic = text.substr(0, comma);
  const fs::path extrinsic = text.substr(comma + 1);
  auto head = base::read_opencv_stereo(intrinsic, extrinsic, width_px, height_px);
  if (!head) return base::fail(std::move(head));
  return HeadFiles{*std::move(head), {intrinsic, extrinsic}};
}

}  // namespace crosstie::app
