// Distances from the epipolar curves by texture of the surface (scan/head_test.h).

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <optional>

#include <Eigen/Cholesky>

#include "scan/detail/rectification.h"
#include "scan/head_test.h"

namespace crosstie::scan {
namespace {

using base::PhaseMap;
using base::PhasePlane;

constexpr int kHalf = 12;          // of a patch [px]
constexpr int kPatches = 160;      // of the most texture
constexpr int kSpacing = 32;       // of the places where patches are looked for [px]
constexpr double kReach_px = 8.0;  // along the line of equal phase, to either side
constexpr double kStep_px = 0.5;
constexpr double kLeastCorrelation = 0.9;
constexpr double kMostSigma_px = 0.15;
constexpr std::size_t kLeastPixels = 300;  // of a patch

/// A value between four pixels; not a number where one of them is none.
double between(std::span<const float> plane, int width, int height, const Eigen::Vector2d& at) {
  const double x = std::floor(at.x());
  const double y = std::floor(at.y());
  if (!(x >= 0.0 && y >= 0.0 && x + 1.0 < width && y + 1.0 < height)) return std::nan("");
  const auto i = static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x);
  const auto w = static_cast<std::size_t>(width);
  const double u = at.x() - x;
  const double v = at.y() - y;
  return (1.0 - v) * ((1.0 - u) * static_cast<double>(plane[i]) + u * static_cast<double>(plane[i + 1])) +
         v * ((1.0 - u) * static_cast<double>(plane[i + w]) + u * static_cast<double>(plane[i + w + 1]));
}

/// How much the light changes from row to row about a pixel: what tells a distance from the curve.
double texture(const PhaseMap& map, int column, int row) {
  double sum = 0.0;
  double level = 0.0;
  for (int y = row - kHalf; y < row + kHalf; y += 2) {
    for (int x = column - kHalf; x < column + kHalf; x += 2) {
      const double change = static_cast<double>(map.light[map.at(x, y + 1)]) - static_cast<double>(map.light[map.at(x, y)]);
      sum += change * change;
      level += static_cast<double>(map.light[map.at(x, y)]);
    }
  }
  return level > 0.0 ? sum / level : 0.0;
}

/// A pixel of a patch: its light, where the right camera sees it on the curve, and the way from there along equal phase.
struct Seen {
  double light;
  Eigen::Vector2d right_px;
  Eigen::Vector2d along;  ///< right px per px off the curve
};

class Patch {
 public:
  Patch(const PhaseMap& left, const PhaseMap& right, const DepthMap& depths, const base::Head& head,
        const detail::Rectification& frame, int column, int row)
      : right_(right) {
    const PhasePlane& plane = right.x ? *right.x : *right.y;
    for (int y = row - kHalf; y <= row + kHalf; ++y) {
      for (int x = column - kHalf; x <= column + kHalf; ++x) {
        const float depth = depths.depth_mm[left.at(x, y)];
        if (std::isnan(depth)) continue;
        const auto ray = head.left.unproject(Eigen::Vector2d(x, y));
        if (!ray) continue;
        Eigen::Matrix<double, 2, 3> by_point;
        const Eigen::Vector3d p_in_right =
            head.right_from_left * Eigen::Vector3d(*ray * (static_cast<double>(depth) / ray->z()));
        const auto pixel = head.right.project(p_in_right, &by_point);
        if (!pixel) continue;
        // A pixel off the curve and one along it, in the right image; along equal phase both together.
        const double mm_per_px = p_in_right.z() / head.right.focal_px().mean();
        const Eigen::Vector2d off = by_point * frame.rectified_from_right.row(1).transpose() * mm_per_px;
        const Eigen::Vector2d on = by_point * frame.rectified_from_right.row(0).transpose() * mm_per_px;
        const double here = between(plane.turns, right.width, right.height, *pixel);
        const double by_off = between(plane.turns, right.width, right.height, *pixel + off) - here;
        const double by_on = between(plane.turns, right.width, right.height, *pixel + on) - here;
        if (!std::isfinite(by_off) || !std::isfinite(by_on) || std::abs(by_on) < 1e-9) continue;
        const double slant = -by_off / by_on;
        if (std::abs(slant) > 1.0) continue;
        seen_.push_back({left.light[left.at(x, y)], *pixel, off + slant * on});
      }
    }
  }

