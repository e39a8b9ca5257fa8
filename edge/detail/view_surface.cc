#include "edge/detail/view_surface.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include <Eigen/Cholesky>

#include "math/median.h"

namespace crosstie::edge::detail {
namespace {

constexpr float kNowhere = std::numeric_limits<float>::quiet_NaN();
constexpr int kLeastDepths = 40;
// By there, from the guard on, the surface must have begun, or the edge is not its own: one line of pixels along the edge suffices, since a scan leaves
// out pixels beside the ends of phases in either camera; a far rim that is seen through the hole lies farther off.
constexpr int kBegin_px = 2;
constexpr double kBeginShare = 0.5;  // of the pixels of a line along the edge where it has begun
constexpr double kHalfWidth = 0.6;   // along the edge, of the reach across it
constexpr int kRounds = 6;
constexpr double kTukey = 4.7;

constexpr int kTerms = 6;
using Row = Eigen::Matrix<double, kTerms, 1>;
using Square = Eigen::Matrix<double, kTerms, kTerms>;

/// The depth of a pixel on the material side of an edge.
struct Depth {
  Eigen::Vector2d tangent = Eigen::Vector2d::Zero();  // X/Z, Y/Z
  double z = 0.0;
  double sigma_z = 0.0;
  double q = 0.0, s = 0.0;  // from the edge, across and along [px]
};

/// value = row . unknowns
struct Observation {
  Row row;
  double value = 0.0;
  double sigma = 0.0;
};

struct Fit {
  Row at = Row::Zero();
  Square cofactors = Square::Zero();  // of unit weight
  double factor = 1.0;                // residuals over sigmas
  int count = 0;
};

Fit fit(const std::vector<Observation>& observations) {
  Fit result;
  std::vector<double> weights(observations.size(), 1.0);
  for (int round = 0; round < kRounds; ++round) {
    Square normal = Square::Zero();
    Row right = Row::Zero();
    for (std::size_t i = 0; i < observations.size(); ++i) {
      const Row row = observations[i].row / observations[i].sigma;
      normal += weights[i] * row * row.transpose();
      right += weights[i] * observations[i].value / observations[i].sigma * row;
    }
    const Eigen::LDLT<Square> factor(normal);
    result.at = factor.solve(right);
    result.cofactors = factor.solve(Square::Identity());
    std::vector<double> off(observations.size());
    for (std::size_t i = 0; i < observations.size(); ++i)
      off[i] = std::abs(observations[i].value - observations[i].row.dot(result.at)) / observations[i].sigma;
    const double scale = std::max(1.0, 1.4826 * math::median(off)) * kTukey;
    double squares = 0.0, sum = 0.0;
    result.count = 0;
    for (std::size_t i = 0; i < observations.size(); ++i) {
      const double ratio = off[i] / scale;
      weights[i] = ratio < 1.0 ? std::pow(1.0 - ratio * ratio, 2) : 0.0;
      squares += weights[i] * off[i] * off[i];
      sum += weights[i];
      if (ratio < 0.6) ++result.count;
    }
    result.factor = std::sqrt(squares / std::max(1.0, sum - kTerms));
  }
  return result;
}

/// The pixels from `from_px` to `to_px` before an edge (beyond it: negative) and up to `half_px` along it to either side: visit(x, y, q, s), q before and
/// s along the edge.
template <typename Visit>
void for_strip(const CameraView& view, const Eigen::Vector2d& at_px, const Eigen::Vector2d& out, double from_px, double to_px,
               double half_px, const Visit& visit) {
  const Eigen::Vector2d along(-out.y(), out.x());
  const Eigen::Vector2d middle = at_px - 0.5 * (from_px + to_px) * out;
  const double radius = std::hypot(0.5 * (to_px - from_px), half_px) + 1.0;
  const int x0 = std::max(0, static_cast<int>(middle.x() - radius));
  const int x1 = std::min(view.width() - 1, static_cast<int>(middle.x() + radius) + 1);
  const int y0 = std::max(0, static_cast<int>(middle.y() - radius));
  const int y1 = std::min(view.height() - 1, static_cast<int>(middle.y() + radius) + 1);
  for (int y = y0; y <= y1; ++y) {
    for (int x = x0; x <= x1; ++x) {
      const Eigen::Vector2d d = Eigen::Vector2d(x, y) - at_px;
      const double q = -out.dot(d);
      const double s = along.dot(d);
      if (q >= from_px && q <= to_px && std::abs(s) <= half_px) visit(x, y, q, s);
    }
  }
}

/// The depths before an edge; nothing where too few lie there or the surface does not begin at it.
std::optional<std::vector<Depth>> depths_before(CameraView& view, const Eigen::Vector2d& at_px, const Eigen::Vector2d& out,
                                                double guard_px, double reach_px) {
  std::vector<Depth> depths;
  std::array<int, kBegin_px> seen = {}, known = {};  // pixels by their distance beyond the guard
  for_strip(view, at_px, out, guard_px, reach_px, kHalfWidth * reach_px, [&](int x, int y, double q, double s) {
    const std::size_t at = view.index(x, y);
    const double z = view.depth(at);
    if (const auto line = static_cast<std::size_t>(q - guard_px); line < seen.size()) {
      ++seen[line];
      if (!std::isnan(z)) ++known[line];
    }
    if (std::isnan(z)) return;
    const Eigen::Vector2f tangent = view.tangent(x, y);
    if (!tangent.allFinite()) return;
    const double along_ray = std::sqrt(1.0 + static_cast<double>(tangent.squaredNorm()));  // distance over depth
    const double sigma_z = std::max(1e-4, static_cast<double>(view.sigma(at)) / along_ray);
    depths.push_back({tangent.cast<double>(), z, sigma_z, q, s});
  });
  bool begins = false;
  for (std::size_t line = 0; line < seen.size(); ++line)
    begins = begins || (seen[line] > 0 && known[line] >= kBeginShare * seen[line]);
  if (depths.size() < kLeastDepths || !begins) return std::nullopt;
  return depths;
}

}  // namespace

CameraView::CameraView(const base::Camera& camera, std::vector<float> depth_mm, std::vector<float> sigma_mm)
    : camera_(&camera),
      depth_mm_(std::move(depth_mm)),
      sigma_mm_(std::move(sigma_mm)),
      tangents_(depth_mm_.size(), Eigen::Vector2f::Constant(kNowhere)),
      known_(depth_mm_.size(), 0) {}

void CameraView::set_tangents(std::vector<Eigen::Vector2f> tangents) {
  tangents_ = std::move(tangents);
  known_.assign(tangents_.size(), 1);
}

Eigen::Vector2f CameraView::tangent(int x, int y) {
  const std::size_t at = index(x, y);
  if (!known_[at]) {
    known_[at] = 1;
    if (const auto ray = camera_->unproject(Eigen::Vector2d(x, y))) tangents_[at] = (ray->head<2>() / ray->z()).cast<float>();
  }
  return tangents_[at];
}

CameraView right_view(const base::Head& head, const std::vector<float>& depth_mm, const std::vector<float>& sigma_mm,
                      const std::array<double, 4>& roi_px) {
  const int width = head.right.width_px();
  const int height = head.right.height_px();
  const auto w = static_cast<std::size_t>(width);
  std::vector<float> depth(w * static_cast<std::size_t>(height), kNowhere);
  std::vector<float> sigma(depth.size(), kNowhere);
  std::vector<Eigen::Vector2f> tangents(depth.size(), Eigen::Vector2f::Constant(kNowhere));
  CameraView left(head.left, depth_mm, sigma_mm);
  const auto bound = [](double value, int size) { return static_cast<int>(std::clamp(value, 0.0, size - 1.0)); };
  for (int y = bound(roi_px[1], left.height()); y <= bound(roi_px[3], left.height()); ++y) {
    for (int x = bound(roi_px[0], left.width()); x <= bound(roi_px[2], left.width()); ++x) {
      const auto at = static_cast<std::size_t>(y) * static_cast<std::size_t>(left.width()) + static_cast<std::size_t>(x);
      if (std::isnan(depth_mm[at])) continue;
      const Eigen::Vector2f tangent = left.tangent(x, y);
      const Eigen::Vector3d point =
          head.right_from_left * (static_cast<double>(depth_mm[at]) * Eigen::Vector3d(tangent.x(), tangent.y(), 1.0));
      std::array<double, 2> pixel = {};
      if (!base::project_bare(head.right.model(), head.right.parameters().data(), point.data(), pixel.data(), nullptr, nullptr))
        continue;
      const long column = std::lround(pixel[0]);
      const long row = std::lround(pixel[1]);
      if (column < 0 || row < 0 || column >= width || row >= height) continue;
      const auto there = static_cast<std::size_t>(row) * w + static_cast<std::size_t>(column);
      if (depth[there] <= static_cast<float>(point.z())) continue;
      depth[there] = static_cast<float>(point.z());
      sigma[there] = sigma_mm[at];
      tangents[there] = (point.head<2>() / point.z()).cast<float>();
    }
  }
  CameraView view(head.right, std::move(depth), std::move(sigma));
  view.set_tangents(std::move(tangents));
  return view;
}

bool goes_on(CameraView& view, const LocalSurface& surface, const Eigen::Vector2d& at_px, const Eigen::Vector2d& out,
             double beyond_px) {
  constexpr double kStrip_px = 8.0;
  constexpr double kHalfStrip_px = 5.0;
  constexpr double kSigmas = 5.0;
  int seen = 0, continued = 0;
  for_strip(view, at_px, out, -beyond_px - kStrip_px, -beyond_px, kHalfStrip_px, [&](int x, int y, double q, double s) {
    ++seen;
    const std::size_t at = view.index(x, y);
    const double z = view.depth(at);
    const Eigen::Vector2f tangent = view.tangent(x, y);
    if (std::isnan(z) || !tangent.allFinite()) return;
    const Row row = (Row() << 1.0, tangent.x(), tangent.y(), q * q, q * s, s * s).finished();
    const double sigma = std::hypot(static_cast<double>(view.sigma(at)) / (z * z), std::sqrt(row.dot(surface.terms_cov * row)));
    if (std::abs(1.0 / z - row.dot(surface.terms)) < kSigmas * sigma) ++continued;
  });
  return 2 * continued >= seen;
}

std::optional<LocalSurface> surface_before(CameraView& view, const Eigen::Vector2d& at_px, const Eigen::Vector2d& out,
                                           double guard_px, double reach_px) {
  const auto depths = depths_before(view, at_px, out, guard_px, reach_px);
  if (!depths) return std::nullopt;
  std::vector<Observation> observations;
  for (const Depth& d : *depths) {
    observations.push_back({(Row() << 1.0, d.tangent.x(), d.tangent.y(), d.q * d.q, d.q * d.s, d.s * d.s).finished(), 1.0 / d.z,
                            d.sigma_z / (d.z * d.z)});
  }
  const auto ray = view.camera().unproject(at_px);
  if (!ray) return std::nullopt;
  const Fit chosen = fit(observations);
  if (chosen.count < kLeastDepths) return std::nullopt;
  LocalSurface surface;
  const Row here = (Row() << 1.0, ray->x() / ray->z(), ray->y() / ray->z(), 0.0, 0.0, 0.0).finished();
  surface.inverse_depth = here.dot(chosen.at);
  if (!(surface.inverse_depth > 0.0)) return std::nullopt;
  surface.sigma = std::sqrt(here.dot(chosen.cofactors * here)) * std::max(1.0, chosen.factor);
  surface.plane = Eigen::Vector3d(chosen.at(1), chosen.at(2), chosen.at(0));
  const Eigen::Vector3i order(1, 2, 0);
  surface.plane_cov = chosen.cofactors(order, order) * std::pow(std::max(1.0, chosen.factor), 2);
  surface.normal = -surface.plane.normalized();
  surface.terms = chosen.at;
  surface.terms_cov = chosen.cofactors * std::pow(std::max(1.0, chosen.factor), 2);
  surface.count = chosen.count;
  // The value of a parabola in its middle has 9 / 4 of the variance of a mean: as if from 4 / 9 of its length.
  surface.extent_px = 2.0 * kHalfWidth * reach_px;
  surface.piece_px = 4.0 / 9.0 * surface.extent_px;
  const double z = 1.0 / surface.inverse_depth;
  surface.rms_mm = chosen.factor * math::median([&] {
                     std::vector<double> sigmas;
                     for (const Observation& one : observations) sigmas.push_back(one.sigma);
                     return sigmas;
                   }()) *
                   z * z;
  return surface;
}

std::optional<LocalSlope> slope_before(CameraView& view, const Eigen::Vector2d& at_px, const Eigen::Vector2d& out,
                                       double guard_px, double reach_px, const Eigen::Vector3d& origin_mm,
                                       const Eigen::Matrix3d& axes) {
  const auto depths = depths_before(view, at_px, out, guard_px, reach_px);
  if (!depths) return std::nullopt;
  const double unit_mm = std::max(1e-6, reach_px * origin_mm.z() / view.camera().parameters()(0));  // keeps the terms alike
  std::vector<Observation> observations;
  for (const Depth& d : *depths) {
    const Eigen::Vector3d ray(d.tangent.x(), d.tangent.y(), 1.0);
    const Eigen::Vector3d at = axes.transpose() * (d.z * ray - origin_mm) / unit_mm;
    observations.push_back({(Row() << 1.0, at.x(), at.y(), at.x() * at.x(), at.x() * at.y(), at.y() * at.y()).finished(),
                            at.z(), d.sigma_z * std::abs(axes.col(2).dot(ray)) / unit_mm});
  }
  const Fit found = fit(observations);
  if (found.count < kLeastDepths) return std::nullopt;
  return LocalSlope{found.at.segment<2>(1), found.cofactors.block<2, 2>(1, 1) * std::pow(std::max(1.0, found.factor), 2),
                    2.0 * kHalfWidth * reach_px};
}

}  // namespace crosstie::edge::detail
