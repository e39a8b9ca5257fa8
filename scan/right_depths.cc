#include "scan/right_depths.h"

#include <array>
#include <cmath>
#include <cstddef>
#include <limits>

#include <Eigen/Core>

#include "base/lens_model.h"
#include "scan/detail/rectified_map.h"

namespace crosstie::scan {

std::vector<float> right_depths(const DepthMap& depths, const base::Head& head) {
  const int width = head.right.width_px();
  const int height = head.right.height_px();
  const auto w = static_cast<std::size_t>(width);
  constexpr float kNowhere = std::numeric_limits<float>::quiet_NaN();
  std::vector<float> seen(w * static_cast<std::size_t>(height), kNowhere);
  const auto rays = detail::RectifiedMap::make(head.left, Eigen::Matrix3d::Identity(), 1);
  if (!rays) return seen;
  std::vector<float> x_over_z(static_cast<std::size_t>(depths.width)), y_over_z(x_over_z);
  for (int y = 0; y < depths.height; ++y) {
    rays->row(y, x_over_z.data(), y_over_z.data());
    for (int x = 0; x < depths.width; ++x) {
      const auto at = static_cast<std::size_t>(y) * static_cast<std::size_t>(depths.width) + static_cast<std::size_t>(x);
      const double z = depths.depth_mm[at];
      if (std::isnan(z)) continue;
      const Eigen::Vector3d point =
          head.right_from_left * Eigen::Vector3d(z * static_cast<double>(x_over_z[static_cast<std::size_t>(x)]),
                                                 z * static_cast<double>(y_over_z[static_cast<std::size_t>(x)]), z);
      std::array<double, 2> pixel = {};
      if (!base::project_bare(head.right.model(), head.right.parameters().data(), point.data(), pixel.data(), nullptr, nullptr))
        continue;
      const long column = std::lround(pixel[0]);
      const long row = std::lround(pixel[1]);
      if (column < 0 || row < 0 || column >= width || row >= height) continue;
      float& there = seen[static_cast<std::size_t>(row) * w + static_cast<std::size_t>(column)];
      const auto depth = static_cast<float>(point.z());
      if (!(there <= depth)) there = depth;  // also where there is none yet
    }
  }
  std::vector<float> filled = seen;
  for (int y = 1; y + 1 < height; ++y) {
    for (int x = 1; x + 1 < width; ++x) {
      const auto at = static_cast<std::size_t>(y) * w + static_cast<std::size_t>(x);
      if (!std::isnan(seen[at])) continue;
      float sum = 0.0F;
      int count = 0;
      for (const std::size_t other : {at - 1, at + 1, at - w, at + w}) {
        if (std::isnan(seen[other])) continue;
        sum += seen[other];
        ++count;
      }
      if (count >= 3) filled[at] = sum / static_cast<float>(count);
    }
  }
  return filled;
}

}  // namespace crosstie::scan
