#include "verify/surface.h"

#include <algorithm>
#include <cmath>
#include <type_traits>

#include <fmt/core.h>
#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>

#include "math/median.h"
#include "verify/detail/box_tree.h"
#include "verify/detail/surface_reference.h"

namespace crosstie::verify {
namespace {

using base::Cloud;
using base::ErrorCode;
using base::fail;
using base::Result;
using base::SurfaceDeviations;
using detail::SurfaceFoot;
using detail::SurfaceReference;

constexpr int kMaxIterations = 40;
constexpr double kWeak = 1e-3;      // of the largest eigenvalue: the surface does not hold that direction
constexpr double kOutlier = 4.0;    // of the robust scatter
constexpr double kNormal = 1.4826;  // median absolute deviation to sigma
constexpr std::size_t kFitPoints = 20000;

/// Every so many points, in their order.
std::vector<std::size_t> chosen(std::size_t all, std::size_t most) {
  const std::size_t every = std::max<std::size_t>(1, (all + most - 1) / most);
  std::vector<std::size_t> indices;
  for (std::size_t i = 0; i < all; i += every) indices.push_back(i);
  return indices;
}

Eigen::Vector3d side_of(const Cloud& cloud, std::size_t i, const base::Pose& pose) {
  return cloud.normals.empty() ? Eigen::Vector3d(Eigen::Vector3d::Zero()) : Eigen::Vector3d(pose.rotation * cloud.normals[i]);
}

std::string name_of(const Eigen::Matrix<double, 6, 1>& direction) {
  const bool turn = direction.head<3>().norm() > direction.tail<3>().norm();
  Eigen::Vector3d v = (turn ? direction.head<3>() : direction.tail<3>()).normalized();
  Eigen::Index largest = 0;
  v.cwiseAbs().maxCoeff(&largest);
  if (v(largest) < 0.0) v = -v;
  return fmt::format("{} ({:.2f}, {:.2f}, {:.2f})", turn ? "turn about" : "shift along", v.x(), v.y(), v.z());
}

/// Point-to-plane least squares, matched anew until nothing moves (an ICP), in scaled unknowns about the points' centroid.
void lay_onto(const Cloud& measured, const SurfaceReference& reference, const SurfaceOptions& options,
              const base::Progress& progress, SurfaceDeviations& result) {
  const auto indices = chosen(measured.points.size(), kFitPoints);
  base::Pose& pose = result.reference_from_measured;
  for (result.iterations = 0; result.iterations < kMaxIterations && !progress.cancelled(); ++result.iterations) {
    std::vector<SurfaceFoot> feet;
    std::vector<double> sizes;
    Eigen::Vector3d centre = Eigen::Vector3d::Zero();
    for (const std::size_t i : indices) {
      const auto foot = reference.foot(pose * measured.points[i], side_of(measured, i, pose), options.gate_mm);
      if (!foot || foot->on_border) continue;
      feet.push_back(*foot);
      sizes.push_back(std::abs(foot->signed_mm));
      centre += foot->point;
    }
    if (feet.size() < 6) return;
    centre /= static_cast<double>(feet.size());
    double lever = 0.0;
    for (const auto& foot : feet) lever += (foot.point - centre).squaredNorm();
    lever = std::sqrt(lever / static_cast<double>(feet.size()));
    const double limit = kOutlier * kNormal * math::median(sizes) + 1e-9;
    Eigen::Matrix<double, 6, 6> normal = Eigen::Matrix<double, 6, 6>::Zero();
    Eigen::Matrix<double, 6, 1> right = Eigen::Matrix<double, 6, 1>::Zero();
    double used = 0.0;
    for (const auto& foot : feet) {
      if (std::abs(foot.signed_mm) > limit) continue;
      Eigen::Matrix<double, 6, 1> row;
      row << (foot.point - centre).cross(foot.normal) / lever, foot.normal;
      normal += row * row.transpose();
      right -= foot.signed_mm * row;
      used += 1.0;
    }
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix<double, 6, 6>> eigen(normal / used);
    Eigen::Matrix<double, 6, 1> step = Eigen::Matrix<double, 6, 1>::Zero();
    result.held.clear();
    for (Eigen::Index k = 0; k < 6; ++k) {
      const Eigen::Matrix<double, 6, 1> direction = eigen.eigenvectors().col(k);
      if (eigen.eigenvalues()(k) < kWeak * eigen.eigenvalues()(5)) {
        result.held.push_back(name_of(direction));
      } else {
        step += direction * (direction.dot(right / used) / eigen.eigenvalues()(k));
      }
    }
    base::Vector6d about;
    about << step.head<3>() / lever, step.tail<3>();
    base::Pose to_centre;
    to_centre.translation_mm = centre;
    pose = to_centre * base::perturbed({}, about) * to_centre.inverse() * pose;
    if (step.norm() < 1e-6) return;
  }
}

void summarise(SurfaceDeviations& result, const std::vector<double>& sigmas) {
  const auto n = static_cast<double>(result.deviations_mm.size());
  result.count = result.deviations_mm.size();
  double sum = 0.0;
  double squares = 0.0;
  std::vector<double> sizes;
  std::size_t inside = 0;
  for (const double d : result.deviations_mm) {
    sum += d;
    squares += d * d;
    sizes.push_back(std::abs(d));
    if (std::abs(d) <= result.tolerance_mm) ++inside;
  }
  result.mean_mm = sum / n;
  result.rms_mm = std::sqrt(squares / n);
  double about_mean = 0.0;
  for (const double d : result.deviations_mm) about_mean += (d - result.mean_mm) * (d - result.mean_mm);
  result.sigma_mm = n > 1.0 ? std::sqrt(about_mean / (n - 1.0)) : 0.0;
  std::sort(sizes.begin(), sizes.end());
  result.p95_mm = sizes[static_cast<std::size_t>(std::ceil(0.95 * n)) - 1];
  result.max_mm = sizes.back();
  result.in_tolerance = static_cast<double>(inside) / n;
  if (sigmas.size() == result.deviations_mm.size()) {
    double normalised = 0.0;
    for (std::size_t i = 0; i < sigmas.size(); ++i) normalised += std::pow(result.deviations_mm[i] / sigmas[i], 2);
    result.normalised_rms = std::sqrt(normalised / n);
  }
}

Result<SurfaceDeviations> compare_with(const Cloud& measured, const SurfaceReference& reference, std::string name,
                                       const SurfaceOptions& options, const base::Progress& progress) {
  if (auto good = options.validate(); !good) return fail(std::move(good));
  if (measured.points.empty()) return fail(ErrorCode::kBadInput, "the measured cloud has no points");
  SurfaceDeviations result;
  result.reference = std::move(name);
  result.gate_mm = options.gate_mm;
  result.tolerance_mm = options.tolerance_mm;
  result.reference_from_measured = options.reference_from_measured;
  result.best_fit = options.best_fit;
  if (options.best_fit) lay_onto(measured, reference, options, progress, result);
  if (progress.cancelled()) return base::cancelled("the comparison of surfaces");
  const base::Pose& pose = result.reference_from_measured;
  std::vector<double> sigmas;
  for (const std::size_t i : chosen(measured.points.size(), options.max_points)) {
    const Eigen::Vector3d p = pose * measured.points[i];
    const auto foot = reference.foot(p, side_of(measured, i, pose), options.gate_mm);
    if (!foot) {
      ++result.too_far;
      continue;
    }
    if (foot->on_border) {
      ++result.beyond_border;
      continue;
    }
    result.points.push_back(p);
    result.deviations_mm.push_back(foot->signed_mm);
    if (measured.cov_mm2.empty()) continue;
    const Eigen::Vector3d n = pose.rotation.conjugate() * foot->normal;
    const double variance = n.dot(measured.cov_mm2[i] * n);
    if (variance > 0.0) sigmas.push_back(std::sqrt(variance));
  }
  if (result.points.empty()) {
    return fail(
        ErrorCode::kBadInput,
        fmt::format("none of the measured points is within {} mm of the reference surface: are both in one frame and unit?",
                    options.gate_mm));
  }
  summarise(result, sigmas);
  return result;
}

/// A shape's own distance and normal.
template <typename Shape>
class ShapeReference final : public SurfaceReference {
 public:
  explicit ShapeReference(const Shape& shape) : shape_(shape) {}
  std::optional<SurfaceFoot> foot(const Eigen::Vector3d& p, const Eigen::Vector3d& side, double gate_mm) const override {
    (void)side;
    SurfaceFoot foot;
    foot.signed_mm = math::signed_distance_mm(shape_, p);
    if (std::abs(foot.signed_mm) > gate_mm) return std::nullopt;
    const Eigen::Vector3d off = p - shape_.point_mm;
    const Eigen::Vector3d radial = (off - shape_.direction.dot(off) * shape_.direction).normalized();
    foot.normal = radial;
    if constexpr (std::is_same_v<Shape, math::Cone>) {
      foot.normal = std::cos(shape_.half_angle_rad) * radial - std::sin(shape_.half_angle_rad) * shape_.direction;
    }
    foot.point = p - foot.signed_mm * foot.normal;
    return foot;
  }

