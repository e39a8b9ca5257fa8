#include "bundle/detail/group_choice.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>

#include <Eigen/Eigenvalues>
#include <Eigen/LU>

#include "bundle/detail/eccentricity.h"
#include "bundle/detail/uncoded.h"

namespace crosstie::bundle::detail {
namespace {

constexpr int kLeastDirections = 3;
constexpr double kApart_rad = 0.087;       // 5 degrees
constexpr double kChance = 1e-3;           // groups by chance in the whole network
constexpr double kGate2 = 18.421;          // chi-square of two degrees of freedom at 1 - 1e-4, as in grow()
constexpr std::size_t kWellSupported = 5;  // dots
constexpr double kSizeOfOthers = 0.2;      // logarithm of a ratio of radii
constexpr double kFromBehind = -0.1;       // cosine; ellipses tell a normal to some degrees only

double log_choose(int n, int k) { return std::lgamma(n + 1.0) - std::lgamma(k + 1.0) - std::lgamma(n - k + 1.0); }

}  // namespace

bool dominates(std::size_t more, std::size_t fewer) { return more >= fewer + std::max<std::size_t>(2, more / 4); }

bool GroupChoice::is_same_target(const DotGroup& a, const DotGroup& b) const {
  const Eigen::Vector3d apart = a.place.point - b.place.point;
  if (a.radius_mm > 0.0 && b.radius_mm > 0.0) return apart.norm() < std::min(a.radius_mm, b.radius_mm);
  constexpr double kGate3 = 21.108;  // chi-square of three degrees of freedom at 1 - 1e-4
  return apart.dot((a.place.cov_mm2 + b.place.cov_mm2).inverse() * apart) < kGate3;
}

void GroupChoice::add(DotGroup group) {
  std::vector<int> rivals;
  for (const int d : group.dots) {
    const auto& claims = claims_[static_cast<std::size_t>(d)];
    rivals.insert(rivals.end(), claims.begin(), claims.end());
  }
  std::sort(rivals.begin(), rivals.end());
  rivals.erase(std::unique(rivals.begin(), rivals.end()), rivals.end());
  for (const int rival : rivals) {
    const auto r = static_cast<std::size_t>(rival);
    if (!alive_[r] || !is_same_target(groups_[r], group)) continue;
    if (groups_[r].dots.size() >= group.dots.size()) return;
    alive_[r] = 0;
  }
  for (const int d : group.dots) claims_[static_cast<std::size_t>(d)].push_back(static_cast<int>(groups_.size()));
  groups_.push_back(std::move(group));
  alive_.push_back(1);
}

std::vector<int> GroupChoice::free_dots(const DotGroup& group) const {
  std::vector<int> dots;
  for (const int d : group.dots) {
    if (owners_[static_cast<std::size_t>(d)] == Owner::kNobody) dots.push_back(d);
  }
  return dots;
}

std::vector<int> GroupChoice::own_dots(std::size_t group) const {
  std::vector<int> dots;
  for (const int d : groups_[group].dots) {
    if (owners_[static_cast<std::size_t>(d)] != Owner::kNobody) continue;
    const auto& claims = claims_[static_cast<std::size_t>(d)];
    const bool own = std::all_of(claims.begin(), claims.end(), [&](int rival) {
      const auto r = static_cast<std::size_t>(rival);
      return r == group || !alive_[r] || dominates(support_[group], support_[r]);
    });
    if (own) dots.push_back(d);
  }
  return dots;
}

bool GroupChoice::is_seen_from_enough(const DotGroup& group, const std::vector<int>& dots) const {
  return count_directions(scene_, dots, group.place.point, kApart_rad) >= kLeastDirections;
}

bool GroupChoice::is_no_chance(const DotGroup& group, const std::vector<int>& dots, const Chance& chance) const {
  const int directions = count_directions(scene_, dots, group.place.point, kApart_rad);
  double gate_px2 = 0.0;
  for (const int d : dots) {
    const Dot& dot = scene_.dots[static_cast<std::size_t>(d)];
    // A prediction is about as uncertain as a dot, at most.
    gate_px2 += std::numbers::pi * kGate2 * 2.0 * std::sqrt(dot.cov_px2.determinant()) / static_cast<double>(dots.size());
  }
  const double hit = std::min(1.0, chance.free_per_px2 * gate_px2);
  if (!(hit > 0.0) || !(chance.tests > 0.0)) return true;
  const double expected = std::log(chance.tests) + log_choose(std::max(group.visible, directions) - 2, directions - 2) +
                          (directions - 2) * std::log(hit);
  return expected < std::log(kChance);
}

bool GroupChoice::faces_its_cameras(const Survey& survey, const State& state, const DotGroup& group) const {
  std::vector<SeenEllipse> ellipses;
  for (const int d : group.dots) {
    const Dot& dot = scene_.dots[static_cast<std::size_t>(d)];
    if (dot.size_px > 0.0) ellipses.push_back({dot.image, dot.shape_px2});
  }
  const auto circle = circle_of(survey, state, ellipses, group.place.point);
  if (!circle) return true;  // nothing is known of its normal
  const Eigen::Vector3d normal = Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(*circle).eigenvectors().col(0);
  double least = 1.0;
  double most = -1.0;
  for (const int d : group.dots) {
    const View& view = *scene_.views[static_cast<std::size_t>(scene_.dots[static_cast<std::size_t>(d)].image)];
    const double cosine = normal.dot((view.centre - group.place.point).normalized());
    least = std::min(least, cosine);
    most = std::max(most, cosine);
  }
  return least > kFromBehind || -most > kFromBehind;
}

bool GroupChoice::has_known_size(const DotGroup& group, const std::vector<DotGroup>& accepted) const {
  if (group.dots.size() >= kWellSupported || group.radius_mm == 0.0) return true;
  bool any = false;
  for (const DotGroup& other : accepted) {
    if (other.dots.size() < kWellSupported || other.radius_mm == 0.0) continue;
    any = true;
    if (std::abs(std::log(other.radius_mm / group.radius_mm)) < kSizeOfOthers) return true;
  }
  return !any;
}

GroupChoice::Chance GroupChoice::chance() const {
  const auto is_free = [&](int d) { return owners_[static_cast<std::size_t>(d)] == Owner::kNobody; };
  Chance chance;
  for (const auto& [a, b] : tests_) chance.tests += is_free(a) && is_free(b) ? 1.0 : 0.0;
  double area_px2 = 0.0;
  for (const auto& view : scene_.views) {
    if (view) area_px2 += static_cast<double>(view->camera.width_px()) * view->camera.height_px();
  }
  double free = 0.0;
  for (std::size_t d = 0; d < scene_.dots.size(); ++d) {
    free += !scene_.dots[d].has_id && is_free(static_cast<int>(d)) ? 1.0 : 0.0;
  }
  chance.free_per_px2 = area_px2 > 0.0 ? free / area_px2 : 0.0;
  return chance;
}

std::vector<DotGroup> GroupChoice::decide(const Survey& survey, const State& state, std::vector<DotFate>& fates) {
  owners_.assign(scene_.dots.size(), Owner::kNobody);
  support_.assign(groups_.size(), 0);
  for (std::size_t g = 0; g < groups_.size(); ++g) alive_[g] = alive_[g] && faces_its_cameras(survey, state, groups_[g]);
  std::vector<DotGroup> accepted;
  for (bool changed = true; changed;) {
    changed = false;
    std::vector<std::size_t> order;
    for (std::size_t g = 0; g < groups_.size(); ++g) {
      if (!alive_[g]) continue;
      const std::vector<int> dots = free_dots(groups_[g]);
      support_[g] = dots.size();
      alive_[g] = is_seen_from_enough(groups_[g], dots);
      if (alive_[g]) order.push_back(g);
    }
    std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return support_[a] > support_[b]; });
    const Chance by_chance = chance();
    for (const std::size_t g : order) {
      if (free_dots(groups_[g]).size() != support_[g]) continue;  // lost some in this round: judged anew in the next
      const std::vector<int> own = own_dots(g);
      if (own.size() < 3 || !is_seen_from_enough(groups_[g], own) || !is_no_chance(groups_[g], own, by_chance)) continue;
      DotGroup target = groups_[g];
      target.dots = own;
      if (!has_known_size(target, accepted)) continue;
      const auto place = locate(scene_, own, target.place.point);
      if (!place) continue;
      target.place = *place;
      for (const int d : groups_[g].dots) {
        Owner& owner = owners_[static_cast<std::size_t>(d)];
        if (owner == Owner::kNobody) owner = Owner::kContested;
      }
      for (const int d : own) owners_[static_cast<std::size_t>(d)] = Owner::kTaken;
      accepted.push_back(std::move(target));
      alive_[g] = 0;
      changed = true;
    }
  }
  for (std::size_t d = 0; d < fates.size(); ++d) {
    const auto& claims = claims_[d];
    const bool claimed = std::any_of(claims.begin(), claims.end(), [&](int g) { return alive_[static_cast<std::size_t>(g)]; });
    fates[d] = scene_.dots[d].has_id                        ? DotFate::kHasId
               : owners_[d] == Owner::kTaken                ? DotFate::kMatched
               : owners_[d] == Owner::kContested || claimed ? DotFate::kAmbiguous
                                                            : DotFate::kUnmatched;
  }
  return accepted;
}

}  // namespace crosstie::bundle::detail
