#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

#include "verify/detail/box_tree.h"
#include "verify/detail/surface_reference.h"

namespace crosstie::verify::detail {
namespace {

constexpr std::size_t kNeighbours = 20;
constexpr std::size_t kLeast = 4;
constexpr std::size_t kLeastCurved = 10;  // points that carry the six values of a curved surface; fewer give a plane
constexpr double kThin = 0.05;            // of the larger spread: points along a line tell no curvature across it
/// At a border the neighbours lie on one side: their mean is off the foot by more than this share of their spread (0.64 for a half
/// disc's mean over its radius, near 0.15 for twenty points all round).
constexpr double kOneSided = 0.45;

class CloudReference final : public SurfaceReference {
 public:
  explicit CloudReference(const base::Cloud& cloud) : cloud_(cloud), tree_(boxes(cloud)) {}

  std::optional<SurfaceFoot> foot(const Eigen::Vector3d& p, const Eigen::Vector3d& side, double gate_mm) const override {
    const auto& points = cloud_.points;
    const auto hits = tree_.nearest(p, kNeighbours, HUGE_VAL, [&](std::size_t i) { return (points[i] - p).squaredNorm(); });
    if (hits.size() < kLeast) return std::nullopt;
    Eigen::Vector3d mean = Eigen::Vector3d::Zero();
    Eigen::Vector3d known = Eigen::Vector3d::Zero();
    for (const auto& hit : hits) {
      mean += points[hit.index] / static_cast<double>(hits.size());
      if (!cloud_.normals.empty()) known += cloud_.normals[hit.index];
    }
    Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
    for (const auto& hit : hits) scatter += (points[hit.index] - mean) * (points[hit.index] - mean).transpose();
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(scatter);
    const double spread = std::sqrt((eigen.eigenvalues()(1) + eigen.eigenvalues()(2)) / static_cast<double>(hits.size()));
    const Eigen::Vector3d off = p - mean;
    const double sideways = (off - off.dot(eigen.eigenvectors().col(0)) * eigen.eigenvectors().col(0)).norm();
    if (sideways > gate_mm + 2.0 * spread) return std::nullopt;

    SurfaceFoot foot;
    foot.normal = eigen.eigenvectors().col(0);
    foot.signed_mm = foot.normal.dot(off);
    if (hits.size() >= kLeastCurved && eigen.eigenvalues()(1) > kThin * kThin * eigen.eigenvalues()(2)) {
      follow_curve(hits, p, eigen.eigenvectors(), spread, foot);
    }
    const Eigen::Vector3d outside = !known.isZero(0.0) ? known : !side.isZero(0.0) ? side : p;
    if (foot.normal.dot(outside) < 0.0) {
      foot.normal = -foot.normal;
      foot.signed_mm = -foot.signed_mm;
    }
    foot.point = p - foot.signed_mm * foot.normal;
    if (std::abs(foot.signed_mm) > gate_mm) return std::nullopt;
    foot.on_border = sideways > kOneSided * spread * std::sqrt(2.0);
    return foot;
  }

 private:
  /// Distance and normal by a polynomial of second order in the neighbours' heights over their plane, about the place below p: the
  /// plane itself lies a chord's height beside every curved surface. `axes`: the plane's normal, then two directions in it.
  void follow_curve(const std::vector<BoxTree::Hit>& hits, const Eigen::Vector3d& p, const Eigen::Matrix3d& axes, double spread,
                    SurfaceFoot& foot) const {
    using Vector6d = Eigen::Matrix<double, 6, 1>;
    Eigen::Matrix<double, 6, 6> normal = Eigen::Matrix<double, 6, 6>::Zero();
    Vector6d right = Vector6d::Zero();
    for (const auto& hit : hits) {
      const Eigen::Vector3d local = axes.transpose() * (cloud_.points[hit.index] - p) / spread;
      const Vector6d row{1.0, local.y(), local.z(), local.y() * local.y(), local.y() * local.z(), local.z() * local.z()};
      normal += row * row.transpose();
      right += row * local.x();
    }
    const Vector6d fit = normal.ldlt().solve(right);
    if (!fit.allFinite()) return;
    const Eigen::Vector3d upright(1.0, -fit(1), -fit(2));
    foot.normal = axes * upright.normalized();
    foot.signed_mm = -fit(0) * spread / upright.norm();
  }

  static std::vector<Box> boxes(const base::Cloud& cloud) {
    std::vector<Box> all(cloud.points.size());
    for (std::size_t i = 0; i < all.size(); ++i) all[i].add(cloud.points[i]);
    return all;
  }
  const base::Cloud& cloud_;
  BoxTree tree_;
};

}  // namespace

std::unique_ptr<SurfaceReference> cloud_reference(const base::Cloud& cloud) { return std::make_unique<CloudReference>(cloud); }

}  // namespace crosstie::verify::detail
