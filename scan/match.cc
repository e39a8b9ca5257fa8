#include "scan/match.h"

#include <cmath>
#include <limits>
#include <tuple>
#include <utility>

#include <fmt/format.h>

#include "math/median.h"
#include "scan/detail/guard.h"
#include "scan/detail/matcher.h"
#include "scan/detail/rectification.h"
#include "scan/detail/rectified_map.h"
#include "scan/detail/rows.h"

namespace crosstie::scan {
namespace {

using base::ErrorCode;
using base::fail;
using base::PhaseMap;
using base::PhasePlane;
using base::Result;

constexpr float kNowhere = std::numeric_limits<float>::quiet_NaN();

Result<> check(const PhaseMap& left, const PhaseMap& right, const base::Head& head) {
  for (const auto& [map, camera, name] : {std::tuple{&left, &head.left, "left"}, std::tuple{&right, &head.right, "right"}}) {
    if (map->width != camera->width_px() || map->height != camera->height_px()) {
      return fail(ErrorCode::kBadInput, fmt::format("the {} images have {} x {} px, the {} camera {} x {}", name, map->width,
                                                    map->height, name, camera->width_px(), camera->height_px()));
    }
  }
  if (left.x.has_value() != right.x.has_value() || left.y.has_value() != right.y.has_value() || (!left.x && !left.y)) {
    return fail(ErrorCode::kBadInput, "the two cameras' phases are of different directions");
  }
  return {};
}

/// Signed median and 1.4826 times the median absolute deviation from it, of a sample of the pixels.
std::pair<double, double> median_and_mad(const std::vector<float>& plane) {
  constexpr std::size_t kSample = 200000;
  std::vector<float> values;
  for (std::size_t i = 0; i < plane.size(); i += 1 + plane.size() / kSample) {
    if (!std::isnan(plane[i])) values.push_back(plane[i]);
  }
  const double median = math::median(values);
  for (float& v : values) v = std::abs(v - static_cast<float>(median));
  return {median, 1.4826 * math::median(values)};
}

}  // namespace

Result<> MatchOptions::validate() const {
  const auto bad = [](const std::string& what) { return fail(ErrorCode::kUsage, "matching options: " + what); };
  if (!(min_depth_mm >= 0.0 && max_depth_mm > min_depth_mm)) return bad("the depths must be 0 <= min < max");
  if (!(min_slope > 0.0 && min_slope < 1.0)) return bad(fmt::format("min_slope is {}, not in (0, 1)", min_slope));
  if (!(max_epipolar_sigmas > 0.0 && max_epipolar_px >= 0.0))
    return bad("the limits of the epipolar distance must be positive");
  if (guard_px < 0 || guard_px > 100) return bad(fmt::format("guard_px is {}, not in 0..100", guard_px));
  return {};
}

Result<DepthMap> match(const PhaseMap& left, const PhaseMap& right, const base::Head& head, const MatchOptions& options,
                       const base::Progress& progress) {
  if (auto ok = options.validate(); !ok) return fail(std::move(ok));
  if (auto ok = check(left, right, head); !ok) return fail(std::move(ok));
  const auto frame = detail::rectify(head.right_from_left);
  if (!frame) return tl::unexpected(frame.error());
  const auto left_map = detail::RectifiedMap::make(head.left, frame->rectified_from_left, options.threads);
  if (!left_map) return tl::unexpected(left_map.error());
  const auto right_map = detail::RectifiedMap::make(head.right, frame->rectified_from_right, options.threads);
  if (!right_map) return tl::unexpected(right_map.error());
  const double focal_px = head.right.focal_px().mean();

  const bool x_first = left.x.has_value();
  const PhasePlane& first = x_first ? *left.x : *left.y;
  const PhasePlane* second = left.x && left.y ? &*left.y : nullptr;
  detail::MatchTarget target;
  target.width = right.width;
  target.height = right.height;
  target.first = x_first ? &*right.x : &*right.y;
  target.second = second != nullptr ? &*right.y : nullptr;
  target.good = detail::guarded_pixels(right, options.guard_px, options.guard_creases, options.threads);
  target.x_px.resize(right.status.size());
  target.y_px.resize(right.status.size());
  auto done = detail::over_rows(right.height, options.threads, "rays", progress, [&](int from, int to) {
    for (int y = from; y < to; ++y) {
      float* x_px = &target.x_px[right.at(0, y)];
      float* y_px = &target.y_px[right.at(0, y)];
      right_map->row(y, x_px, y_px);
      for (int x = 0; x < right.width; ++x) {
        x_px[x] *= static_cast<float>(focal_px);
        y_px[x] *= static_cast<float>(focal_px);
        char& good = target.good[right.at(x, y)];
        good = good && !std::isnan(x_px[x]);
      }
    }
  });
  if (!done) return fail(std::move(done));
  target.slope = detail::slope_along_curves(target);
  if (!(std::abs(target.slope) > 0.1 * detail::median_slope(*target.first, right.width, right.height))) {
    return fail(
        ErrorCode::kNoUniqueSolution,
        fmt::format("the fringes of the axis {} run along the line from camera to camera and tell no depth; turn them by 90 "
                    "degrees, or show both directions",
                    base::axis_name(target.first->axis)));
  }

  detail::smooth_phases(target, options.threads);
  const detail::Matcher matcher(target, options);
  const std::vector<char> good = detail::guarded_pixels(left, options.guard_px, options.guard_creases, options.threads);
  DepthMap map;
  map.width = left.width;
  map.height = left.height;
  const std::size_t pixels = left.status.size();
  map.depth_mm.assign(pixels, kNowhere);
  map.sigma_mm.assign(pixels, kNowhere);
  if (second != nullptr) map.epipolar_px.assign(pixels, kNowhere);
  struct Counts {
    std::int64_t points = 0, guarded = 0, unmatched = 0, off_curve = 0;
  };
  std::vector<Counts> counts(detail::band_count(left.height));
  const Eigen::Matrix3d left_from_rectified = frame->rectified_from_left.transpose();
  done = detail::over_rows(left.height, options.threads, "matches", progress, [&](int from, int to) {
    std::vector<float> x_row(static_cast<std::size_t>(left.width));
    std::vector<float> y_row(static_cast<std::size_t>(left.width));
    std::vector<detail::LeftPixel> row;
    std::vector<detail::Match> matches;
    Counts& count = counts[detail::band_of(from)];
    for (int y = from; y < to; ++y) {
      left_map->row(y, x_row.data(), y_row.data());
      row.clear();
      for (int x = 0; x < left.width; ++x) {
        const std::size_t at = left.at(x, y);
        if (left.status[at] != base::PhaseStatus::kValid) continue;
        if (!good[at]) {
          ++count.guarded;
          continue;
        }
        const float curve_px = y_row[static_cast<std::size_t>(x)] * static_cast<float>(focal_px);
        row.push_back({x, first.turns[at], first.sigma_turns[at], second != nullptr ? second->turns[at] : curve_px,
                       second != nullptr ? second->sigma_turns[at] : 0.0F, curve_px});
      }
      matches.resize(row.size());
      matcher.find_row(row, matches);
      for (std::size_t i = 0; i < row.size(); ++i) {
        const auto column = static_cast<std::size_t>(row[i].column);
        const std::size_t at = left.at(row[i].column, y);
        const detail::Match& found = matches[i];
        if (found.outcome == detail::MatchOutcome::kOffCurve) {
          ++count.off_curve;
          map.epipolar_px[at] = static_cast<float>(found.off_px);
        }
        if (found.outcome == detail::MatchOutcome::kNone) ++count.unmatched;
        if (found.outcome != detail::MatchOutcome::kMatched) continue;
        const double disparity = static_cast<double>(x_row[column]) - found.x_px / focal_px;
        const double depth = frame->baseline_mm / disparity;  // in the rectified frame
        const Eigen::Vector3d direction(x_row[column], y_row[column], 1.0);
        const double z = (left_from_rectified * direction).z() * depth;
        if (!(disparity > 0.0) || z < options.min_depth_mm || z > options.max_depth_mm) {
          ++count.unmatched;
          continue;
        }
        map.depth_mm[at] = static_cast<float>(z);
        map.sigma_mm[at] =
            static_cast<float>(depth * depth / frame->baseline_mm * found.sigma_px / focal_px * direction.norm());
        if (second != nullptr) map.epipolar_px[at] = static_cast<float>(found.off_px);
        ++count.points;
      }
    }
  });
  if (!done) return fail(std::move(done));
  for (const Counts& count : counts) {
    map.points += count.points;
    map.guarded += count.guarded;
    map.unmatched += count.unmatched;
    map.off_curve += count.off_curve;
  }
  std::tie(map.epipolar_median_px, map.epipolar_mad_px) = median_and_mad(map.epipolar_px);
  return map;
}

}  // namespace crosstie::scan
