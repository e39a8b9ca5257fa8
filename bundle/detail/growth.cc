#include "bundle/detail/growth.h"

#include <algorithm>
#include <cmath>

#include "bundle/detail/resection.h"
#include "bundle/detail/triangulate.h"
#include "math/minimise.h"

namespace crosstie::bundle::detail {
namespace {

constexpr double kStartAngle_rad = 0.026;  // rays of a new point meet at this or more: 1.5 degrees
constexpr double kTruncation_px = 5.0;     // of the sum of squares that compares outcomes
constexpr double kGood_px = 0.3;           // an outcome with this robust sigma that explains nearly all rays is taken
constexpr double kGoodShare = 0.85;

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

}  // namespace

Growth::Growth(const Survey& survey, const AdjustOptions& options, const std::vector<std::vector<int>>& free_lens,
               const base::Progress& progress)
    : survey_(survey), options_(options), free_lens_(free_lens), progress_(progress), state_(start_state(survey)) {
  double focal = 0.0;
  for (const base::NetworkCamera& camera : survey.cameras) focal = std::max(focal, camera.camera.focal_px().maxCoeff());
  widest_px_ = kLensTolerance_rad * focal;
  tolerance_px_ = widest_px_;
}

bool Growth::begin(int image_a, int image_b, const base::Pose& a_from_b) {
  const double length = a_from_b.translation_mm.norm();
  if (!(length > 0.0)) return false;
  state_.poses[static_cast<std::size_t>(image_a)] = base::Pose{};
  state_.poses[static_cast<std::size_t>(image_b)] = base::Pose{a_from_b.rotation, a_from_b.translation_mm * (1000.0 / length)};
  triangulate(Which::kAll);
  return known_points() >= kLeastStartPoints && settle();
}

bool Growth::run() {
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

double Growth::truncated_sum() const {
  double sum = 0.0;
  for (std::size_t r = 0; r < survey_.rays.size(); ++r) {
    if (!state_.active[r]) continue;
    const double distance = state_.knows(survey_.rays[r]) ? distance_px(survey_, state_, survey_.rays[r]) : kTruncation_px;
    sum += std::pow(std::min(distance, kTruncation_px), 2);
  }
  return sum;
}

bool Growth::good() const {
  int all = 0;
  for (const char active : state_.active) all += active;
  return robust_sigma_px(survey_, state_) < kGood_px &&
         truncated_sum() < (1.0 - kGoodShare) * kTruncation_px * kTruncation_px * all;
}

int Growth::oriented() const {
  return static_cast<int>(std::count_if(state_.poses.begin(), state_.poses.end(), [](const auto& p) { return p.has_value(); }));
}

int Growth::known_points() const {
  return static_cast<int>(
      std::count_if(state_.points.begin(), state_.points.end(), [](const auto& p) { return p.has_value(); }));
}

int Growth::most_seeing_image(const std::vector<char>& failed) const {
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

void Growth::triangulate(Which which) {
  if (which == Which::kAll || directions_.empty()) directions_ = ray_directions(survey_, state_);
  for (std::size_t p = 0; p < survey_.ids.size(); ++p) {
    if (which == Which::kUnknown && state_.points[p]) continue;
    std::vector<int> candidates;
    for (const int r : survey_.rays_of_point[p]) {
      const bool has_pose = state_.poses[static_cast<std::size_t>(survey_.rays[static_cast<std::size_t>(r)].image)].has_value();
      if (state_.active[static_cast<std::size_t>(r)] && has_pose) candidates.push_back(r);
    }
    const auto found = detail::triangulate(survey_, state_, directions_, candidates, tolerance_px_, kStartAngle_rad);
    state_.points[p].reset();
    if (found && 2 * found->rays.size() >= candidates.size()) state_.points[p] = found->point;
  }
}

bool Growth::disagrees(int image) const {
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

ModelPlan Growth::lens_plan() const {
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

bool Growth::settle() {
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
  const math::MinimiseOptions how{.max_iterations = std::min(50, options_.max_iterations),
                                  .robust_scale = std::max(0.2, 2.0 * before),
                                  .function_tolerance = 1e-6};
  if (!math::minimise(network.model, how, progress_)) return false;
  read_back(survey_, network, state_);
  directions_ = ray_directions(survey_, state_);
  const double sigma = robust_sigma_px(survey_, state_);
  tolerance_px_ = std::clamp(8.0 * sigma, lens_is_free ? 1.0 : 0.3 * widest_px_, widest_px_);
  return std::isfinite(sigma);
}

}  // namespace crosstie::bundle::detail
