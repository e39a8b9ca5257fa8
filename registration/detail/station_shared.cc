#include "registration/detail/station_shared.h"

#include <algorithm>

#include <Eigen/QR>

#include "math/head_point.h"
#include "registration/detail/shared.h"

namespace crosstie::registration::detail {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::Vector3d;

constexpr std::size_t kPlaces = 300;
constexpr Index kTerms = 20;  // of the third degree in three coordinates
constexpr double kLeftWeight = 1e3;

}  // namespace

StationShared::StationShared(const base::Stitching& stitching, int station, const std::optional<base::Head>& head,
                             const base::Cloud& cloud) {
  const base::StitchedStation& of = stitching.stations[static_cast<std::size_t>(station)];
  const std::size_t every = std::max<std::size_t>(1, cloud.points.size() / kPlaces);
  std::vector<Vector3d> places;
  for (std::size_t i = 0; i < cloud.points.size(); i += every) places.push_back(cloud.points[i]);
  for (const Vector3d& place : places) centre_ += place / static_cast<double>(places.size());
  for (const Vector3d& place : places) scale_ = std::max(scale_, (place - centre_).norm());

  const bool known = head && stitching.head && stitching.head->cov.size() > 0;
  Eigen::VectorXd parameters_change;
  const Index count = known ? head->parameter_count() : 0;
  if (known) {
    parameters_change = math::head_change(*head, *stitching.head);
    moved_ = parameters_change.norm() > 0.0;
  }
  std::vector<Index> rows;
  for (Index i = 0; i < 6; ++i) rows.push_back(6 * station + i);
  for (Index i = 0; i < count; ++i) rows.push_back(6 * static_cast<Index>(stitching.stations.size()) + i);
  const MatrixXd joint = stitching.covariance(rows, rows);

  MatrixXd design(static_cast<Index>(places.size()), kTerms);
  MatrixXd changes = MatrixXd::Zero(design.rows(), 3);
  MatrixXd covs = MatrixXd::Zero(design.rows(), 6);
  Index used = 0;
  for (const Vector3d& place : places) {
    MatrixXd jacobian = MatrixXd::Zero(3, 6 + count);
    const Vector3d at = of.machine_from_rig * place;
    jacobian.leftCols<3>() = -base::skew(at);
    jacobian.middleCols<3>(3).setIdentity();
    if (known) {
      const auto by_head = point_by_head(*head, place, kLeftWeight);
      if (!by_head) continue;
      changes.row(used) = (*by_head * parameters_change).transpose();
      jacobian.rightCols(count) = of.machine_from_rig.rotation.toRotationMatrix() * *by_head;
    }
    const Eigen::Matrix3d c = jacobian * joint * jacobian.transpose();
    covs.row(used) << c(0, 0), c(0, 1), c(0, 2), c(1, 1), c(1, 2), c(2, 2);
    design.row(used) = basis(place).transpose();
    ++used;
  }
  // Flat clouds do not tell all terms: the shortest solution.
  const Eigen::CompleteOrthogonalDecomposition<MatrixXd> solver(design.topRows(used));
  change_ = solver.solve(changes.topRows(used));
  cov_ = solver.solve(covs.topRows(used));
}

Eigen::VectorXd StationShared::basis(const Vector3d& p_in_rig_mm) const {
  const Vector3d t = (p_in_rig_mm - centre_) / scale_;
  const double x = t.x();
  const double y = t.y();
  const double z = t.z();
  Eigen::VectorXd terms(kTerms);
  terms << 1.0, x, y, z, x * x, x * y, x * z, y * y, y * z, z * z, x * x * x, x * x * y, x * x * z, x * y * y, x * y * z,
      x * z * z, y * y * y, y * y * z, y * z * z, z * z * z;
  return terms;
}

Vector3d StationShared::change(const Vector3d& p_in_rig_mm) const {
  if (!moved_) return Vector3d::Zero();
  return change_.transpose() * basis(p_in_rig_mm);
}

Eigen::Matrix3d StationShared::cov(const Vector3d& p_in_rig_mm) const {
  const Eigen::Matrix<double, 6, 1> c = cov_.transpose() * basis(p_in_rig_mm);
  Eigen::Matrix3d result;
  result << c(0), c(1), c(2), c(1), c(3), c(4), c(2), c(4), c(5);
  return result;
}

}  // namespace crosstie::registration::detail
