#include "bundle/detail/dot_group.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <Eigen/LU>

#include "math/median.h"

namespace crosstie::bundle::detail {
namespace {

constexpr double kGate1 = 15.137;      // chi-square of one degree of freedom at 1 - 1e-4
constexpr double kGate2 = 18.421;      // of two
constexpr double kSizeShare = 0.15;    // by which radii of one target may differ
constexpr double kSizeSigmas = 4.0;    // and sigmas of a semi-axis, which is known as well as the centre
constexpr double kOthersShare = 0.25;  // of hits that may be dots with ids before a place counts as a marker's

const View& view_of(const DotScene& scene, const Dot& dot) { return *scene.views[static_cast<std::size_t>(dot.image)]; }

const Dot& dot_at(const DotScene& scene, int dot) { return scene.dots[static_cast<std::size_t>(dot)]; }

/// What a place shows in one image.
struct Hits {
  int count = 0;  ///< dots within the gate
  int dot = -1;   ///< the one, where there is one
  bool has_id = false;
};

Hits hits_in(const DotScene& scene, std::size_t image, const Sight& sight, const Eigen::Matrix3d& cov_mm2) {
  const Eigen::Matrix2d cov = sight.jacobian * cov_mm2 * sight.jacobian.transpose();
  const double dot_px = scene.grids[image].largest_sigma_px();
  const Eigen::Vector2d reach = (kGate2 * (cov.diagonal().array() + dot_px * dot_px)).sqrt();
  Hits hits;
  scene.grids[image].in_box(sight.pixel - reach, sight.pixel + reach, [&](int d) {
    const Dot& dot = dot_at(scene, d);
    const Eigen::Vector2d off = dot.centre_px - sight.pixel;
    if (!(off.cwiseAbs().array() <= reach.array()).all()) return;
    if (off.dot((cov + dot.cov_px2).ldlt().solve(off)) > kGate2) return;
    ++hits.count;
    hits.dot = d;
    hits.has_id = hits.has_id || dot.has_id;
  });
  return hits;
}

/// Whether a marker with an id lies over a place: nearer than its own radius, where no other target can be. A ring that is half
/// hidden may give a centre that is off by more than any gate, yet it is still that marker's.
bool is_under_marker(const DotScene& scene, std::size_t image, const Eigen::Vector2d& pixel) {
  const Eigen::Vector2d reach = Eigen::Vector2d::Constant(scene.grids[image].largest_size_px());
  bool found = false;
  scene.grids[image].in_box(pixel - reach, pixel + reach, [&](int d) {
    const Dot& dot = dot_at(scene, d);
    found = found || (dot.has_id && (dot.centre_px - pixel).norm() < dot.size_px);
  });
  return found;
}

/// Drops the dots whose size is not that of the others; sets the group's.
void judge_sizes(const DotScene& scene, DotGroup& group) {
  std::vector<double> radii;
  std::vector<double> known;
  for (const int d : group.dots) {
    radii.push_back(radius_mm(view_of(scene, dot_at(scene, d)), dot_at(scene, d), group.place.point));
    if (radii.back() > 0.0) known.push_back(radii.back());
  }
  group.radius_mm = math::median(known);
  if (known.empty()) return;
  std::vector<int> kept;
  for (std::size_t i = 0; i < radii.size(); ++i) {
    const Dot& dot = dot_at(scene, group.dots[i]);
    if (radii[i] == 0.0 || same_size(radii[i], dot, group.radius_mm, dot)) kept.push_back(group.dots[i]);
  }
  group.dots = std::move(kept);
}

/// All images anew with a place that is known well. False where the place is that of markers with ids.
bool gather(const DotScene& scene, DotGroup& group) {
  group.dots.clear();
  group.visible = 0;
  int others = 0;
  for (std::size_t i = 0; i < scene.views.size(); ++i) {
    if (!scene.views[i]) continue;
    const auto sight = see(*scene.views[i], group.place.point);
    if (!sight) continue;
    ++group.visible;
    const Hits hits = hits_in(scene, i, *sight, group.place.cov_mm2);
    if (hits.has_id || is_under_marker(scene, i, sight->pixel)) {
      ++others;
    } else if (hits.count == 1) {
      group.dots.push_back(hits.dot);
    }
  }
  judge_sizes(scene, group);
  const auto all = static_cast<double>(group.dots.size()) + others;
  return others <= kOthersShare * all;
}

}  // namespace

std::optional<Place> locate(const DotScene& scene, std::span<const int> dots, const Eigen::Vector3d& start) {
  constexpr int kMaxSteps = 12;
  constexpr double kSettled = 1e-6;  // of the step's length in sigmas, squared
  Place place;
  place.point = start;
  for (int step = 0; step < kMaxSteps; ++step) {
    Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
    Eigen::Vector3d right = Eigen::Vector3d::Zero();
    place.square_sum = 0.0;
    for (const int d : dots) {
      const Dot& dot = dot_at(scene, d);
      const auto sight = see(view_of(scene, dot), place.point);
      if (!sight) return {};
      const Eigen::Matrix2d weight = dot.cov_px2.inverse();
      const Eigen::Vector2d off = dot.centre_px - sight->pixel;
      normal += sight->jacobian.transpose() * weight * sight->jacobian;
      right += sight->jacobian.transpose() * (weight * off);
      place.square_sum += off.dot(weight * off);
    }
    const Eigen::LLT<Eigen::Matrix3d> factor(normal);
    if (factor.info() != Eigen::Success) return {};
    const Eigen::Vector3d move = factor.solve(right);
    place.point += move;
    if (!place.point.allFinite()) return {};
    if (move.dot(normal * move) > kSettled) continue;
    place.square_sum = std::max(0.0, place.square_sum - right.dot(move));
    place.cov_mm2 = factor.solve(Eigen::Matrix3d::Identity());
    return place;
  }
  return {};
}

double radius_mm(const View& view, const Dot& dot, const Eigen::Vector3d& point, double* cos_tilt) {
  if (!(dot.size_px > 0.0)) return 0.0;
  const auto sight = see(view, point);
  if (!sight) return 0.0;
  const Eigen::Vector3d along = (point - view.centre).normalized();
  Eigen::Matrix<double, 3, 2> across;
  across.col(0) = along.unitOrthogonal();
  across.col(1) = along.cross(across.col(0));
  const Eigen::Matrix2d mm_per_px = (sight->jacobian * across).inverse();
  const Eigen::Matrix2d shape_mm2 = mm_per_px * dot.shape_px2 * mm_per_px.transpose();
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> axes(shape_mm2);
  if (!(axes.eigenvalues()(0) > 0.0)) return 0.0;
  if (cos_tilt != nullptr) *cos_tilt = std::sqrt(axes.eigenvalues()(0) / axes.eigenvalues()(1));
  return std::sqrt(axes.eigenvalues()(1));
}

bool same_size(double radius_a, const Dot& a, double radius_b, const Dot& b) {
  if (radius_a == 0.0 || radius_b == 0.0) return true;
  const auto share = [](const Dot& dot) { return 0.5 * dot.cov_px2.trace() / (dot.size_px * dot.size_px); };
  const double tolerance = kSizeShare + kSizeSigmas * std::sqrt(share(a) + share(b));
  return std::abs(std::log(radius_a / radius_b)) < tolerance;
}

std::optional<DotGroup> grow(const DotScene& scene, int dot_a, int dot_b, double distance_from_a_mm, double min_angle_rad) {
  const Dot& a = dot_at(scene, dot_a);
  const Dot& b = dot_at(scene, dot_b);
  const int pair[] = {dot_a, dot_b};
  auto place = locate(scene, pair, view_of(scene, a).centre + distance_from_a_mm * a.direction);
  if (!place || place->square_sum > kGate1) return {};
  if (angle_at(place->point, view_of(scene, a), view_of(scene, b)) < min_angle_rad) return {};
  const double radius_a = radius_mm(view_of(scene, a), a, place->point);
  if (!same_size(radius_a, a, radius_mm(view_of(scene, b), b, place->point), b)) return {};

  // Image by image; the place is known better with each (its normal equations are added to).
  std::vector<int> rays = {dot_a, dot_b};
  Eigen::Matrix3d normal = place->cov_mm2.inverse();
  for (std::size_t i = 0; i < scene.views.size(); ++i) {
    if (!scene.views[i] || static_cast<int>(i) == a.image || static_cast<int>(i) == b.image) continue;
    const auto sight = see(*scene.views[i], place->point);
    if (!sight) continue;
    const Hits hits = hits_in(scene, i, *sight, place->cov_mm2);
    if (hits.count != 1 || hits.has_id) continue;
    const Dot& dot = dot_at(scene, hits.dot);
    if (!same_size(radius_a, a, radius_mm(*scene.views[i], dot, place->point), dot)) continue;
    const Eigen::Matrix2d weight = dot.cov_px2.inverse();
    normal += sight->jacobian.transpose() * weight * sight->jacobian;
    place->cov_mm2 = normal.inverse();
    place->point += place->cov_mm2 * (sight->jacobian.transpose() * (weight * (dot.centre_px - sight->pixel)));
    rays.push_back(hits.dot);
  }
  if (rays.size() < 3) return {};

  DotGroup group;
  group.dots = std::move(rays);
  for (int pass = 0; pass < 2; ++pass) {
    const auto better = locate(scene, group.dots, place->point);
    if (!better) return {};
    group.place = *better;
    place = better;
    if (!gather(scene, group) || group.dots.size() < 3) return {};
  }
  const auto last = locate(scene, group.dots, group.place.point);
  if (!last) return {};
  group.place = *last;
  const auto holds = [&](int dot) { return std::find(group.dots.begin(), group.dots.end(), dot) != group.dots.end(); };
  if (!holds(dot_a) || !holds(dot_b)) return {};
  return group;
}

int count_directions(const DotScene& scene, std::span<const int> dots, const Eigen::Vector3d& point, double least_rad) {
  std::vector<const View*> apart;
  for (const int d : dots) {
    const View& view = view_of(scene, dot_at(scene, d));
    const bool is_new =
        std::all_of(apart.begin(), apart.end(), [&](const View* other) { return angle_at(point, view, *other) >= least_rad; });
    if (is_new) apart.push_back(&view);
  }
  return static_cast<int>(apart.size());
}

}  // namespace crosstie::bundle::detail
