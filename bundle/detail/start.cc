#include "bundle/detail/start.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "bundle/detail/minimise.h"
#include "bundle/detail/network_model.h"
#include "bundle/detail/resection.h"
#include "bundle/detail/triangulate.h"
#include "bundle/detail/two_view.h"

namespace crosstie::bundle::detail {
namespace {

using base::Error;
using base::ErrorCode;
using base::fail;
using base::Result;

constexpr int kLeastCommon = 6;            // points in a starting pair
constexpr double kLensTolerance = 0.02;    // what an unknown lens may bend a direction by, and what a guess of f leaves [rad]
constexpr double kStartAngle_rad = 0.026;  // rays of a new point meet at this or more: 1.5 degrees
constexpr double kTruncation_px = 5.0;     // of the sum of squares that compares outcomes
constexpr double kGood_px = 0.3;           // an outcome with this robust sigma that explains nearly all rays is taken
constexpr double kGoodShare = 0.85;
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
      if (static_cast<int>(sights.a.size()) < kLeastCommon) continue;
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

/// How far the parameters of a lens may lie from their start values.
Eigen::VectorXd start_sigmas(const base::Camera& start) {
  constexpr double kFocal = 0.1;    // of itself
  constexpr double kCentre = 0.03;  // of the image's longer side
  constexpr double kRadial = 0.3;   // in units of the focal length, as are the next
  constexpr double kTangential = 0.02;
  const Eigen::VectorXd& p = start.parameters();
  if (start.model() == base::LensModel::kAicon) {
    const double c = p(0);
    Eigen::VectorXd sigma = Eigen::VectorXd::Zero(p.size());
    sigma.head<10>() << kFocal * c, Eigen::Vector2d::Constant(kCentre * p.segment<2>(11).maxCoeff()), kRadial / std::pow(c, 2),
        kRadial / std::pow(c, 4), kRadial / std::pow(c, 6), Eigen::Vector2d::Constant(kTangential / c),
        Eigen::Vector2d::Constant(kTangential);
    return sigma;
  }
  Eigen::VectorXd sigma = Eigen::VectorXd::Constant(p.size(), kRadial);
  sigma.head<2>() = kFocal * p.head<2>();
  sigma.segment<2>(2).setConstant(kCentre * std::max(start.width_px(), start.height_px()));
  if (p.size() > 6) sigma.segment<2>(6).setConstant(kTangential);
  return sigma;
}

/// Focal length and first radial term, which few images can tell.
bool told_early(base::LensModel model, int parameter) {
  if (model == base::LensModel::kAicon) return parameter == 0 || parameter == 3;
  return parameter < 2 || parameter == 4;
}

/// One attempt at building the network up from a pair of images.
class Growth {
 public:
  Growth(const Survey& survey, const AdjustOptions& options, const std::vector<std::vector<int>>& free_lens,
         const base::Progress& progress)
      : survey_(survey), options_(options), free_lens_(free_lens), progress_(progress), state_(start_state(survey)) {
    double focal = 0.0;
    for (const base::NetworkCamera& camera : survey.cameras) focal = std::max(focal, camera.camera.focal_px().maxCoeff());
    widest_px_ = kLensTolerance * focal;
    tolerance_px_ = widest_px_;
  }

  /// False where the pair gives too few points to go on.
  bool begin(const Pair& pair, const base::Pose& a_from_b) {
    const double length = a_from_b.translation_mm.norm();
    if (!(length > 0.0)) return false;
    state_.poses[static_cast<std::size_t>(pair.a)] = base::Pose{};
    state_.poses[static_cast<std::size_t>(pair.b)] = base::Pose{a_from_b.rotation, a_from_b.translation_mm * (1000.0 / length)};
    triangulate(Which::kAll);
    return known_points() >= kLeastCommon && settle();
  }

  /// Takes over a network that was found otherwise.
  void adopt(const State& state) { state_ = state; }