 private:
  Shape shape_;
};

}  // namespace

Result<> SurfaceOptions::validate() const {
  if (!(tolerance_mm > 0.0) || !(gate_mm > 0.0) || !std::isfinite(gate_mm)) {
    return fail(ErrorCode::kUsage,
                fmt::format("a tolerance of {} mm and a gate of {} mm; both are positive", tolerance_mm, gate_mm));
  }
  if (max_points == 0) return fail(ErrorCode::kUsage, "max_points is positive");
  return {};
}

Result<SurfaceDeviations> compare_surface(const Cloud& measured, const base::Mesh& reference, const SurfaceOptions& options,
                                          const base::Progress& progress) {
  if (reference.vertices.points.empty()) return fail(ErrorCode::kBadInput, "the reference surface has no points");
  const bool is_mesh = !reference.triangles.empty();
  const auto surface = is_mesh ? detail::mesh_reference(reference) : detail::cloud_reference(reference.vertices);
  return compare_with(measured, *surface, is_mesh ? "mesh" : "cloud", options, progress);
}

Result<SurfaceDeviations> compare_surface(const Cloud& measured, const math::Cylinder& reference,
                                          const SurfaceOptions& options) {
  return compare_with(measured, ShapeReference(reference), "cylinder", options, {});
}

Result<SurfaceDeviations> compare_surface(const Cloud& measured, const math::Cone& reference, const SurfaceOptions& options) {
  return compare_with(measured, ShapeReference(reference), "cone", options, {});
}

Result<base::EdgeVerification> compare_edge(const base::EdgeCurve& measured, const base::EdgeCurve& reference, double gate_mm) {
  const auto& along = reference.points;
  if (along.size() < 2 || measured.points.empty()) return fail(ErrorCode::kBadInput, "a rim without points cannot be compared");
  const std::size_t segments = reference.closed ? along.size() : along.size() - 1;
  std::vector<detail::Box> boxes(segments);
  for (std::size_t i = 0; i < segments; ++i) {
    boxes[i].add(along[i].point_mm);
    boxes[i].add(along[(i + 1) % along.size()].point_mm);
  }
  const detail::BoxTree tree(boxes);
  base::EdgeVerification result;
  std::vector<double> distances;
  double squares = 0.0;
  double normalised = 0.0;
  for (const base::EdgePoint& p : measured.points) {
    const auto share = [&](std::size_t i) {
      const Eigen::Vector3d a = along[i].point_mm;
      const Eigen::Vector3d ab = along[(i + 1) % along.size()].point_mm - a;
      return std::clamp((p.point_mm - a).dot(ab) / ab.squaredNorm(), 0.0, 1.0);
    };
    const auto place = [&](std::size_t i) -> Eigen::Vector3d {
      return along[i].point_mm + share(i) * (along[(i + 1) % along.size()].point_mm - along[i].point_mm);
    };
    const auto hits =
        tree.nearest(p.point_mm, 1, gate_mm * gate_mm, [&](std::size_t i) { return (place(i) - p.point_mm).squaredNorm(); });
    if (hits.empty()) continue;
    const std::size_t i = hits[0].index;
    const std::size_t next = (i + 1) % along.size();
    const double t = share(i);
    const bool past_end = !reference.closed && ((i == 0 && t <= 0.0) || (i + 1 == segments && t >= 1.0));
    if (past_end) continue;
    const Eigen::Vector3d tangent = (along[next].point_mm - along[i].point_mm).normalized();
    Eigen::Vector3d normal = (1.0 - t) * along[i].normal + t * along[next].normal;
    normal = (normal - normal.dot(tangent) * tangent).normalized();
    const Eigen::Vector3d off = p.point_mm - place(i);
    const double u = off.dot(normal.cross(tangent));
    const double v = off.dot(normal);
    const auto sigma = [&](double own, double first, double second) {
      return std::sqrt(own * own + std::pow((1.0 - t) * first, 2) + std::pow(t * second, 2));
    };
    result.s_mm.push_back(along[i].s_mm + t * (along[next].point_mm - along[i].point_mm).norm());
    result.u_mm.push_back(u);
    result.v_mm.push_back(v);
    result.sigma_u_mm.push_back(sigma(p.sigma_u_mm, along[i].sigma_u_mm, along[next].sigma_u_mm));
    result.sigma_v_mm.push_back(sigma(p.sigma_v_mm, along[i].sigma_v_mm, along[next].sigma_v_mm));
    distances.push_back(std::hypot(u, v));
    squares += u * u + v * v;
    if (result.sigma_u_mm.back() > 0.0 && result.sigma_v_mm.back() > 0.0) {
      normalised += std::pow(u / result.sigma_u_mm.back(), 2) + std::pow(v / result.sigma_v_mm.back(), 2);
    }
  }
  if (distances.empty()) {
    return fail(ErrorCode::kBadInput, fmt::format("no point of the rim is within {} mm of the reference rim", gate_mm));
  }
  const auto n = static_cast<double>(distances.size());
  std::sort(distances.begin(), distances.end());
  result.count = distances.size();
  result.rms_mm = std::sqrt(squares / n);
  result.p95_mm = distances[static_cast<std::size_t>(std::ceil(0.95 * n)) - 1];
  result.max_mm = distances.back();
  result.normalised_rms = std::sqrt(normalised / (2.0 * n));
  return result;
}

}  // namespace crosstie::verify
