#include "bundle/detail/start.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "bundle/detail/growth.h"
#include "bundle/detail/network_model.h"
#include "bundle/detail/triangulate.h"
#include "bundle/detail/two_view.h"
#include "math/minimise.h"

namespace crosstie::bundle::detail {
namespace {

using base::Error;
using base::ErrorCode;
using base::fail;
using base::Result;

constexpr double kSameOutcome = 0.01;  // relative difference of two sums: two pairs that lead to the same place confirm it

struct Pair {
  int a = 0;
  int b = 0;
  double score = 0.0;
};

std::vector<std::pair<int, int>> common_rays(const Survey& survey, const State& state, int image_a, int image_b) {
  std::vector<std::pair<int, int>> common;
  const auto& rays_a = survey.rays_of_image[static_cast<std::size_t>(image_a)];
  const auto& rays_b = survey.rays_of_image[static_cast<std::size_t>(image_b)];
  for (std::size_t i = 0, j = 0; i < rays_a.size() && j < rays_b.size();) {
    const Ray& a = survey.rays[static_cast<std::size_t>(rays_a[i])];
    const Ray& b = survey.rays[static_cast<std::size_t>(rays_b[j])];
    const bool usable = state.active[static_cast<std::size_t>(rays_a[i])] && state.active[static_cast<std::size_t>(rays_b[j])];
    if (a.point == b.point && usable) common.emplace_back(rays_a[i], rays_b[j]);
    const int point_a = a.point;
    if (a.point <= b.point) ++i;
    if (b.point <= point_a) ++j;
  }
  return common;
}

struct Sights {
  std::vector<Eigen::Vector3d> a;
  std::vector<Eigen::Vector3d> b;
};

Sights common_sights(const Survey& survey, const State& state, const std::vector<std::optional<Eigen::Vector3d>>& directions,
                     int image_a, int image_b) {
  Sights sights;
  for (const auto& [r, s] : common_rays(survey, state, image_a, image_b)) {
    if (!directions[static_cast<std::size_t>(r)] || !directions[static_cast<std::size_t>(s)]) continue;
    sights.a.push_back(*directions[static_cast<std::size_t>(r)]);
    sights.b.push_back(*directions[static_cast<std::size_t>(s)]);
  }
  return sights;
}

/// Pairs by number of common markers times parallax, each image in two of them at most.
std::vector<Pair> starting_pairs(const Survey& survey, const State& state,
                                 const std::vector<std::optional<Eigen::Vector3d>>& directions, int wanted) {
  constexpr double kEnoughParallax = 0.3;
  std::vector<Pair> all;
  const int images = static_cast<int>(survey.images.size());
  for (int a = 0; a < images; ++a) {
    for (int b = a + 1; b < images; ++b) {
      const Sights sights = common_sights(survey, state, directions, a, b);
      if (static_cast<int>(sights.a.size()) < kLeastStartPoints) continue;
      all.push_back({a, b, static_cast<double>(sights.a.size()) * std::min(kEnoughParallax, parallax(sights.a, sights.b))});
    }
  }
  std::stable_sort(all.begin(), all.end(), [](const Pair& x, const Pair& y) { return x.score > y.score; });
  std::vector<int> uses(survey.images.size(), 0);
  std::vector<Pair> chosen;
  for (const Pair& pair : all) {
    if (static_cast<int>(chosen.size()) == wanted) break;
    if (uses[static_cast<std::size_t>(pair.a)] > 1 || uses[static_cast<std::size_t>(pair.b)] > 1) continue;
    ++uses[static_cast<std::size_t>(pair.a)];
    ++uses[static_cast<std::size_t>(pair.b)];
    chosen.push_back(pair);
  }
  return chosen;
}

}  // namespace

Result<State> orient(const Survey& survey, const AdjustOptions& options, const std::vector<std::vector<int>>& free_lens,
                     const base::Progress& progress) {
  const State start = start_state(survey);
  const auto directions = ray_directions(survey, start);
  const std::vector<Pair> pairs = starting_pairs(survey, start, directions, options.start_pairs);
  if (pairs.empty()) {
    return fail(ErrorCode::kNoUniqueSolution,
                "no two images share " + std::to_string(kLeastStartPoints) +
                    " coded markers, so none can be oriented relative to another; take overlapping images or add markers");
  }
  std::optional<State> best;
  double best_sum = std::numeric_limits<double>::infinity();
  std::size_t best_pair = pairs.size();
  for (std::size_t k = 0; k < pairs.size(); ++k) {
    progress("start values", k, pairs.size());
    const Sights sights = common_sights(survey, start, directions, pairs[k].a, pairs[k].b);
    for (const base::Pose& a_from_b : relative_poses(sights.a, sights.b, kLensTolerance_rad)) {
      if (progress.cancelled()) return base::cancelled("the adjustment");
      Growth growth(survey, options, free_lens, progress);
      if (!growth.begin(pairs[k].a, pairs[k].b, a_from_b) || !growth.run()) continue;
      const double sum = growth.truncated_sum();
      const bool confirmed = best_pair != k && best_pair < pairs.size() && std::abs(sum - best_sum) < kSameOutcome * best_sum;
      const bool good = growth.good();
      if (sum < best_sum) {
        best_sum = sum;
        best = growth.state();
        best_pair = k;
      }
      if (!good && !confirmed) continue;
      progress("start values", pairs.size(), pairs.size());
      return *best;
    }
  }
  if (progress.cancelled()) return base::cancelled("the adjustment");
  progress("start values", pairs.size(), pairs.size());
  if (!best) {
    return fail(
        ErrorCode::kNoUniqueSolution,
        "no pair of images has rays that meet at an angle: all images seem to be taken from one projection centre; take "
        "them from different places (and check the focal length and the marker family)");
  }
  return *best;
}

std::optional<State> from_start_values(const Survey& survey, const AdjustOptions& options,
                                       const std::vector<std::vector<int>>& free_lens, const base::Progress& progress) {
  constexpr int kMaxRounds = 10;
  constexpr double kStillFalling = 0.7;
  State state = start_state(survey);
  for (std::size_t i = 0; i < survey.images.size(); ++i) {
    if (!survey.start_poses[i] && !survey.rays_of_image[i].empty()) return std::nullopt;
    state.poses[i] = survey.start_poses[i];
  }
  const auto directions = ray_directions(survey, state);
  for (std::size_t p = 0; p < survey.ids.size(); ++p) {
    state.points[p] = survey.start_points[p];
    if (state.points[p]) continue;
    std::vector<Eigen::Vector3d> origins;
    std::vector<Eigen::Vector3d> sights;
    for (const int r : survey.rays_of_point[p]) {
      const auto& direction = directions[static_cast<std::size_t>(r)];
      if (!direction) continue;
      const base::Pose& pose = *state.poses[static_cast<std::size_t>(survey.rays[static_cast<std::size_t>(r)].image)];
      origins.push_back(pose.translation_mm);
      sights.emplace_back(pose.rotation * *direction);
    }
    if (origins.size() > 1) state.points[p] = nearest_point(origins, sights);
  }
  Growth growth(survey, options, free_lens, progress);
  growth.adopt(state);
  if (growth.good()) return state;
  // Far off: with the lenses as they are, and whatever does not fit counting less and less.
  double before = robust_sigma_px(survey, state);
  for (int round = 0; round < kMaxRounds && std::isfinite(before); ++round) {
    NetworkModel network = build_model(survey, state, {});
    const math::MinimiseOptions how{
        .max_iterations = options.max_iterations, .robust_scale = 2.0 * before, .function_tolerance = 1e-4};
    if (!math::minimise(network.model, how, progress)) return std::nullopt;
    read_back(survey, network, state);
    const double after = robust_sigma_px(survey, state);
    if (after > kStillFalling * before) break;
    before = after;
  }
  growth.adopt(state);
  if (growth.good() || (growth.run() && growth.good())) return growth.state();
  return std::nullopt;
}

Result<> check_connection(const Survey& survey) {
  constexpr int kLink = 3;
  struct Group {
    std::vector<int> images;
    std::vector<int> points;
  };
  std::vector<Group> groups;
  for (std::size_t i = 0; i < survey.images.size(); ++i) {
    Group group{{static_cast<int>(i)}, {}};
    for (const int r : survey.rays_of_image[i]) group.points.push_back(survey.rays[static_cast<std::size_t>(r)].point);
    group.points.erase(std::unique(group.points.begin(), group.points.end()), group.points.end());
    groups.push_back(std::move(group));
  }
  for (bool merged = true; merged;) {
    merged = false;
    for (std::size_t a = 0; a < groups.size(); ++a) {
      for (std::size_t b = a + 1; b < groups.size();) {
        std::vector<int> common;
        std::set_intersection(groups[a].points.begin(), groups[a].points.end(), groups[b].points.begin(),
                              groups[b].points.end(), std::back_inserter(common));
        if (static_cast<int>(common.size()) < kLink) {
          ++b;
          continue;
        }
        std::vector<int> all;
        std::set_union(groups[a].points.begin(), groups[a].points.end(), groups[b].points.begin(), groups[b].points.end(),
                       std::back_inserter(all));
        groups[a].points = std::move(all);
        groups[a].images.insert(groups[a].images.end(), groups[b].images.begin(), groups[b].images.end());
        groups.erase(groups.begin() + static_cast<std::ptrdiff_t>(b));
        merged = true;
      }
    }
  }
  std::stable_sort(groups.begin(), groups.end(),
                   [](const Group& a, const Group& b) { return a.images.size() > b.images.size(); });
  if (groups.size() < 2 || groups[1].images.size() < 2) return {};
  std::string message =
      "the images fall into blocks that share fewer than three markers, so their relative position is not determined:";
  for (std::size_t g = 0; g < groups.size() && groups[g].images.size() > 1; ++g) {
    std::sort(groups[g].images.begin(), groups[g].images.end());
    message += (g == 0 ? " " : "; ") + survey.images[static_cast<std::size_t>(groups[g].images.front())] + " ... " +
               survey.images[static_cast<std::size_t>(groups[g].images.back())] + " (" +
               std::to_string(groups[g].images.size()) + " images)";
  }
  return fail(ErrorCode::kNoUniqueSolution, message + ". Take images that see markers of both");
}

}  // namespace crosstie::bundle::detail
