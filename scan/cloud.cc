#include "scan/cloud.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <numeric>

#include <fmt/format.h>
#include <Eigen/Geometry>

#include "base/parallel.h"
#include "scan/detail/calibration_part.h"
#include "scan/detail/rectified_map.h"
#include "scan/detail/rows.h"
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
  const auto w = static_cast<std::size_t>(depths.width);
  detail::over_rows(depths.height, threads, [&](int first, int last) {
    for (std::size_t i = static_cast<std::size_t>(first) * w; i < static_cast<std::size_t>(last) * w; ++i) {
      surface.good[i] = !std::isnan(depths.depth_mm[i]);
      surface.inverse[i] = surface.good[i] ? 1.0F / depths.depth_mm[i] : kNowhere;
    }
  });
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
  const auto map = detail::RectifiedMap::make(head.left, Eigen::Matrix3d::Identity(), options.threads);
  if (!map) return tl::unexpected(map.error());
  const int width = depths.width;
  const int height = depths.height;
  const auto w = static_cast<std::size_t>(width);
  const Surface surface = surface_of(depths, options.threads);
  std::vector<char> averaged;
  std::vector<float> filtered;
  if (options.filter_radius_px > 0) {
    filtered =
        detail::box_mean(surface.inverse, surface.good, width, height, options.filter_radius_px, options.threads, &averaged);
  }
  const std::vector<float>& inverse = filtered.empty() ? surface.inverse : filtered;
  const std::vector<float> calibration = detail::calibration_sigmas(head, depths, options.threads);

  std::vector<Eigen::Vector3f> normals(depths.depth_mm.size(), Eigen::Vector3f::Zero());
  std::vector<char> keep(depths.depth_mm.size(), 0);
  std::vector<std::array<std::int64_t, 2>> left_out(detail::band_count(height), {0, 0});
  std::vector<float> x_all(depths.depth_mm.size()), y_all(depths.depth_mm.size());
  auto done = detail::over_rows(height, options.threads, "rays", progress, [&](int first, int last) {
    for (auto y = static_cast<std::size_t>(first); y < static_cast<std::size_t>(last); ++y)
      map->row(static_cast<int>(y), &x_all[y * w], &y_all[y * w]);
  });
  if (!done) return fail(std::move(done));
  const double least_cosine = std::cos(options.max_grazing_rad);
  done = detail::over_rows(height, options.threads, "points", progress, [&](int first, int last) {
    auto& [grazing, off_surface] = left_out[detail::band_of(first)];
    for (std::size_t at = static_cast<std::size_t>(first) * w; at < static_cast<std::size_t>(last) * w; ++at) {
      if (!surface.good[at]) continue;
      const double x = x_all[at];
      const double y = y_all[at];
      const double length = std::sqrt(1.0 + x * x + y * y);  // of the ray to Z = 1
      const double smooth = surface.smooth[at];
      if (surface.averaged[at]) {
        const double z = depths.depth_mm[at];
        const double off = std::abs(z * z * (static_cast<double>(surface.inverse[at]) - smooth)) * length;
        if (off > options.max_surface_sigmas * static_cast<double>(depths.sigma_mm[at])) {
          ++off_surface;
          continue;
        }
      }
      // Differences to both sides, or to the one that there is.
      const std::size_t column = at % w;
      const std::size_t west = column > 0 && surface.good[at - 1] ? at - 1 : at;
      const std::size_t east = column + 1 < w && surface.good[at + 1] ? at + 1 : at;
      const std::size_t north = at >= w && surface.good[at - w] ? at - w : at;
      const std::size_t south = at + w < surface.good.size() && surface.good[at + w] ? at + w : at;
      if (west != east && north != south) {
        // The plane m.P = 1: 1 / Z = m.(x, y, 1).
        const double x_u = x_all[east] - x_all[west], y_u = y_all[east] - y_all[west];
        const double x_v = x_all[south] - x_all[north], y_v = y_all[south] - y_all[north];
        const double s_u = surface.smooth[east] - surface.smooth[west];
        const double s_v = surface.smooth[south] - surface.smooth[north];
        const double area = x_u * y_v - y_u * x_v;
        const double m_x = (s_u * y_v - y_u * s_v) / area;
        const double m_y = (x_u * s_v - s_u * x_v) / area;
        const Eigen::Vector3d m(m_x, m_y, smooth - m_x * x - m_y * y);
        const double norm = m.norm();
        normals[at] = (m / -norm).cast<float>();
        if (surface.averaged[at] && smooth < least_cosine * norm * length) {
          ++grazing;
          continue;
        }
      }
      keep[at] = 1;
    }
  });
  if (!done) return fail(std::move(done));

  ScanCloud result;
  for (const auto& [grazing, off_surface] : left_out) {
    result.grazing += grazing;
    result.off_surface += off_surface;
  }
  // Where the points of each band of rows begin in the cloud.
  std::vector<std::size_t> begins(detail::band_count(height) + 1, 0);
  detail::over_rows(height, options.threads, [&](int first, int last) {
    const auto row = [&](int y) { return keep.begin() + static_cast<std::ptrdiff_t>(y) * width; };
    begins[detail::band_of(first) + 1] = static_cast<std::size_t>(std::count(row(first), row(last), 1));
  });
  std::partial_sum(begins.begin(), begins.end(), begins.begin());
  const std::size_t count = begins.back();
  if (count == 0) return fail(ErrorCode::kNoUniqueSolution, "no pixel of the left camera has a partner in the right one");
  base::Cloud& cloud = result.cloud;
  cloud.frame = "rig";
  const base::PhasePlane& plane = left.x ? *left.x : *left.y;
  const bool both = !depths.epipolar_px.empty();
  std::vector<double> sigma, calibration_mm, light, modulation, epipolar, column, row;
  std::vector<std::vector<double>*> columns = {&sigma, &light, &modulation, &column, &row};
  if (!calibration.empty()) columns.push_back(&calibration_mm);
  if (both) columns.push_back(&epipolar);
  // Memory that is touched for the first time takes as long as what is written into it.
  done = base::parallel_for(columns.size() + 2, options.threads, "memory", {}, [&](std::size_t i) -> Result<> {
    if (i == 0) cloud.points.resize(count);
    if (i == 1) cloud.normals.resize(count);
    if (i > 1) columns[i - 2]->resize(count);
    return {};
  });
  if (!done) return fail(std::move(done));
  result.depth_mm.assign(depths.depth_mm.size(), kNowhere);
  std::vector<double> footprints(detail::band_count(height), 0.0);
  const double focal_px = head.left.focal_px().mean();
  detail::over_rows(height, options.threads, [&](int first, int last) {
    std::size_t i = begins[detail::band_of(first)];
    for (std::size_t at = static_cast<std::size_t>(first) * w; at < static_cast<std::size_t>(last) * w; ++at) {
      if (!keep[at]) continue;
      const double z = 1.0 / static_cast<double>(inverse[at]);
      result.depth_mm[at] = static_cast<float>(z);
      cloud.points[i] = z * Eigen::Vector3d(x_all[at], y_all[at], 1.0);
      cloud.normals[i] = normals[at].cast<double>();
      const double width_px = !averaged.empty() && averaged[at] ? 2.0 * options.filter_radius_px + 1.0 : 1.0;
      sigma[i] = static_cast<double>(depths.sigma_mm[at]) / width_px;
      if (!calibration.empty()) calibration_mm[i] = calibration[at];
      light[i] = left.light[at];
      modulation[i] = plane.modulation[at];
      if (both) epipolar[i] = depths.epipolar_px[at];
      column[i] = static_cast<double>(at % w);
      row[i] = static_cast<double>(at / w);
      footprints[detail::band_of(first)] += z / focal_px;
      ++i;
    }
  });
  const double footprint = std::accumulate(footprints.begin(), footprints.end(), 0.0) / static_cast<double>(count);
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
