#include "edge/detail/view_surface.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include <Eigen/Cholesky>

#include "math/median.h"

namespace crosstie::edge::detail {
namespace {

constexpr float kNowhere = std::numeric_limits<float>::quiet_NaN();
constexpr int kLeastDepths = 40;
constexpr double kBegin_px = 2.0;    // beyond the guard: there the surface must have begun, or the edge is not its own
constexpr double kBeginShare = 0.5;  // of the pixels there
constexpr double kHalfWidth = 0.6;   // along the edge, of the reach across it
constexpr int kRounds = 6;
constexpr double kTukey = 4.7;

constexpr int kTerms = 6;
using Row = Eigen::Matrix<double, kTerms, 1>;  // 1, X/Z, Y/Z, q^2, q s, s^2
using Square = Eigen::Matrix<double, kTerms, kTerms>;

struct Depth {
  Row row;
  double inverse = 0.0;
  double sigma = 0.0;  // of the inverse
};

struct Fit {
  Row at = Row::Zero();
  Square cofactors = Square::Zero();  // of unit weight
  double factor = 1.0;                // residuals over sigmas
  int count = 0;
};

Fit fit(const std::vector<Depth>& depths) {
  Fit result;
  std::vector<double> weights(depths.size(), 1.0);
  for (int round = 0; round < kRounds; ++round) {
    Square normal = Square::Zero();
    Row right = Row::Zero();
    for (std::size_t i = 0; i < depths.size(); ++i) {
      const Row row = depths[i].row / depths[i].sigma;
      normal += weights[i] * row * row.transpose();
      right += weights[i] * depths[i].inverse / depths[i].sigma * row;
    }
    const Eigen::LDLT<Square> factor(normal);
    result.at = factor.solve(right);
    result.cofactors = factor.solve(Square::Identity());
    std::vector<double> off(depths.size());
    for (std::size_t i = 0; i < depths.size(); ++i)
      off[i] = std::abs(depths[i].inverse - depths[i].row.dot(result.at)) / depths[i].sigma;
    const double scale = std::max(1.0, 1.4826 * math::median(off)) * kTukey;
    double squares = 0.0, sum = 0.0;
    result.count = 0;
    for (std::size_t i = 0; i < depths.size(); ++i) {
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
  const auto at = static_cast<std::size_t>(y) * static_cast<std::size_t>(width()) + static_cast<std::size_t>(x);
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

std::optional<LocalSurface> surface_before(CameraView& view, const Eigen::Vector2d& at_px, const Eigen::Vector2d& out,
                                           double guard_px, double reach_px) {
  const Eigen::Vector2d along(-out.y(), out.x());
  const double half = kHalfWidth * reach_px;
  const Eigen::Vector2d middle = at_px - 0.5 * (guard_px + reach_px) * out;
  const double radius = std::hypot(0.5 * (reach_px - guard_px), half) + 1.0;
  const int x0 = std::max(0, static_cast<int>(middle.x() - radius));
  const int x1 = std::min(view.width() - 1, static_cast<int>(middle.x() + radius) + 1);
  const int y0 = std::max(0, static_cast<int>(middle.y() - radius));
  const int y1 = std::min(view.height() - 1, static_cast<int>(middle.y() + radius) + 1);
  std::vector<Depth> depths;
  int seen_first = 0, known_first = 0;  // of the pixels next to the edge
  for (int y = y0; y <= y1; ++y) {
    for (int x = x0; x <= x1; ++x) {
      const auto at = static_cast<std::size_t>(y) * static_cast<std::size_t>(view.width()) + static_cast<std::size_t>(x);
      const Eigen::Vector2d d = Eigen::Vector2d(x, y) - at_px;
      const double q = -out.dot(d);
      if (q < guard_px || q > reach_px || std::abs(along.dot(d)) > half) continue;
      const double z = view.depth(at);
      if (q < guard_px + kBegin_px) {
        ++seen_first;
        if (!std::isnan(z)) ++known_first;
      }
      if (std::isnan(z)) continue;
      const Eigen::Vector2f tangent = view.tangent(x, y);
      if (!tangent.allFinite()) continue;
      const double along_ray = std::sqrt(1.0 + static_cast<double>(tangent.squaredNorm()));  // distance over depth
      const double sigma_z = std::max(1e-4, static_cast<double>(view.sigma(at)) / along_ray);
      const double s = along.dot(d);
      depths.push_back({(Row() << 1.0, tangent.x(), tangent.y(), q * q, q * s, s * s).finished(), 1.0 / z, sigma_z / (z * z)});
    }
  }
  if (depths.size() < kLeastDepths || known_first < kBeginShare * seen_first) return std::nullopt;
  const auto ray = view.camera().unproject(at_px);
  if (!ray) return std::nullopt;
  const Fit chosen = fit(depths);
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
  surface.count = chosen.count;
  // The value of a parabola in its middle has 9 / 4 of the variance of a mean: as if from 4 / 9 of its length.
  surface.extent_px = 2.0 * half;
  surface.piece_px = 4.0 / 9.0 * surface.extent_px;
  const double z = 1.0 / surface.inverse_depth;
  surface.rms_mm = chosen.factor * math::median([&] {
                     std::vector<double> sigmas;
                     for (const Depth& depth : depths) sigmas.push_back(depth.sigma);
                     return sigmas;
                   }()) *
                   z * z;
  return surface;
}

}  // namespace crosstie::edge::detail