  struct Fit {
    double correlation = 0.0;
    double step_px = 0.0;  ///< by which a better place lies off this one
    double sigma_px = 0.0;
  };
  /// Both cameras' light where the right image is this far off the curve.
  [[nodiscard]] std::optional<Fit> at(double off_px) const {
    Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
    Eigen::Vector3d pull = Eigen::Vector3d::Zero();
    double squares = 0.0, sum = 0.0, count = 0.0;
    for (const Seen& pixel : seen_) {
      const Eigen::Vector2d place = pixel.right_px + off_px * pixel.along;
      const double light = between(right_.light, right_.width, right_.height, place);
      const double ahead = between(right_.light, right_.width, right_.height, place + kStep_px * pixel.along);
      const double behind = between(right_.light, right_.width, right_.height, place - kStep_px * pixel.along);
      if (!std::isfinite(light) || !std::isfinite(ahead) || !std::isfinite(behind)) continue;
      // left light = gain right light + offset + gain slope step
      const Eigen::Vector3d a(light, 1.0, (ahead - behind) / (2.0 * kStep_px));
      normal += a * a.transpose();
      pull += pixel.light * a;
      squares += pixel.light * pixel.light;
      sum += pixel.light;
      count += 1.0;
    }
    if (count < static_cast<double>(kLeastPixels)) return {};
    const double total = squares - sum * sum / count;
    if (!(total > 0.0)) return {};
    const Eigen::Matrix2d level = normal.topLeftCorner<2, 2>();
    const Eigen::Vector2d by_level = level.ldlt().solve(pull.head<2>());
    if (!(by_level(0) > 0.0)) return {};
    const Eigen::LDLT<Eigen::Matrix3d> ldlt(normal);
    const Eigen::Vector3d x = ldlt.solve(pull);
    const double rest = std::max(0.0, squares - pull.dot(x)) / (count - 3.0);
    Fit fit;
    fit.correlation = std::sqrt(std::max(0.0, 1.0 - (squares - pull.head<2>().dot(by_level)) / total));
    fit.step_px = x(2) / x(0);
    fit.sigma_px = std::sqrt(rest * ldlt.solve(Eigen::Vector3d::UnitZ())(2)) / std::abs(x(0));
    return fit;
  }

  /// Where both look most alike.
  [[nodiscard]] std::optional<std::pair<double, double>> best() const {
    double most = 0.0, at_px = 0.0;
    for (double off = -kReach_px; off <= kReach_px; off += kStep_px) {
      const auto fit = at(off);
      if (!fit || fit->correlation <= most) continue;
      most = fit->correlation;
      at_px = off;
    }
    if (most < kLeastCorrelation || std::abs(at_px) > kReach_px - 1.0) return {};
    std::optional<Fit> fit;
    for (int round = 0; round < 3; ++round) {
      fit = at(at_px);
      if (!fit || !(std::abs(fit->step_px) < 1.0)) return {};
      at_px += fit->step_px;
    }
    if (!(fit->sigma_px < kMostSigma_px)) return {};
    return std::pair{at_px, fit->sigma_px};
  }

 private:
  const PhaseMap& right_;
  std::vector<Seen> seen_;
};

}  // namespace

base::Result<std::vector<CurveSample>> texture_samples(const PhaseMap& left, const PhaseMap& right, const DepthMap& depths,
                                                       const base::Head& head) {
  const auto frame = detail::rectify(head.right_from_left);
  if (!frame) return tl::unexpected(frame.error());
  struct Candidate {
    int column, row;
    double texture;
  };
  std::vector<Candidate> candidates;
  for (int row = kHalf + 1; row + kHalf + 2 < left.height; row += kSpacing) {
    for (int column = kHalf + 1; column + kHalf + 2 < left.width; column += kSpacing) {
      if (std::isnan(depths.depth_mm[left.at(column, row)])) continue;
      candidates.push_back({column, row, texture(left, column, row)});
    }
  }
  std::stable_sort(candidates.begin(), candidates.end(), [](const auto& a, const auto& b) { return a.texture > b.texture; });
  if (candidates.size() > kPatches) candidates.resize(kPatches);
  std::vector<CurveSample> samples;
  for (const Candidate& candidate : candidates) {
    const Patch patch(left, right, depths, head, *frame, candidate.column, candidate.row);
    const auto best = patch.best();
    if (!best) continue;
    CurveSample sample;
    sample.left_px = {candidate.column, candidate.row};
    const auto ray = head.left.unproject(sample.left_px);
    if (!ray) continue;
    sample.p_in_rig_mm = *ray * (static_cast<double>(depths.depth_mm[left.at(candidate.column, candidate.row)]) / ray->z());
    sample.off_px = best->first;
    sample.sigma_px = best->second;
    samples.push_back(sample);
  }
  return samples;
}

}  // namespace crosstie::scan
