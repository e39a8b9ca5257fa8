#include "bundle/detail/uncoded.h"

#include <algorithm>
#include <cmath>

#include "bundle/detail/epipolar.h"
#include "bundle/detail/frame.h"
#include "bundle/detail/group_choice.h"

namespace crosstie::bundle::detail {
namespace {

constexpr double kReach = 2.0;  // how far uncoded targets lie from the coded ones' centre, at most, in their radius

Region region_of(const State& state) {
  Region region;
  int count = 0;
  for (const auto& point : state.points) {
    if (!point) continue;
    region.centre += *point;
    ++count;
  }
  region.centre /= std::max(1, count);
  for (const auto& point : state.points) {
    if (point) region.radius_mm = std::max(region.radius_mm, kReach * (*point - region.centre).norm());
  }
  return region;
}

DotScene make_scene(const base::Network& network, const Survey& survey, const State& state, const Estimate& at,
                    const Weights& weights) {
  DotScene scene;
  scene.views = make_views(survey, state, at, weights);
  scene.dots = collect_dots(network, survey, weights, scene.views);
  for (std::size_t i = 0; i < scene.views.size(); ++i) {
    const int width = scene.views[i] ? scene.views[i]->camera.width_px() : 0;
    const int height = scene.views[i] ? scene.views[i]->camera.height_px() : 0;
    scene.grids.emplace_back(scene.dots, static_cast<int>(i), width, height);
  }
  return scene;
}

/// All groups that a seed's neighbours on its epipolar curves give, best supported first, each place once.
std::vector<DotGroup> groups_of(const DotScene& scene, int seed, const std::vector<int>& partners, const Region& region,
                                double min_angle_rad, GroupChoice& choice) {
  const Dot& dot = scene.dots[static_cast<std::size_t>(seed)];
  const View& view = *scene.views[static_cast<std::size_t>(dot.image)];
  std::vector<DotGroup> groups;
  for (const int partner : partners) {
    const auto j = static_cast<std::size_t>(partner);
    for (const Crossing& crossing : crossings(view, dot, *scene.views[j], scene.grids[j], scene.dots, region)) {
      // A pair that a group found so far holds leads to the same place.
      const bool held = std::any_of(groups.begin(), groups.end(), [&](const DotGroup& group) {
        return std::find(group.dots.begin(), group.dots.end(), crossing.dot) != group.dots.end();
      });
      if (held) continue;
      auto group = grow(scene, seed, crossing.dot, crossing.distance_mm, min_angle_rad);
      choice.count_test(seed, crossing.dot);
      if (group) groups.push_back(std::move(*group));
    }
  }
  std::stable_sort(groups.begin(), groups.end(),
                   [](const DotGroup& a, const DotGroup& b) { return a.dots.size() > b.dots.size(); });
  return groups;
}

/// By x of the frame that the coded points alone would give, so that ids grow with it.
void sort_along_frame(const Survey& survey, const State& state, std::vector<DotGroup>& targets) {
  const base::Pose frame_from_network = principal_frame_from_network(survey, state);
  std::stable_sort(targets.begin(), targets.end(), [&](const DotGroup& a, const DotGroup& b) {
    return (frame_from_network * a.place.point).x() < (frame_from_network * b.place.point).x();
  });
}

}  // namespace

UncodedMatches match_uncoded(const base::Network& network, const Survey& survey, const State& state, const Estimate& at,
                             const Weights& weights, const AdjustOptions& options, const base::Progress& progress) {
  const DotScene scene = make_scene(network, survey, state, at, weights);
  const auto partners = partner_images(survey, state, scene.views);
  const Region region = region_of(state);
  GroupChoice choice(scene);
  std::vector<char> settled(scene.dots.size(), 0);
  for (std::size_t d = 0; d < scene.dots.size(); ++d) {
    if (progress.cancelled()) break;  // the next adjustment says so
    if (d % 256 == 0) progress("uncoded dots", d, scene.dots.size());
    const Dot& dot = scene.dots[d];
    if (dot.has_id || settled[d]) continue;
    auto groups = groups_of(scene, static_cast<int>(d), partners[static_cast<std::size_t>(dot.image)], region,
                            options.min_angle_rad, choice);
    if (groups.empty()) continue;
    const std::size_t best = groups.front().dots.size();
    if (groups.size() == 1 || dominates(best, groups[1].dots.size())) {
      for (const int other : groups.front().dots) settled[static_cast<std::size_t>(other)] = 1;
    }
    for (DotGroup& group : groups) choice.add(std::move(group));
  }
  progress("uncoded dots", scene.dots.size(), scene.dots.size());
  UncodedMatches matches;
  matches.fates.assign(scene.dots.size(), DotFate::kUnmatched);
  matches.targets = choice.decide(survey, state, matches.fates);
  sort_along_frame(survey, state, matches.targets);
  matches.dots = scene.dots;
  return matches;
}

int first_uncoded_id(int largest_coded_id) { return std::max(1, (largest_coded_id + 999) / 1000) * 1000 + 1; }

State coded_only(const Survey& survey, State state) {
  for (std::size_t p = survey.coded_points; p < state.points.size(); ++p) state.points[p].reset();
  return state;
}

base::UncodedDots summary(const UncodedMatches& matches, const Survey& survey) {
  base::UncodedDots result;
  result.targets = static_cast<int>(matches.targets.size());
  for (std::size_t d = 0; d < matches.dots.size(); ++d) {
    if (matches.fates[d] == DotFate::kHasId) continue;
    ++result.found;
    if (matches.fates[d] == DotFate::kMatched) {
      ++result.matched;
      continue;
    }
    const Dot& dot = matches.dots[d];
    result.left.push_back(
        {survey.images[static_cast<std::size_t>(dot.image)], dot.centre_px, matches.fates[d] == DotFate::kAmbiguous});
  }
  return result;
}

void enter_uncoded(const UncodedMatches& matches, Survey& survey, State& state, Weights& weights, Reasons& reasons) {
  const auto first_point = survey.ids.size();
  const int first_id = first_uncoded_id(survey.ids.back());
  std::vector<std::vector<Ray>> added(survey.images.size());
  for (std::size_t t = 0; t < matches.targets.size(); ++t) {
    const DotGroup& target = matches.targets[t];
    survey.ids.push_back(first_id + static_cast<int>(t));
    survey.rays_of_point.emplace_back();
    state.points.emplace_back(target.place.point);
    reasons.point.emplace_back();
    for (const int d : target.dots) {
      const Dot& dot = matches.dots[static_cast<std::size_t>(d)];
      added[static_cast<std::size_t>(dot.image)].push_back({dot.image, static_cast<int>(first_point + t), dot.centre_px,
                                                            dot.detector_cov_px2, dot.size_px, false, dot.centre_px,
                                                            dot.shape_px2});
    }
  }
  // By image, then point: the new points come last in each image.
  std::vector<Ray> rays;
  std::vector<char> active;
  std::vector<std::string> of_ray;
  for (std::size_t i = 0; i < survey.images.size(); ++i) {
    for (const int r : survey.rays_of_image[i]) {
      rays.push_back(std::move(survey.rays[static_cast<std::size_t>(r)]));
      active.push_back(state.active[static_cast<std::size_t>(r)]);
      of_ray.push_back(std::move(reasons.ray[static_cast<std::size_t>(r)]));
    }
    for (Ray& ray : added[i]) {
      rays.push_back(std::move(ray));
      active.push_back(1);
      of_ray.emplace_back();
    }
  }
  survey.rays = std::move(rays);
  state.active = std::move(active);
  reasons.ray = std::move(of_ray);
  for (auto& list : survey.rays_of_image) list.clear();
  for (auto& list : survey.rays_of_point) list.clear();
  for (std::size_t r = 0; r < survey.rays.size(); ++r) {
    survey.rays_of_image[static_cast<std::size_t>(survey.rays[r].image)].push_back(static_cast<int>(r));
    survey.rays_of_point[static_cast<std::size_t>(survey.rays[r].point)].push_back(static_cast<int>(r));
  }
  weights.renew(survey);
}

}  // namespace crosstie::bundle::detail
