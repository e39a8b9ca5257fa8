#include "live/spatial.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <set>
#include <utility>

#include <fmt/format.h>
#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <Eigen/QR>

#include "math/circle_of_pair.h"
#include "math/head_point.h"
#include "math/triangulate.h"

namespace crosstie::live {
namespace {

using base::Observation;
using base::ObservationStatus;
using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;

/// What one camera says of an id.
struct Reading {
  const Observation* seen = nullptr;
  bool doubtful = false;
  bool twice = false;
};

std::map<int, Reading> readings(const base::ImageObservations& image) {
  std::map<int, Reading> found;
  for (const Observation& seen : image.observations) {
    if (seen.status != ObservationStatus::kCoded && seen.status != ObservationStatus::kAmbiguous) continue;
    Reading& reading = found[seen.id];
    reading.twice = reading.twice || reading.seen != nullptr;
    reading.doubtful = reading.doubtful || reading.twice || seen.status == ObservationStatus::kAmbiguous;
    reading.seen = &seen;
  }
  return found;
}

/// L^-1 with the covariance L L'; nothing where it is no covariance.
std::optional<Eigen::Matrix2d> whitening(const Eigen::Matrix2d& cov_px2) {
  if (!cov_px2.allFinite()) return {};
  const Eigen::LLT<Eigen::Matrix2d> root(cov_px2);
  if (root.info() != Eigen::Success || !(root.matrixLLT().diagonal().minCoeff() > 0.0)) return {};
  return Eigen::Matrix2d(root.matrixL().solve(Eigen::Matrix2d::Identity()));
}

/// Both images of a marker, of the circle's centre, and the point where they meet.
struct Meeting {
  math::HeadSight sight;
  std::array<Eigen::Matrix2d, 2> white;
  math::Triangulated point;
};

std::optional<Meeting> meeting_of(const base::Head& head, const Observation& left, const Observation& right) {
  const auto white_left = whitening(left.cov_px2);
  const auto white_right = whitening(right.cov_px2);
  if (!white_left || !white_right) return {};
  Meeting result{
      {{left.centre_px, right.centre_px}, {white_left->transpose() * *white_left, white_right->transpose() * *white_right}},
      {*white_left, *white_right},
      {}};
  const auto start = math::point_of_left_ray(head.left, head.right, head.right_from_left, left.centre_px, right.centre_px);
  if (!start || !(start->z() > 0.0)) return {};
  auto point = math::triangulate(head, result.sight, *start);
  if (!point) return {};
  const std::array<math::CircleView, 2> views = {
      math::CircleView{head.left.model(), head.left.parameters().data(), {}, math::shape_of(left)},
      math::CircleView{head.right.model(), head.right.parameters().data(), head.right_from_left, math::shape_of(right)}};
  const auto circle = math::circle_of_pair(views, point->p_in_rig_mm);
  if (circle) {
    const auto off_left = math::eccentricity_px(views[0], point->p_in_rig_mm, *circle);
    const auto off_right = math::eccentricity_px(views[1], point->p_in_rig_mm, *circle);
    if (off_left && off_right) {
      result.sight.pixel[0] -= *off_left;
      result.sight.pixel[1] -= *off_right;
      point = math::triangulate(head, result.sight, point->p_in_rig_mm);
      if (!point) return {};
    }
  }
  result.point = *point;
  return result;
}

/// How the two images of a point follow it and the head, in sigmas of the images.
struct Linear {
  Eigen::Matrix<double, 4, 3> by_point;
  Eigen::Matrix<double, 4, Eigen::Dynamic> by_head;
  Eigen::Vector4d residual;
};

std::optional<Linear> linear_of(const base::Head& head, const Meeting& meeting) {
  const Vector3d& p_in_rig = meeting.point.p_in_rig_mm;
  const Vector3d p_in_right = head.right_from_left * p_in_rig;
  Eigen::Matrix<double, 2, 3> left_by_point, right_by_point;
  base::ProjectionParameterJacobian left_by_lens, right_by_lens;
  const auto left = head.left.project(p_in_rig, &left_by_point, &left_by_lens);
  const auto right = head.right.project(p_in_right, &right_by_point, &right_by_lens);
  if (!left || !right) return {};
  Linear result;
  result.by_point.topRows<2>() = meeting.white[0] * left_by_point;
  result.by_point.bottomRows<2>() = meeting.white[1] * right_by_point * head.right_from_left.rotation.toRotationMatrix();
  result.residual.head<2>() = meeting.white[0] * (meeting.sight.pixel[0] - *left);
  result.residual.tail<2>() = meeting.white[1] * (meeting.sight.pixel[1] - *right);
  result.by_head.setZero(4, head.parameter_count());
  result.by_head.topLeftCorner(2, left_by_lens.cols()) = meeting.white[0] * left_by_lens;
  result.by_head.block(2, left_by_lens.cols(), 2, right_by_lens.cols()) = meeting.white[1] * right_by_lens;
  Eigen::Matrix<double, 3, 6> by_rig;
  by_rig << -base::skew(p_in_right), Matrix3d::Identity();
  result.by_head.bottomRightCorner<2, 6>() = meeting.white[1] * right_by_point * by_rig;
  return result;
}

/// Covariance of head, machine_from_rig and one known point (the index; -1: none), as MachineTie::joint_cov.
Eigen::MatrixXd joint_of(const base::Head& head, const MachineTie& tie, int known) {
  const Eigen::Index n = head.parameter_count();
  const Eigen::Index size = n + 6 + (known < 0 ? 0 : 3);
  Eigen::MatrixXd joint = Eigen::MatrixXd::Zero(size, size);
  if (tie.joint_cov.size() > 0) {
    joint.topLeftCorner(n + 6, n + 6) = tie.joint_cov.topLeftCorner(n + 6, n + 6);
    if (known < 0) return joint;
    const Eigen::Index at = n + 6 + 3 * known;
    joint.bottomRightCorner<3, 3>() = tie.joint_cov.block<3, 3>(at, at);
    joint.bottomLeftCorner(3, n + 6) = tie.joint_cov.block(at, 0, 3, n + 6);
    joint.topRightCorner(n + 6, 3) = joint.bottomLeftCorner(3, n + 6).transpose();
    return joint;
  }
  if (head.cov.size() > 0) joint.topLeftCorner(n, n) = head.cov;
  joint.block<6, 6>(n, n) = tie.cov;
  if (known >= 0) joint.bottomRightCorner<3, 3>() = tie.known[static_cast<std::size_t>(known)].cov_mm2;
  return joint;
}

/// Takes a point from rig to machine and holds it against the list.
void tie_down(const base::Head& head, const MachineTie& tie, const Eigen::Matrix<double, 3, Eigen::Dynamic>& point_by_head,
              SpatialMarker& marker) {
  const Matrix3d rotation = tie.machine_from_rig.rotation.toRotationMatrix();
  const Vector3d turned = rotation * *marker.xyz_mm;
  const Vector3d p_in_machine = tie.machine_from_rig * *marker.xyz_mm;
  const Eigen::Index n = head.parameter_count();
  const auto known =
      std::find_if(tie.known.begin(), tie.known.end(), [&](const KnownPoint& one) { return one.id == marker.id; });
  const int index = known == tie.known.end() ? -1 : static_cast<int>(known - tie.known.begin());
  const Eigen::MatrixXd joint = joint_of(head, tie, index);
  Eigen::Matrix<double, 3, Eigen::Dynamic> by_all = Eigen::Matrix<double, 3, Eigen::Dynamic>::Zero(3, joint.cols());
  by_all.leftCols(n) = rotation * point_by_head;
  // exp(w, v) on the left: the point turns about the machine's origin, as the translation does.
  by_all.block<3, 3>(0, n) = -base::skew(Vector3d(turned + tie.machine_from_rig.translation_mm));
  by_all.block<3, 3>(0, n + 3) = Matrix3d::Identity();
  marker.xyz_mm = p_in_machine;
  marker.image_cov_mm2 = rotation * marker.image_cov_mm2 * rotation.transpose();
  marker.calibration_cov_mm2 = by_all.leftCols(n + 6) * joint.topLeftCorner(n + 6, n + 6) * by_all.leftCols(n + 6).transpose();
  if (index < 0) return;
  by_all.rightCols<3>() = -Matrix3d::Identity();
  const Matrix3d cov = marker.image_cov_mm2 + by_all * joint * by_all.transpose();
  const Vector3d off = p_in_machine - known->xyz_mm;
  const Eigen::LLT<Matrix3d> root(cov);
  if (root.info() == Eigen::Success) marker.known_w = std::sqrt(off.dot(root.solve(off)) / 3.0);
}

void locate(const base::Head& head, const std::optional<MachineTie>& tie, const Observation& left, const Observation& right,
            SpatialMarker& marker) {
  const auto meeting = meeting_of(head, left, right);
  if (!meeting) return;
  const auto linear = linear_of(head, *meeting);
  if (!linear) return;
  const Eigen::MatrixXd head_cov =
      tie && tie->joint_cov.size() > 0
          ? Eigen::MatrixXd(tie->joint_cov.topLeftCorner(head.parameter_count(), head.parameter_count()))
          : head.cov;
  const Matrix3d& cov = meeting->point.cov_mm2;
  // The estimate moves against a change of the head.
  const Eigen::Matrix<double, 3, Eigen::Dynamic> point_by_head = -cov * linear->by_point.transpose() * linear->by_head;
  const Eigen::Matrix4d q = Eigen::HouseholderQR<Eigen::Matrix<double, 4, 3>>(linear->by_point).householderQ();
  // Signed as the right image point lies below the curve.
  const Eigen::Vector4d left_over = (q(3, 3) < 0.0 ? -1.0 : 1.0) * q.col(3);
  const Eigen::RowVectorXd misfit_by_head = left_over.transpose() * linear->by_head;
  const double by_calibration = head_cov.size() > 0 ? misfit_by_head * head_cov * misfit_by_head.transpose() : 0.0;
  marker.epipolar_w = left_over.dot(linear->residual) / std::sqrt(1.0 + std::max(0.0, by_calibration));
  marker.xyz_mm = meeting->point.p_in_rig_mm;
  marker.image_cov_mm2 = cov;
  if (tie) return tie_down(head, *tie, point_by_head, marker);
  if (head_cov.size() > 0) marker.calibration_cov_mm2 = point_by_head * head_cov * point_by_head.transpose();
}

base::Result<> check(const base::Head& head, const MachineTie& tie) {
  std::set<int> ids;
  for (const KnownPoint& one : tie.known) {
    if (!ids.insert(one.id).second) {
      return base::fail(base::ErrorCode::kUsage, fmt::format("known markers: the id {} stands there twice", one.id));
    }
  }
  const Eigen::Index wanted = head.parameter_count() + 6 + 3 * static_cast<Eigen::Index>(tie.known.size());
  if (tie.joint_cov.size() > 0 && (tie.joint_cov.rows() != wanted || tie.joint_cov.cols() != wanted)) {
    return base::fail(base::ErrorCode::kUsage,
                      fmt::format("known markers: a joint covariance of {} x {} in place of {} parameters",
                                  tie.joint_cov.rows(), tie.joint_cov.cols(), wanted));
  }
  return {};
}

}  // namespace

std::optional<double> SpatialMarker::w() const {
  if (!epipolar_w) return known_w;
  return std::max(std::abs(*epipolar_w), known_w.value_or(0.0));
}

base::Result<std::vector<SpatialMarker>> locate_markers(const base::Head& head, const base::ImageObservations& left,
                                                        const base::ImageObservations& right,
                                                        const std::optional<MachineTie>& tie) {
  if (tie) {
    if (auto valid = check(head, *tie); !valid) return base::fail(std::move(valid));
  }
  const std::map<int, Reading> lefts = readings(left);
  const std::map<int, Reading> rights = readings(right);
  std::set<int> ids;
  for (const auto& [id, reading] : lefts) ids.insert(id);
  for (const auto& [id, reading] : rights) ids.insert(id);
  std::vector<SpatialMarker> markers;
  for (const int id : ids) {
    const auto in_left = lefts.find(id);
    const auto in_right = rights.find(id);
    SpatialMarker marker{.id = id, .left = in_left != lefts.end(), .right = in_right != rights.end()};
    marker.doubtful = (marker.left && in_left->second.doubtful) || (marker.right && in_right->second.doubtful);
    const bool once = marker.left && marker.right && !in_left->second.twice && !in_right->second.twice;
    if (once) locate(head, tie, *in_left->second.seen, *in_right->second.seen, marker);
    markers.push_back(std::move(marker));
  }
  return markers;
}

}  // namespace crosstie::live
