#include "edge/workpiece.h"

#include <algorithm>
#include <cmath>
#include <set>

#include <fmt/core.h>
#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>

#include "math/distributions.h"
#include "math/rigid_alignment.h"

namespace crosstie::edge {
namespace {

using base::ErrorCode;
using base::fail;
using base::Result;

constexpr int kMaxIterations = 50;
constexpr double kLeastEigenvalue = 1e-12;  // of the normal matrix scaled to unit diagonal
constexpr double kLargeW = 3.29;            // 0.1 %, two-sided
constexpr double kTestLevel = 1e-3;         // of a point's test
constexpr double kUnknownDirection_rad = 1.0 / 3.0;
constexpr double kStep_mm = 1e-3;  // of difference quotients
constexpr double kStep_rad = 1e-6;

Result<> check_points(std::span<const PartPoint> points, const Eigen::MatrixXd& joint) {
  std::set<int> ids;
  for (const PartPoint& p : points) {
    if (!ids.insert(p.id).second) return fail(ErrorCode::kBadInput, fmt::format("point {} of the part is there twice", p.id));
    if (!p.p_in_part.allFinite() || !p.p_in_machine.allFinite() || !p.part_cov_mm2.allFinite() ||
        !p.machine_cov_mm2.allFinite()) {
      return fail(ErrorCode::kBadInput, fmt::format("point {} of the part is not finite", p.id));
    }
    if (joint.size() == 0 && !(p.machine_cov_mm2.diagonal().minCoeff() > 0.0)) {
      return fail(ErrorCode::kBadInput, fmt::format("point {} of the part was measured without a sigma", p.id));
    }
  }
  const auto size = static_cast<Eigen::Index>(3 * points.size());
  if (joint.size() > 0 && (joint.rows() != size || joint.cols() != size || !joint.allFinite())) {
    return fail(ErrorCode::kBadInput,
                fmt::format("the joint covariance of {} points of the part has {} rows", points.size(), joint.rows()));
  }
  return {};
}

/// The coordinates that count, in one system.
struct System {
  std::vector<std::pair<std::size_t, int>> rows;  ///< point and axis of the part
  Eigen::VectorXd residual;
  Eigen::MatrixXd jacobian;
  Eigen::MatrixXd variance;
};

System system_at(std::span<const PartPoint> points, const Eigen::MatrixXd& joint, const base::Pose& machine_from_part) {
  System s;
  for (std::size_t i = 0; i < points.size(); ++i) {
    for (int axis = 0; axis < 3; ++axis) {
      if (points[i].axes[static_cast<std::size_t>(axis)]) s.rows.emplace_back(i, axis);
    }
  }
  const auto n = static_cast<Eigen::Index>(points.size());
  const auto m = static_cast<Eigen::Index>(s.rows.size());
  const Eigen::Matrix3d back = machine_from_part.rotation.conjugate().toRotationMatrix();
  Eigen::MatrixXd pick = Eigen::MatrixXd::Zero(m, 3 * n);  // of the machine's coordinates, turned
  s.residual.resize(m);
  s.jacobian.resize(m, 6);
  for (Eigen::Index r = 0; r < m; ++r) {
    const auto& [i, axis] = s.rows[static_cast<std::size_t>(r)];
    const PartPoint& p = points[i];
    s.residual(r) = (machine_from_part.inverse() * p.p_in_machine - p.p_in_part)(axis);
    s.jacobian.row(r) << back.row(axis) * base::skew(p.p_in_machine), -back.row(axis);
    pick.block<1, 3>(r, static_cast<Eigen::Index>(3 * i)) = back.row(axis);
  }
  Eigen::MatrixXd machine = joint;
  if (joint.size() == 0) {
    machine = Eigen::MatrixXd::Zero(3 * n, 3 * n);
    for (Eigen::Index i = 0; i < n; ++i)
      machine.block<3, 3>(3 * i, 3 * i) = points[static_cast<std::size_t>(i)].machine_cov_mm2;
  }
  s.variance = pick * machine * pick.transpose();
  for (Eigen::Index r = 0; r < m; ++r) {
    for (Eigen::Index c = 0; c < m; ++c) {
      const auto& [i, axis] = s.rows[static_cast<std::size_t>(r)];
      const auto& [j, other] = s.rows[static_cast<std::size_t>(c)];
      if (i == j) s.variance(r, c) += points[i].part_cov_mm2(axis, other);
    }
  }
  return s;
}

std::string direction_name(Eigen::Index i) {
  constexpr const char* kNames[] = {"its turn about x",  "its turn about y",  "its turn about z",
                                    "its place along x", "its place along y", "its place along z"};
  return kNames[i];
}

/// Normal matrix about the points' centroid (machine axes), so that turns and shifts are apart.
Result<> check_rank(std::span<const PartPoint> points, const Eigen::MatrixXd& normal) {
  Eigen::Vector3d centroid = Eigen::Vector3d::Zero();
  for (const PartPoint& p : points) centroid += p.p_in_machine / static_cast<double>(points.size());
  base::Pose shift;
  shift.translation_mm = centroid;
  const base::Matrix6d there = shift.adjoint();
  const Eigen::MatrixXd about = there.transpose() * normal * there;
  const Eigen::VectorXd scale = about.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
  const Eigen::MatrixXd scaled = scale.asDiagonal() * about * scale.asDiagonal();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(scaled);
  if (eigen.eigenvalues()(0) > kLeastEigenvalue) return {};
  Eigen::Index weakest = 0;
  eigen.eigenvectors().col(0).cwiseAbs().maxCoeff(&weakest);
  return fail(ErrorCode::kNoUniqueSolution,
              fmt::format("the reference points do not hold the part: {} (machine's axes) is free; lock more coordinates",
                          direction_name(weakest)));
}

/// Baarda's test of a point: T = g' M^-1 g of its coordinates, g = P v and M = P Qvv P; chi-square of as many as M has rank.
struct PointTest {
  double w = 0.0;  ///< sqrt(T / rank)
  double p = 1.0;  ///< probability of a larger one
};

PointTest test_of(const Eigen::VectorXd& g, const Eigen::MatrixXd& m) {
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(m);
  PointTest test;
  double square = 0.0;
  int rank = 0;
  for (Eigen::Index k = 0; k < g.size(); ++k) {
    if (eigen.eigenvalues()(k) < 1e-9 * eigen.eigenvalues()(g.size() - 1)) continue;
    square += std::pow(eigen.eigenvectors().col(k).dot(g), 2) / eigen.eigenvalues()(k);
    ++rank;
  }
  if (rank == 0) return test;
  test.w = std::sqrt(square / rank);
  test.p = 1.0 - math::chi_square_cdf(square, rank);
  return test;
}

void judge(Workpiece& part, const System& s, std::span<const PartPoint> points, const Eigen::MatrixXd& cofactor,
           const Eigen::MatrixXd& weight) {
  const Eigen::MatrixXd residual_cov = s.variance - s.jacobian * cofactor * s.jacobian.transpose();
  const Eigen::MatrixXd normalised = weight * residual_cov * weight;
  const Eigen::VectorXd weighted = weight * s.residual;
  std::vector<std::pair<double, base::Warning>> found;
  for (std::size_t i = 0; i < points.size(); ++i) {
    PartResidual one;
    one.id = points[i].id;
    std::vector<Eigen::Index> checked;
    for (std::size_t k = 0; k < s.rows.size(); ++k) {
      const auto r = static_cast<Eigen::Index>(k);
      if (s.rows[k].first != i) continue;
      one.residual_mm(s.rows[k].second) = s.residual(r);
      if (residual_cov(r, r) < 1e-6 * s.variance(r, r)) continue;  // nothing checks it
      one.sigma_mm(s.rows[k].second) = std::sqrt(residual_cov(r, r));
      checked.push_back(r);
    }
    part.residuals.push_back(one);
    if (checked.empty()) continue;
    const PointTest test = test_of(weighted(checked), normalised(checked, checked));
    if (test.p > kTestLevel) continue;
    found.emplace_back(
        test.w,
        base::Warning{"part_point", std::to_string(one.id),
                      fmt::format("it is {:.3f} mm from where the part's points put it, {:.1f} times its sigma: a wrong id, "
                                  "a moved or damaged marker, or a part that is not as drawn",
                                  one.residual_mm.norm(), test.w)});
  }
  std::stable_sort(found.begin(), found.end(), [](const auto& a, const auto& b) { return a.first > b.first; });
  for (auto& [w, warning] : found) part.warnings.push_back(std::move(warning));
}

/// Origin on the axis beside the hole, z along the axis, x to the hole.
base::Pose frame_of(const TowerAndHole& tower) {
  const Eigen::Vector3d z = tower.axis_direction.normalized();
  const Eigen::Vector3d to_hole = tower.hole_centre_mm - tower.axis_point_mm;
  Eigen::Matrix3d axes;
  axes.col(2) = z;
  axes.col(0) = (to_hole - z.dot(to_hole) * z).normalized();
  axes.col(1) = z.cross(axes.col(0));
  return {Eigen::Quaterniond(axes).normalized(), tower.axis_point_mm + z.dot(to_hole) * z};
}

double radius_of(const TowerAndHole& tower) {
  const Eigen::Vector3d z = tower.axis_direction.normalized();
  const Eigen::Vector3d to_hole = tower.hole_centre_mm - tower.axis_point_mm;
  return (to_hole - z.dot(to_hole) * z).norm();
}

Result<> check_tower(const TowerAndHole& tower, const char* where) {
  if (!tower.axis_point_mm.allFinite() || !tower.axis_direction.allFinite() || !tower.hole_centre_mm.allFinite() ||
      !(tower.axis_direction.norm() > 1e-9)) {
    return fail(ErrorCode::kBadInput,
                fmt::format("the tower's axis or hole in the {} is not finite or has no direction", where));
  }
  if (!(radius_of(tower) > 1.0)) {
    return fail(ErrorCode::kBadInput,
                fmt::format("in the {} the hole's centre lies on the tower's axis: it gives no turn about it", where));
  }
  return {};
}

}  // namespace

Result<Workpiece> workpiece_from_points(std::span<const PartPoint> points, const Eigen::MatrixXd& machine_cov_mm2) {
  if (auto good = check_points(points, machine_cov_mm2); !good) return fail(std::move(good));
  std::vector<math::AlignmentPair> pairs;
  bool all_axes = true;
  for (const PartPoint& p : points) {
    pairs.push_back({.a_mm = p.p_in_machine, .b_mm = p.p_in_part});
    all_axes = all_axes && p.axes == std::array<bool, 3>{true, true, true};
  }
  const auto start = math::align(pairs, {.with_scale = false, .weighted = false});
  if (!start) return fail(start.error().code, "the points of the part: " + start.error().message);
  Workpiece part;
  part.source = all_axes ? "markers" : "rps";
  part.machine_from_part = start->a_from_b;
  System s;
  Eigen::MatrixXd weight;
  Eigen::MatrixXd cofactor;
  for (int i = 0; i < kMaxIterations; ++i) {
    s = system_at(points, machine_cov_mm2, part.machine_from_part);
    if (s.rows.size() < 6) {
      return fail(ErrorCode::kNoUniqueSolution,
                  fmt::format("the reference points lock {} coordinates of the part; six are needed", s.rows.size()));
    }
    const Eigen::LDLT<Eigen::MatrixXd> factor(s.variance);
    if (factor.info() != Eigen::Success || !(factor.vectorD().minCoeff() > 0.0)) {
      return fail(ErrorCode::kBadInput, "the covariance of the part's points is not positive");
    }
    weight = factor.solve(Eigen::MatrixXd::Identity(s.variance.rows(), s.variance.cols()));
    const Eigen::MatrixXd normal = s.jacobian.transpose() * weight * s.jacobian;
    if (auto held = check_rank(points, normal); !held) return fail(std::move(held));
    const Eigen::VectorXd scale = normal.diagonal().cwiseSqrt().cwiseInverse();
    const Eigen::LDLT<Eigen::MatrixXd> solver(scale.asDiagonal() * normal * scale.asDiagonal());
    cofactor = scale.asDiagonal() * solver.solve(Eigen::MatrixXd::Identity(6, 6)) * scale.asDiagonal();
    const base::Vector6d step = -cofactor * (s.jacobian.transpose() * (weight * s.residual));
    part.machine_from_part = base::perturbed(part.machine_from_part, step);
    if (step.head<3>().norm() < 1e-13 && step.tail<3>().norm() < 1e-9) break;
  }
  s = system_at(points, machine_cov_mm2, part.machine_from_part);
  part.covariance = 0.5 * (cofactor + cofactor.transpose());
  part.redundancy = static_cast<long>(s.rows.size()) - 6;
  if (part.redundancy > 0) part.sigma0 = std::sqrt(s.residual.dot(weight * s.residual) / static_cast<double>(part.redundancy));
  judge(part, s, points, cofactor, weight);
  return part;
}

TowerCovariance tower_covariance(const math::ShapeQuality& axis, const Eigen::Vector3d& axis_direction,
                                 const Eigen::Matrix3d& hole_centre_cov_mm2) {
  Eigen::Matrix<double, 6, 7> by_change = Eigen::Matrix<double, 6, 7>::Zero();
  by_change.block<3, 3>(0, 0) = axis.frame;
  const double sense = axis.frame.col(2).dot(axis_direction) < 0.0 ? -1.0 : 1.0;
  by_change.block<3, 2>(3, 3) = sense * axis.frame.leftCols<2>();
  TowerCovariance covariance = TowerCovariance::Zero();
  covariance.topLeftCorner<6, 6>() = by_change * axis.covariance * by_change.transpose();
  covariance.bottomRightCorner<3, 3>() = hole_centre_cov_mm2;
  return covariance;
}

Result<Workpiece> workpiece_from_tower(const TowerAndHole& in_part, const TowerAndHole& in_machine,
                                       const TowerCovariance& covariance, const base::Matrix6d& common) {
  if (auto good = check_tower(in_part, "part"); !good) return fail(std::move(good));
  if (auto good = check_tower(in_machine, "machine"); !good) return fail(std::move(good));
  if (!covariance.allFinite() || !common.allFinite())
    return fail(ErrorCode::kBadInput, "the covariance of the tower's axis is not finite");
  const double direction_sigma = std::sqrt(std::max(0.0, covariance.block<3, 3>(3, 3).trace()));
  if (direction_sigma > kUnknownDirection_rad) {
    return fail(ErrorCode::kNoUniqueSolution,
                "the direction of the tower's axis is hardly known: scan more of its circumference or length");
  }
  const base::Pose back = frame_of(in_part).inverse();
  Workpiece part;
  part.source = "tower";
  part.machine_from_part = frame_of(in_machine) * back;
  Eigen::Matrix<double, 6, 9> by_input;
  Eigen::Matrix<double, 1, 9> radius_by_input;
  for (int k = 0; k < 9; ++k) {
    const double step = k >= 3 && k < 6 ? kStep_rad : kStep_mm;
    const auto moved = [&](double sign) {
      TowerAndHole other = in_machine;
      other.axis_direction.normalize();
      Eigen::Vector3d& group = k < 3 ? other.axis_point_mm : k < 6 ? other.axis_direction : other.hole_centre_mm;
      group(k % 3) += sign * step;
      return other;
    };
    by_input.col(k) = (base::difference(part.machine_from_part, frame_of(moved(1.0)) * back) -
                       base::difference(part.machine_from_part, frame_of(moved(-1.0)) * back)) /
                      (2.0 * step);
    radius_by_input(k) = (radius_of(moved(1.0)) - radius_of(moved(-1.0))) / (2.0 * step);
  }
  part.covariance = by_input * covariance * by_input.transpose() + common;
  part.radius_error_mm = radius_of(in_machine) - radius_of(in_part);
  part.radius_sigma_mm = std::sqrt(std::max(0.0, (radius_by_input * covariance * radius_by_input.transpose())(0)));
  if (part.radius_sigma_mm > 0.0 && std::abs(part.radius_error_mm) > kLargeW * part.radius_sigma_mm) {
    part.warnings.push_back(
        {"tower_radius", "hole",
         fmt::format("the hole's centre is {:.3f} mm farther from the tower's axis than drawn ({:.1f} times its sigma): the "
                     "shell is not round, or not of that radius",
                     part.radius_error_mm, part.radius_error_mm / part.radius_sigma_mm)});
  }
  return part;
}

}  // namespace crosstie::edge