  /// Orients all images that can be; false where it was cancelled or fell apart.
  bool run() {
    int settled_at = 2;
    std::vector<char> failed(survey_.images.size(), 0);
    for (;;) {
      if (progress_.cancelled()) return false;
      const int next = most_seeing_image(failed);
      if (next < 0) break;
      const auto resection = resect(survey_, state_, directions_, next, tolerance_px_);
      if (!resection) {
        failed[static_cast<std::size_t>(next)] = 1;
        continue;
      }
      state_.poses[static_cast<std::size_t>(next)] = resection->network_from_camera;
      triangulate(Which::kUnknown);
      if (oriented() >= settled_at + std::max(1, settled_at / 4)) {
        triangulate(Which::kAll);
        if (!settle()) return false;
        settled_at = oriented();
        std::fill(failed.begin(), failed.end(), char{0});
      }
    }
    // With the lens known better: once more all points, and the images that failed.
    for (int round = 0; round < 2; ++round) {
      if (!settle()) return false;
      triangulate(Which::kAll);
      bool more = false;
      for (std::size_t i = 0; i < survey_.images.size(); ++i) {
        if (state_.poses[i] && !disagrees(static_cast<int>(i))) continue;
        const auto resection = resect(survey_, state_, directions_, static_cast<int>(i), tolerance_px_);
        if (!resection) continue;
        state_.poses[i] = resection->network_from_camera;
        more = true;
      }
      if (more) triangulate(Which::kAll);
    }
    return settle();
  }

  [[nodiscard]] const State& state() const { return state_; }

  [[nodiscard]] double truncated_sum() const {
    double sum = 0.0;
    for (std::size_t r = 0; r < survey_.rays.size(); ++r) {
      if (!state_.active[r]) continue;
      const double distance = state_.knows(survey_.rays[r]) ? distance_px(survey_, state_, survey_.rays[r]) : kTruncation_px;
      sum += std::pow(std::min(distance, kTruncation_px), 2);
    }
    return sum;
  }

  [[nodiscard]] bool good() const {
    int all = 0;
    for (const char active : state_.active) all += active;
    return robust_sigma_px(survey_, state_) < kGood_px &&
           truncated_sum() < (1.0 - kGoodShare) * kTruncation_px * kTruncation_px * all;
  }

 private:
  [[nodiscard]] int oriented() const {
    return static_cast<int>(
        std::count_if(state_.poses.begin(), state_.poses.end(), [](const auto& p) { return p.has_value(); }));
  }
  [[nodiscard]] int known_points() const {
    return static_cast<int>(
        std::count_if(state_.points.begin(), state_.points.end(), [](const auto& p) { return p.has_value(); }));
  }

  [[nodiscard]] int most_seeing_image(const std::vector<char>& failed) const {
    int best = -1;
    int most = 3;
    for (std::size_t i = 0; i < survey_.images.size(); ++i) {
      if (state_.poses[i] || failed[i]) continue;
      int seen = 0;
      for (const int r : survey_.rays_of_image[i]) {
        const Ray& ray = survey_.rays[static_cast<std::size_t>(r)];
        seen += state_.active[static_cast<std::size_t>(r)] && state_.points[static_cast<std::size_t>(ray.point)] ? 1 : 0;
      }
      if (seen > most) {
        most = seen;
        best = static_cast<int>(i);
      }
    }
    return best;
  }

  enum class Which { kUnknown, kAll };

  void triangulate(Which which) {
    if (which == Which::kAll || directions_.empty()) directions_ = ray_directions(survey_, state_);
    for (std::size_t p = 0; p < survey_.ids.size(); ++p) {
      if (which == Which::kUnknown && state_.points[p]) continue;
      std::vector<int> candidates;
      for (const int r : survey_.rays_of_point[p]) {
        const bool has_pose =
            state_.poses[static_cast<std::size_t>(survey_.rays[static_cast<std::size_t>(r)].image)].has_value();
        if (state_.active[static_cast<std::size_t>(r)] && has_pose) candidates.push_back(r);
      }
      const auto found = detail::triangulate(survey_, state_, directions_, candidates, tolerance_px_, kStartAngle_rad);
      state_.points[p].reset();
      if (found && 2 * found->rays.size() >= candidates.size()) state_.points[p] = found->point;
    }
  }

  /// Whether an image got into a wrong pose: half of its rays miss their points.
  [[nodiscard]] bool disagrees(int image) const {
    int known = 0;
    int agreeing = 0;
    for (const int r : survey_.rays_of_image[static_cast<std::size_t>(image)]) {
      const Ray& ray = survey_.rays[static_cast<std::size_t>(r)];
      if (!state_.active[static_cast<std::size_t>(r)] || !state_.points[static_cast<std::size_t>(ray.point)]) continue;
      ++known;
      agreeing += distance_px(survey_, state_, ray) < tolerance_px_ ? 1 : 0;
    }
    return 2 * agreeing < known;
  }

