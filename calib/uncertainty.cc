#include "calib/uncertainty.h"

#include <algorithm>
#include <optional>

#include <fmt/format.h>

namespace crosstie::calib {
namespace {

using base::Calibration;
using base::ErrorCode;
using base::fail;
using base::Result;
using Eigen::Index;
using Eigen::MatrixXd;

/// The first row of what is called `name` in the joint covariance.
std::optional<Index> row_of(const Calibration& calibration, const std::string& name) {
  const auto found = std::find_if(calibration.labels.begin(), calibration.labels.end(),
                                  [&](const std::string& label) { return label.starts_with(name + " "); });
  if (found == calibration.labels.end()) return std::nullopt;
  return static_cast<Index>(found - calibration.labels.begin());
}

bool has_covariance(const Calibration& calibration) {
  const auto count = static_cast<Index>(calibration.labels.size());
  return count > 0 && calibration.covariance.rows() == count && calibration.covariance.cols() == count;
}

/// Derivative of a camera's lens parameters by the joint unknowns.
MatrixXd lens_rows(const Calibration& calibration, std::size_t camera) {
  const auto& one = calibration.cameras[camera];
  MatrixXd rows = MatrixXd::Zero(one.camera.parameters().size(), calibration.covariance.cols());
  if (const auto first = row_of(calibration, "camera " + one.name)) {
    const Index free = base::adjustable_count(one.camera.model());
    rows.block(0, *first, free, free).setIdentity();
  }
  return rows;
}

MatrixXd rig_rows(const Calibration& calibration) {
  MatrixXd rows = MatrixXd::Zero(6, calibration.covariance.cols());
  if (const auto first = row_of(calibration, "rig")) rows.middleCols<6>(*first).setIdentity();
  return rows;
}

/// Derivative of the mean motion of the boards in a camera's frame by the joint unknowns. With T = board_from_camera and
/// exp(d) T, the board moves by -Ad(T^-1) d as the camera sees it.
MatrixXd board_motion_rows(const Calibration& calibration, std::size_t camera) {
  MatrixXd rows = MatrixXd::Zero(6, calibration.covariance.cols());
  const bool right = camera == 1 && calibration.rig.has_value();
  const base::Matrix6d to_right =
      right ? calibration.rig->right_from_left.adjoint() : base::Matrix6d(base::Matrix6d::Identity());
  int count = 0;
  for (const base::CalibratedView& view : calibration.views) {
    if (view.camera != calibration.cameras[camera].name) continue;
    const base::CalibratedStation& station = calibration.stations[static_cast<std::size_t>(view.station)];
    const bool shared = station.paired;
    const auto first = row_of(calibration, shared ? "station " + station.name : "image " + view.image);
    if (!first) continue;
    const base::Pose& pose = shared ? station.board_from_rig : view.board_from_camera;
    base::Matrix6d moved = -pose.inverse().adjoint();
    if (shared) {
      moved = to_right * moved;
      if (right) rows += rig_rows(calibration);
    }
    rows.middleCols<6>(*first) += moved;
    ++count;
  }
  return count > 0 ? MatrixXd(rows / count) : rows;
}

MatrixXd carried(const Calibration& calibration, const MatrixXd& rows) {
  const MatrixXd result = rows * calibration.covariance * rows.transpose();
  return 0.5 * (result + result.transpose());
}

tl::unexpected<base::Error> without(std::string_view what) {
  return fail(ErrorCode::kBadInput, fmt::format("the calibration has no {}", what));
}

}  // namespace

MatrixXd lens_and_boards_covariance(const Calibration& calibration, int camera) {
  const auto c = static_cast<std::size_t>(camera);
  if (camera < 0 || c >= calibration.cameras.size() || !has_covariance(calibration)) return {};
  const MatrixXd lens = lens_rows(calibration, c);
  MatrixXd rows(lens.rows() + 6, lens.cols());
  rows << lens, board_motion_rows(calibration, c);
  return carried(calibration, rows);
}

Result<base::ProjectionSigmas> projection_sigmas(const Calibration& calibration, int camera,
                                                 const math::ProjectionSigmasOptions& options) {
  const auto c = static_cast<std::size_t>(camera);
  if (camera < 0 || c >= calibration.cameras.size()) return without(fmt::format("camera {}", camera));
  const MatrixXd covariance = lens_and_boards_covariance(calibration, camera);
  if (covariance.size() == 0) return without("covariance");
  return math::projection_sigmas(calibration.cameras[c].camera, covariance, options);
}

Result<base::TriangulationSigmas> triangulation_sigmas(const Calibration& calibration, PointFrame frame,
                                                       const math::ProjectionSigmasOptions& options) {
  if (!calibration.rig || calibration.cameras.size() != 2) return without("rig");
  if (!has_covariance(calibration)) return without("covariance");
  const MatrixXd left = lens_rows(calibration, 0);
  const MatrixXd right = lens_rows(calibration, 1);
  const bool boards = frame == PointFrame::kBoards;
  MatrixXd rows(left.rows() + right.rows() + (boards ? 12 : 6), left.cols());
  rows.topRows(left.rows()) = left;
  rows.middleRows(left.rows(), right.rows()) = right;
  rows.middleRows<6>(left.rows() + right.rows()) = rig_rows(calibration);
  if (boards) rows.bottomRows<6>() = board_motion_rows(calibration, 0);
  return math::triangulation_sigmas(calibration.cameras[0].camera, calibration.cameras[1].camera,
                                    calibration.rig->right_from_left, carried(calibration, rows), options);
}

}  // namespace crosstie::calib
