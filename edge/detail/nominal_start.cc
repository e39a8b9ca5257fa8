#include "edge/detail/nominal_start.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>

#include "edge/detail/curve.h"

namespace crosstie::edge::detail {
namespace {

constexpr std::size_t kSample = 90;
constexpr double kTurnStep_rad = std::numbers::pi / 18.0;
constexpr double kFlat = 0.05;  // of the plane: least over middle extent, squared

/// Centre and axes of a curve: third axis towards the head.
struct Placement {
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  Eigen::Matrix3d axes = Eigen::Matrix3d::Identity();
};

Eigen::Matrix3d axes_about(const Eigen::Vector3d& z) {
  Eigen::Matrix3d axes;
  axes.col(2) = z.normalized();
  axes.col(0) = axes.col(2).unitOrthogonal();
  axes.col(1) = axes.col(2).cross(axes.col(0));
  return axes;
}

/// Mean by arc length and the scatter about it; a chain's gaps count as chords.
void moments(const std::vector<Eigen::Vector3d>& points, bool closed, Eigen::Vector3d& mean, Eigen::Matrix3d& scatter) {
  const std::size_t n = points.size();
  mean.setZero();
  scatter.setZero();
  double all = 0.0;
  for (std::size_t i = 0; i + (closed ? 0 : 1) < n; ++i) {
    const double length = (points[(i + 1) % n] - points[i]).norm();
    mean += 0.5 * length * (points[i] + points[(i + 1) % n]);
    all += length;
  }
  mean /= all;
  for (const auto& p : points) scatter += (p - mean) * (p - mean).transpose();
}

/// Algebraic circle (Kasa): centre and radius of points in a plane.
Eigen::Vector3d flat_circle(const Eigen::Matrix2Xd& points) {
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  Eigen::Vector3d right = Eigen::Vector3d::Zero();
  for (Eigen::Index i = 0; i < points.cols(); ++i) {
    const Eigen::Vector3d row(points(0, i), points(1, i), 1.0);
    normal += row * row.transpose();
    right += row * points.col(i).squaredNorm();
  }
  const Eigen::Vector3d x = normal.ldlt().solve(right);
  const Eigen::Vector2d centre = 0.5 * x.head<2>();
  return {centre.x(), centre.y(), std::sqrt(std::max(0.0, x(2) + centre.squaredNorm()))};
}

double mean_square(const Curve& curve, const base::Pose& frame_from_hole, const std::vector<Eigen::Vector3d>& sample) {
  const base::Pose back = frame_from_hole.inverse();
  double sum = 0.0;
  for (const auto& p : sample) {
    const double distance = curve.nearest(back * p).distance_mm;
    sum += distance * distance;
  }
  return sum / static_cast<double>(sample.size());
}

/// What the search knows of the measured rim.
struct Rim {
  std::vector<Eigen::Vector3d> points;
  std::vector<Eigen::Vector3d> sample;
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  std::vector<Eigen::Vector3d> normals;  ///< that it may have
  bool whole = false;                    ///< it goes all round, gaps of less than a quarter aside
};

Rim rim_of(const base::EdgeCurve& edge) {
  Rim rim;
  Eigen::Vector3d towards_head = Eigen::Vector3d::Zero();
  for (const auto& p : edge.points) {
    rim.points.push_back(p.point_mm);
    towards_head += p.normal;
  }
  const std::size_t every = std::max<std::size_t>(1, rim.points.size() / kSample);
  for (std::size_t i = 0; i < rim.points.size(); i += every) rim.sample.push_back(rim.points[i]);
  Eigen::Matrix3d scatter;
  moments(rim.points, edge.closed, rim.mean, scatter);
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(scatter);
  const double extent = eigen.eigenvalues()(2);
  if (!(extent > 0.0)) return rim;
  const bool is_arc = eigen.eigenvalues()(1) < 1e-3 * extent || eigen.eigenvalues()(0) > kFlat * eigen.eigenvalues()(1);
  Eigen::Vector3d z = eigen.eigenvectors().col(0);
  if (z.dot(towards_head) < 0.0) z = -z;
  rim.normals.push_back(z);
  if (is_arc && towards_head.norm() > 0.5 * static_cast<double>(rim.points.size()))
    rim.normals.push_back(towards_head.normalized());
  double gap = 0.0;
  for (const auto& g : edge.gaps) gap = std::max(gap, g.length_mm);
  rim.whole = edge.closed && gap < 0.25 * edge.length_mm;
  return rim;
}

Placement own_placement(const Curve& curve) {
  Placement own;
  if (curve.nominal().kind != NominalKind::kPoints) return own;
  std::vector<Eigen::Vector3d> points = curve.knot_points();
  if (curve.closed()) points.pop_back();
  Eigen::Matrix3d scatter;
  moments(points, curve.closed(), own.centre, scatter);
  Eigen::Vector3d z = Eigen::Vector3d::Zero();
  for (const auto& n : curve.nominal().normals) z += n.normalized();
  own.axes = axes_about(z.norm() > 0.1 ? z : curve.jet(0.0).normal);
  return own;
}

/// The outline's sizes and centre (in the plane) from the extents of points that are turned so that its length lies along x.
void from_extents(const Nominal& nominal, const Eigen::Matrix2Xd& turned, bool whole, std::vector<double>& size,
                  Eigen::Vector2d& centre) {
  const Eigen::Vector3d circle = flat_circle(turned);
  const Eigen::Vector2d low = turned.rowwise().minCoeff();
  const Eigen::Vector2d high = turned.rowwise().maxCoeff();
  centre = whole ? Eigen::Vector2d(0.5 * (low + high)) : Eigen::Vector2d(circle.head<2>());
  if (!nominal.size_mm.empty()) {
    size = nominal.size_mm;
  } else if (nominal.kind == NominalKind::kCircle) {
    size = {2.0 * circle.z()};
  } else {
    const Eigen::Vector2d extent = whole ? Eigen::Vector2d(high - low) : Eigen::Vector2d(2.2 * circle.z(), 1.8 * circle.z());
    size = {extent.x(), extent.y()};
  }
}

}  // namespace

std::vector<NominalStart> nominal_starts(const base::EdgeCurve& edge, const Nominal& nominal) {
  const Rim rim = rim_of(edge);
  std::vector<NominalStart> starts;
  const bool is_list = nominal.kind == NominalKind::kPoints;
  std::optional<Curve> list;
  Placement own;
  if (is_list) {
    auto made = Curve::make(nominal, false);
    if (!made) return starts;
    list = *std::move(made);
    own = own_placement(*list);
  }
  const bool is_round = nominal.kind == NominalKind::kCircle && !nominal.saddle;
  const bool half_turn_is_same = !is_list && !(nominal.saddle && nominal.saddle->half_angle_rad != 0.0);
  const double turns = is_round ? kTurnStep_rad : (half_turn_is_same ? 1.0 : 2.0) * std::numbers::pi;
  std::vector<Eigen::Vector3d> normals = rim.normals;
  if (is_list && nominal.normals.empty()) {
    for (const Eigen::Vector3d& z : rim.normals) normals.push_back(-z);
  }
  for (const Eigen::Vector3d& z : normals) {
    const Eigen::Matrix3d plane = axes_about(z);
    for (double turn = 0.0; turn < turns - 1e-9; turn += kTurnStep_rad) {
      NominalStart start{nominal, {}, 0.0};
      const Eigen::Matrix3d axes = plane * Eigen::AngleAxisd(turn, Eigen::Vector3d::UnitZ()).toRotationMatrix();
      Eigen::Vector3d centre = rim.mean;
      if (!is_list) {
        Eigen::Matrix2Xd turned(2, static_cast<Eigen::Index>(rim.points.size()));
        for (std::size_t i = 0; i < rim.points.size(); ++i) {
          turned.col(static_cast<Eigen::Index>(i)) = axes.leftCols<2>().transpose() * (rim.points[i] - rim.mean);
        }
        Eigen::Vector2d flat;
        from_extents(nominal, turned, rim.whole, start.nominal.size_mm, flat);
        centre += axes.leftCols<2>() * flat;
        const bool has_two = start.nominal.size_mm.size() == 2;
        if (nominal.size_mm.empty() && has_two && start.nominal.size_mm[0] < start.nominal.size_mm[1]) continue;
      }
      const Eigen::Matrix3d rotation = axes * own.axes.transpose();
      start.frame_from_hole.rotation = Eigen::Quaterniond(rotation).normalized();
      start.frame_from_hole.translation_mm = centre - rotation * own.centre;
      if (list) {
        start.mean_square = mean_square(*list, start.frame_from_hole, rim.sample);
      } else {
        auto curve = Curve::make(start.nominal, false);
        if (!curve) continue;
        start.mean_square = mean_square(*curve, start.frame_from_hole, rim.sample);
      }
      starts.push_back(std::move(start));
    }
  }
  std::stable_sort(starts.begin(), starts.end(),
                   [](const NominalStart& a, const NominalStart& b) { return a.mean_square < b.mean_square; });
  return starts;
}

}  // namespace crosstie::edge::detail