  /// Lens parameters by what the images of a camera can carry, about their start values.
  [[nodiscard]] ModelPlan lens_plan() const {
    ModelPlan plan;
    std::vector<int> images(survey_.cameras.size(), 0);
    for (std::size_t i = 0; i < survey_.images.size(); ++i) {
      if (state_.poses[i]) ++images[static_cast<std::size_t>(survey_.camera_of_image[i])];
    }
    for (std::size_t c = 0; c < survey_.cameras.size(); ++c) {
      const base::Camera& start = survey_.cameras[c].camera;
      std::vector<int> free;
      for (const int k : free_lens_[c]) {
        if (images[c] >= 6 || (images[c] >= 3 && told_early(start.model(), k))) free.push_back(k);
      }
      plan.free_lens.push_back(std::move(free));
      plan.lens_prior.emplace_back(start_sigmas(start).cwiseAbs2().asDiagonal());
      plan.lens_mean.push_back(start.parameters());
    }
    return plan;
  }

  /// A robust bundle over the rays that agree, then a tolerance to match.
  bool settle() {
    const ModelPlan plan = lens_plan();
    bool lens_is_free = false;
    for (const auto& free : plan.free_lens) lens_is_free = lens_is_free || static_cast<int>(free.size()) > 3;
    State agreeing = state_;
    for (std::size_t r = 0; r < survey_.rays.size(); ++r) {
      if (!agreeing.active[r] || !agreeing.knows(survey_.rays[r])) continue;
      if (distance_px(survey_, agreeing, survey_.rays[r]) > 2.0 * tolerance_px_) agreeing.active[r] = 0;
    }
    NetworkModel network = build_model(survey_, agreeing, plan);
    const double before = robust_sigma_px(survey_, agreeing);
    const MinimiseOptions how{.max_iterations = std::min(50, options_.max_iterations),
                              .robust_scale = std::max(0.2, 2.0 * before),
                              .function_tolerance = 1e-6};
    if (!minimise(network.model, how, progress_)) return false;
    read_back(survey_, network, state_);
    directions_ = ray_directions(survey_, state_);
    const double sigma = robust_sigma_px(survey_, state_);
    tolerance_px_ = std::clamp(8.0 * sigma, lens_is_free ? 1.0 : 0.3 * widest_px_, widest_px_);
    return std::isfinite(sigma);
  }

  const Survey& survey_;
  const AdjustOptions& options_;
  const std::vector<std::vector<int>>& free_lens_;
  const base::Progress& progress_;
  State state_;
  std::vector<std::optional<Eigen::Vector3d>> directions_;
  double widest_px_ = 0.0;
  double tolerance_px_ = 0.0;
};

}  // namespace

double robust_sigma_px(const Survey& survey, const State& state) {
  std::vector<double> residuals;
  for (std::size_t r = 0; r < survey.rays.size(); ++r) {
    if (!state.active[r] || !state.knows(survey.rays[r])) continue;
    const auto pixel = predicted_px(survey, state, survey.rays[r]);
    if (!pixel) continue;
    residuals.push_back(std::abs(pixel->x() - survey.rays[r].measured_px.x()));
    residuals.push_back(std::abs(pixel->y() - survey.rays[r].measured_px.y()));
  }
  if (residuals.empty()) return std::numeric_limits<double>::infinity();
  const auto middle = residuals.begin() + static_cast<std::ptrdiff_t>(residuals.size() / 2);
  std::nth_element(residuals.begin(), middle, residuals.end());
  return 1.4826 * *middle;
}

Result<State> orient(const Survey& survey, const AdjustOptions& options, const std::vector<std::vector<int>>& free_lens,
                     const base::Progress& progress) {
  const State start = start_state(survey);
  const auto directions = ray_directions(survey, start);
  const std::vector<Pair> pairs = starting_pairs(survey, start, directions, options.start_pairs);
  if (pairs.empty()) {
    return fail(ErrorCode::kNoUniqueSolution,
                "no two images share " + std::to_string(kLeastCommon) +
                    " coded markers, so none can be oriented relative to another; take overlapping images or add markers");
  }
  std::optional<State> best;
  double best_sum = std::numeric_limits<double>::infinity();
  std::size_t best_pair = pairs.size();
  for (std::size_t k = 0; k < pairs.size(); ++k) {
    progress("start values", k, pairs.size());
    const Sights sights = common_sights(survey, start, directions, pairs[k].a, pairs[k].b);
    for (const base::Pose& a_from_b : relative_poses(sights.a, sights.b, kLensTolerance)) {
      if (progress.cancelled()) return base::cancelled("the adjustment");
      Growth growth(survey, options, free_lens, progress);
      if (!growth.begin(pairs[k], a_from_b) || !growth.run()) continue;
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
    const MinimiseOptions how{
        .max_iterations = options.max_iterations, .robust_scale = 2.0 * before, .function_tolerance = 1e-4};
    if (!minimise(network.model, how, progress)) return std::nullopt;
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
