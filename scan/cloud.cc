#include "scan/cloud.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <fmt/format.h>
#include <Eigen/Geometry>

#include "base/parallel.h"
#include "scan/detail/calibration_part.h"
#include "scan/detail/rectified_map.h"
#include "scan/detail/smooth.h"

namespace crosstie::scan {
namespace {

using base::ErrorCode;
using base::fail;
using base::Result;

constexpr int kSurfaceRadius_px = 2;  // of the neighbours' surface and of normals
constexpr float kNowhere = std::numeric_limits<float>::quiet_NaN();

/// A pixel's point with what decides whether it stays.
struct Surface {
  std::vector<float> inverse;  ///< 1 / depth of each pixel [1/mm]: of a plane it is linear over the image
  std::vector<float> smooth;   ///< the same, averaged
  std::vector<char> averaged;  ///< where it is a mean over all neighbours
  std::vector<char> good;
};

Surface surface_of(const DepthMap& depths, int threads) {
  Surface surface;
  surface.good.resize(depths.depth_mm.size());
  surface.inverse.resize(depths.depth_mm.size());
  for (std::size_t i = 0; i < depths.depth_mm.size(); ++i) {
    surface.good[i] = !std::isnan(depths.depth_mm[i]);
    surface.inverse[i] = surface.good[i] ? 1.0F / depths.depth_mm[i] : kNowhere;
  }
  surface.smooth = detail::box_mean(surface.inverse, surface.good, depths.width, depths.height, kSurfaceRadius_px, threads,
                                    &surface.averaged);
  return surface;
}

}  // namespace

Result<> CloudOptions::validate() const {
  const auto bad = [](const std::string& what) { return fail(ErrorCode::kUsage, "cloud options: " + what); };
  if (!(max_grazing_rad > 0.0 && max_grazing_rad <= 1.5707963267948966))
    return bad(fmt::format("max_grazing_rad is {}, not in (0, pi/2]", max_grazing_rad));
  if (!(max_surface_sigmas > 0.0)) return bad(fmt::format("max_surface_sigmas is {}, it must be positive", max_surface_sigmas));
  if (filter_radius_px < 0 || filter_radius_px > 50)
    return bad(fmt::format("filter_radius_px is {}, not in 0..50", filter_radius_px));
  return {};
}

Result<ScanCloud> make_cloud(const DepthMap& depths, const base::PhaseMap& left, const base::Head& head,
                             const CloudOptions& options, const base::Progress& progress) {
  if (auto ok = options.validate(); !ok) return fail(std::move(ok));
  const auto map = detail::RectifiedMap::make(head.left, Eigen::Matrix3d::Identity());
  if (!map) return tl::unexpected(map.error());
  const int width = depths.width;
  const int height = depths.height;
  const auto w = static_cast<std::size_t>(width);
  const Surface surface = surface_of(depths, options.threads);
  std::vector<char> filtered;
  const std::vector<float> inverse =
      detail::box_mean(surface.inverse, surface.good, width, height, options.filter_radius_px, options.threads, &filtered);
  const std::vector<float> calibration = detail::calibration_sigmas(head, depths);

  std::vector<Eigen::Vector3f> normals(depths.depth_mm.size(), Eigen::Vector3f::Zero());
  std::vector<char> keep(depths.depth_mm.size(), 0);
  std::vector<std::array<std::int64_t, 2>> left_out(static_cast<std::size_t>(height), {0, 0});
  std::vector<float> x_all(depths.depth_mm.size()), y_all(depths.depth_mm.size());
  auto done =
      base::parallel_for(static_cast<std::size_t>(height), options.threads, "rays", progress, [&](std::size_t y) -> Result<> {
        map->row(static_cast<int>(y), &x_all[y * w], &y_all[y * w]);
        return {};
      });
  if (!done) return fail(std::move(done));
  const auto on_surface = [&](std::size_t at) -> Eigen::Vector3d {
    return Eigen::Vector3d(x_all[at], y_all[at], 1.0) / static_cast<double>(surface.smooth[at]);
  };
  done =
      base::parallel_for(static_cast<std::size_t>(height), options.threads, "points", progress, [&](std::size_t y) -> Result<> {
        for (std::size_t x = 0; x < w; ++x) {
          const std::size_t at = y * w + x;
          if (!surface.good[at]) continue;
          const Eigen::Vector3d ray = Eigen::Vector3d(x_all[at], y_all[at], 1.0).normalized();
          if (surface.averaged[at]) {
            const double z = depths.depth_mm[at];
            const double off = std::abs(z * z * static_cast<double>(surface.inverse[at] - surface.smooth[at])) / ray.z();
            if (off > options.max_surface_sigmas * static_cast<double>(depths.sigma_mm[at])) {
              ++left_out[y][1];
              continue;
            }
          }
          // Differences to both sides, or to the one that there is.
          const std::size_t west = x > 0 && surface.good[at - 1] ? at - 1 : at;
          const std::size_t east = x + 1 < w && surface.good[at + 1] ? at + 1 : at;
          const std::size_t north = y > 0 && surface.good[at - w] ? at - w : at;
          const std::size_t south = y + 1 < static_cast<std::size_t>(height) && surface.good[at + w] ? at + w : at;
          if (west != east && north != south) {
            const Eigen::Vector3d normal =
                (on_surface(south) - on_surface(north)).cross(on_surface(east) - on_surface(west)).normalized();
            normals[at] = normal.cast<float>();
            if (surface.averaged[at] && -normal.dot(ray) < std::cos(options.max_grazing_rad)) {
              ++left_out[y][0];
              continue;
            }
          }
          keep[at] = 1;
        }
        return {};
      });
  if (!done) return fail(std::move(done));

  ScanCloud result;
  for (const auto& [grazing, off_surface] : left_out) {
    result.grazing += grazing;
    result.off_surface += off_surface;
  }
  const auto count = static_cast<std::size_t>(std::count(keep.begin(), keep.end(), 1));
  if (count == 0) return fail(ErrorCode::kNoUniqueSolution, "no pixel of the left camera has a partner in the right one");
  base::Cloud& cloud = result.cloud;
  cloud.frame = "rig";
  cloud.points.reserve(count);
  cloud.normals.reserve(count);
  const bool both = !depths.epipolar_px.empty();
  const base::PhasePlane& plane = left.x ? *left.x : *left.y;
  std::vector<double> sigma, calibration_mm, light, modulation, epipolar, column, row;
  result.depth_mm.assign(depths.depth_mm.size(), kNowhere);
  double footprint = 0.0;
  for (std::size_t at = 0; at < keep.size(); ++at) {
    if (!keep[at]) continue;
    const double z = 1.0 / static_cast<double>(inverse[at]);
    result.depth_mm[at] = static_cast<float>(z);
    cloud.points.emplace_back(z * Eigen::Vector3d(x_all[at], y_all[at], 1.0));
    cloud.normals.emplace_back(normals[at].cast<double>());
    const double averaged = filtered[at] ? 2.0 * options.filter_radius_px + 1.0 : 1.0;
    sigma.push_back(static_cast<double>(depths.sigma_mm[at]) / averaged);
    if (!calibration.empty()) calibration_mm.push_back(calibration[at]);
    light.push_back(left.light[at]);
    modulation.push_back(plane.modulation[at]);
    if (both) epipolar.push_back(depths.epipolar_px[at]);
    column.push_back(static_cast<double>(at % w));
    row.push_back(static_cast<double>(at / w));
    footprint += z / head.left.focal_px().mean() / static_cast<double>(count);
  }
  cloud.fields.push_back({"sigma_mm", std::move(sigma)});
  if (!calibration.empty()) cloud.fields.push_back({"calibration_mm", std::move(calibration_mm)});
  cloud.fields.push_back({"light", std::move(light)});
  cloud.fields.push_back({"modulation", std::move(modulation)});
  if (both) cloud.fields.push_back({"epipolar_px", std::move(epipolar)});
  cloud.fields.push_back({"column", std::move(column)});
  cloud.fields.push_back({"row", std::move(row)});
  if (options.filter_radius_px > 0) result.correlation_length_mm = (2.0 * options.filter_radius_px + 1.0) * footprint;
  return result;
}

}  // namespace crosstie::scan
