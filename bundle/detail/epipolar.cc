#include "bundle/detail/epipolar.h"

#include <algorithm>
#include <cmath>
#include <optional>

namespace crosstie::bundle::detail {
namespace {

constexpr double kChord_px = 24.0;  // the sagitta of distortions that are in use is some thousandths of a pixel on that
constexpr int kFirstPieces = 4;
constexpr int kDeepest = 9;         // bisections of a piece
constexpr double kNearest = 0.02;   // of the region's radius: nearer to a camera no target is looked for
constexpr double kSigmas = 4.5;     // of what is near; the exact test follows
constexpr double kMagnified = 2.0;  // how much larger the seed's error may appear in the other image

/// A point of the curve, by the reciprocal of its distance from the seed's camera.
struct CurvePoint {
  double reciprocal = 0.0;
  std::optional<Eigen::Vector2d> pixel;
};

class Curve {
 public:
  Curve(const View& from, const Dot& seed, const View& to, const DotGrid& grid, const std::vector<Dot>& dots)
      : from_(from), seed_(seed), to_(to), grid_(grid), dots_(dots) {
    const double seed_px = std::sqrt(seed.cov_px2.trace());
    near_px_ = kSigmas * (grid.largest_sigma_px() + kMagnified * seed_px);
  }

  [[nodiscard]] CurvePoint at(double reciprocal) const {
    const Eigen::Vector3d point = from_.centre + seed_.direction / reciprocal;
    return {reciprocal, to_.camera.project(to_.camera_from_network * point)};
  }

  void follow(const CurvePoint& a, const CurvePoint& b, int depth) {
    if (!a.pixel && !b.pixel && depth > 2) return;
    const bool both = a.pixel && b.pixel;
    if (both && (*a.pixel - *b.pixel).norm() <= kChord_px) return visit(a, b);
    if (depth == kDeepest) return;
    if (both && depth > 0 && outside(*a.pixel, *b.pixel)) return;
    const CurvePoint middle = at(0.5 * (a.reciprocal + b.reciprocal));
    follow(a, middle, depth + 1);
    follow(middle, b, depth + 1);
  }

  std::vector<Crossing> take() {
    std::sort(found_.begin(), found_.end(), [](const Crossing& a, const Crossing& b) { return a.dot < b.dot; });
    found_.erase(std::unique(found_.begin(), found_.end(), [](const Crossing& a, const Crossing& b) { return a.dot == b.dot; }),
                 found_.end());
    return std::move(found_);
  }

 private:
  /// Both ends beyond the same side of the image, by more than a bent curve could come back.
  [[nodiscard]] bool outside(const Eigen::Vector2d& a, const Eigen::Vector2d& b) const {
    const double margin = near_px_ + 0.25 * (a - b).norm();
    return std::max(a.x(), b.x()) < -margin || std::max(a.y(), b.y()) < -margin ||
           std::min(a.x(), b.x()) > to_.camera.width_px() + margin || std::min(a.y(), b.y()) > to_.camera.height_px() + margin;
  }

  void visit(const CurvePoint& a, const CurvePoint& b) {
    const Eigen::Vector2d along = *b.pixel - *a.pixel;
    const double length = along.norm();
    const Eigen::Vector2d direction = length > 0.0 ? Eigen::Vector2d(along / length) : Eigen::Vector2d(1.0, 0.0);
    const Eigen::Vector2d margin = Eigen::Vector2d::Constant(near_px_);
    grid_.in_box(a.pixel->cwiseMin(*b.pixel) - margin, a.pixel->cwiseMax(*b.pixel) + margin, [&](int d) {
      const Dot& dot = dots_[static_cast<std::size_t>(d)];
      if (dot.has_id) return;
      const Eigen::Vector2d offset = dot.centre_px - *a.pixel;
      const double forth = offset.dot(direction);
      const double aside = std::abs(direction.x() * offset.y() - direction.y() * offset.x());
      if (aside > near_px_ || forth < -near_px_ || forth > length + near_px_) return;
      const double share = length > 0.0 ? std::clamp(forth / length, 0.0, 1.0) : 0.0;
      found_.push_back({d, 1.0 / (a.reciprocal + share * (b.reciprocal - a.reciprocal))});
    });
  }

  const View& from_;
  const Dot& seed_;
  const View& to_;
  const DotGrid& grid_;
  const std::vector<Dot>& dots_;
  double near_px_ = 0.0;
  std::vector<Crossing> found_;
};

}  // namespace

std::vector<Crossing> crossings(const View& from, const Dot& seed, const View& to, const DotGrid& grid,
                                const std::vector<Dot>& dots, const Region& region) {
  // Where the ray enters and leaves the region.
  const Eigen::Vector3d to_centre = region.centre - from.centre;
  const double middle = to_centre.dot(seed.direction);
  const double half_square = region.radius_mm * region.radius_mm - (to_centre - middle * seed.direction).squaredNorm();
  if (!(half_square > 0.0)) return {};
  const double half = std::sqrt(half_square);
  const double nearest = std::max(middle - half, kNearest * region.radius_mm);
  if (!(middle + half > nearest)) return {};
  const double high = 1.0 / nearest;
  const double low = 1.0 / (middle + half);

  Curve curve(from, seed, to, grid, dots);
  CurvePoint before = curve.at(low);
  for (int piece = 1; piece <= kFirstPieces; ++piece) {
    const CurvePoint next = curve.at(low + (high - low) * piece / kFirstPieces);
    curve.follow(before, next, 0);
    before = next;
  }
  return curve.take();
}

}  // namespace crosstie::bundle::detail
