#include "scan/detail/rectified_map.h"

#include <array>
#include <cmath>
#include <limits>

#include "scan/detail/rows.h"

namespace crosstie::scan::detail {
namespace {

const Eigen::Vector2d kNone = Eigen::Vector2d::Constant(std::numeric_limits<double>::quiet_NaN());

/// Weights of four neighbours for a place at `s` of the way from the second to the third: cubic Lagrange, exact for cubics.
std::array<double, 4> cubic(double s) {
  return {-s * (s - 1.0) * (s - 2.0) / 6.0, (s + 1.0) * (s - 1.0) * (s - 2.0) / 2.0, -(s + 1.0) * s * (s - 2.0) / 2.0,
          (s + 1.0) * s * (s - 1.0) / 6.0};
}

}  // namespace

base::Result<RectifiedMap> RectifiedMap::make(const base::Camera& camera, const Eigen::Matrix3d& rectified_from_camera,
                                              int threads) {
  RectifiedMap map;
  map.width_ = camera.width_px();
  map.height_ = camera.height_px();
  map.columns_ = (map.width_ + kSpacing - 1) / kSpacing + 3;
  const int rows = (map.height_ + kSpacing - 1) / kSpacing + 3;
  map.nodes_.assign(static_cast<std::size_t>(map.columns_) * static_cast<std::size_t>(rows), kNone);
  const auto node = [&](int column, int row) -> Eigen::Vector2d& {
    return map
        .nodes_[static_cast<std::size_t>(row) * static_cast<std::size_t>(map.columns_) + static_cast<std::size_t>(column)];
  };
  over_rows(rows, threads, [&](int first, int last) {
    for (int row = first; row < last; ++row) {
      for (int column = 0; column < map.columns_; ++column) {
        const auto ray = camera.unproject(Eigen::Vector2d((column - 1) * kSpacing, (row - 1) * kSpacing));
        if (!ray) continue;
        const Eigen::Vector3d turned = rectified_from_camera * *ray;
        if (turned.z() > 1e-3) node(column, row) = turned.head<2>() / turned.z();
      }
    }
  });
  if (node(map.columns_ / 2, rows / 2).hasNaN()) {
    return base::fail(base::ErrorCode::kBadInput, "the lens model has no rays in the middle of its image");
  }
  // Nodes beyond the image may lie beyond the lens's domain: carried on from those inside.
  const auto carry_on = [&](int column, int row, int dx, int dy) {
    if (node(column, row).hasNaN()) {
      node(column, row) =
          3.0 * node(column + dx, row + dy) - 3.0 * node(column + 2 * dx, row + 2 * dy) + node(column + 3 * dx, row + 3 * dy);
    }
  };
  if (map.columns_ > 4 && rows > 4) {
    for (int row = 0; row < rows; ++row) {
      carry_on(0, row, 1, 0);
      carry_on(map.columns_ - 2, row, -1, 0);
      carry_on(map.columns_ - 1, row, -1, 0);
    }
    for (int column = 0; column < map.columns_; ++column) {
      carry_on(column, 0, 0, 1);
      carry_on(column, rows - 2, 0, -1);
      carry_on(column, rows - 1, 0, -1);
    }
  }
  return map;
}

void RectifiedMap::row(int y, float* x_over_z, float* y_over_z) const {
  const auto down = cubic(static_cast<double>(y % kSpacing) / kSpacing);
  const auto first_row = static_cast<std::size_t>(y / kSpacing);
  std::vector<Eigen::Vector2d> between(static_cast<std::size_t>(columns_), Eigen::Vector2d::Zero());
  for (std::size_t k = 0; k < 4; ++k) {
    const Eigen::Vector2d* nodes = &nodes_[(first_row + k) * static_cast<std::size_t>(columns_)];
    for (std::size_t c = 0; c < between.size(); ++c) between[c] += down[k] * nodes[c];
  }
  static const auto kAcross = [] {
    std::array<std::array<double, 4>, kSpacing> weights = {};
    for (std::size_t i = 0; i < kSpacing; ++i) weights[i] = cubic(static_cast<double>(i) / kSpacing);
    return weights;
  }();
  for (int x = 0; x < width_; ++x) {
    const auto& weights = kAcross[static_cast<std::size_t>(x % kSpacing)];
    const Eigen::Vector2d* nodes = &between[static_cast<std::size_t>(x / kSpacing)];
    const Eigen::Vector2d value = weights[0] * nodes[0] + weights[1] * nodes[1] + weights[2] * nodes[2] + weights[3] * nodes[3];
    x_over_z[x] = static_cast<float>(value.x());
    y_over_z[x] = static_cast<float>(value.y());
  }
}

}  // namespace crosstie::scan::detail
