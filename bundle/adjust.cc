#include "bundle/adjust.h"

#include <algorithm>
#include <cmath>
#include <iterator>

#include <fmt/format.h>

#include "bundle/detail/components.h"
#include "bundle/detail/eccentricity.h"
#include "bundle/detail/estimate.h"
#include "bundle/detail/frame.h"
#include "bundle/detail/outcome.h"
#include "bundle/detail/outliers.h"
#include "bundle/detail/rig.h"
#include "bundle/detail/start.h"
#include "bundle/detail/survey.h"
#include "bundle/detail/triangulate.h"
#include "bundle/detail/uncoded.h"
#include "bundle/detail/weights.h"
#include "math/minimise.h"

namespace crosstie::bundle {
namespace {

using base::ErrorCode;
using base::fail;
using base::Progress;
using base::Result;
using detail::Estimate;
using detail::ModelPlan;
using detail::Reasons;
using detail::State;
using detail::Survey;
using detail::Weights;

constexpr double kAgreement = 10.0;        // robust sigmas within which a ray agrees with a place
constexpr int kMaxRounds = 100;            // of data snooping
constexpr double kCoarse = 1e-2;           // sigmas of the whole network to which it is solved while outliers are told
constexpr double kSettled = 1e-6;          // relative change of the sigmas at which their estimation ends
constexpr double kLeastAngle_rad = 0.035;  // at which most rays must meet for a network to have depth: 2 degrees

/// Which lens parameters are estimated, and what is known of them beforehand.
Result<ModelPlan> lens_plan(const Survey& survey) {
  ModelPlan plan;
  for (const base::NetworkCamera& camera : survey.cameras) {
    const auto names = base::parameter_names(camera.camera.model());
    const Eigen::MatrixXd& cov = camera.camera.covariance();
    std::vector<int> free;
    for (const std::string& name : camera.held) {
      if (std::find(names.begin(), names.end(), name) == names.end()) {
        return fail(ErrorCode::kBadInput, fmt::format("camera {}: its lens model {} has no parameter {}", camera.name,
                                                      base::lens_model_name(camera.camera.model()), name));
      }
    }
    const auto adjustable = static_cast<std::size_t>(base::adjustable_count(camera.camera.model()));
    for (std::size_t k = 0; camera.estimate && k < adjustable; ++k) {
      const bool held = std::find(camera.held.begin(), camera.held.end(), names[k]) != camera.held.end();
      const auto index = static_cast<Eigen::Index>(k);
      const bool known = cov.size() > 0 && cov(index, index) == 0.0;  // a prior without uncertainty
      if (!held && !known) free.push_back(static_cast<int>(k));
    }
    if (cov.size() > 0 && !free.empty()) {
      std::vector<int> known;
      std::copy_if(free.begin(), free.end(), std::back_inserter(known), [&](int k) { return std::isfinite(cov(k, k)); });
      if (!known.empty() && Eigen::MatrixXd(cov(known, known)).llt().info() != Eigen::Success) {
        return fail(ErrorCode::kBadInput,
                    "camera " + camera.name + ": the covariance of its parameters is not positive definite");
      }
      plan.lens_prior.emplace_back(cov);
    } else {
      plan.lens_prior.emplace_back();
    }
    plan.lens_mean.push_back(camera.camera.parameters());
    plan.free_lens.push_back(std::move(free));
  }
  return plan;
}

/// A robust minimum of all that agrees, so that what does not can be told.
Result<> settle_robustly(const Survey& survey, const AdjustOptions& options, const Weights& weights, ModelPlan plan,
                         State& state, const Progress& progress) {
  constexpr double kRobustSigmas = 3.0;
  plan.whitening = weights.whitening();
  detail::NetworkModel network = detail::build_model(survey, state, plan);
  auto summary = math::minimise(
      network.model, {.max_iterations = options.max_iterations, .robust_scale = kRobustSigmas, .function_tolerance = 1e-8},
      progress);
  if (!summary) return fail(std::move(summary));
  detail::read_back(survey, network, state);
  state.iterations += summary->iterations;
  return {};
}

/// Least squares, weights and data snooping in turn until nothing changes.
Result<Estimate> snoop(const Survey& survey, const AdjustOptions& options, Weights& weights, ModelPlan& plan, State& state,
                       Reasons& reasons, const Progress& progress) {
  for (int round = 0; round < kMaxRounds; ++round) {
    progress("outliers", static_cast<std::size_t>(round), kMaxRounds);
    detail::prune(survey, options, state, reasons);
    plan.whitening = weights.whitening();
    auto at = detail::estimate(survey, state, plan, {options.max_iterations, kCoarse}, progress);
    if (!at) return at;
    const double change = weights.update(survey, *at, false);
    if (change > 1e-3 && round + 1 < kMaxRounds) {
      if (change > 0.02) continue;  // sigmas first, they decide what is an outlier
      plan.whitening = weights.whitening();
      at = detail::estimate(survey, state, plan, {options.max_iterations, kCoarse}, progress);
      if (!at) return at;
    }
    if (!options.reject_outliers || detail::reject_largest(survey, options, *at, state) == 0) {
      progress("outliers", kMaxRounds, kMaxRounds);
      return at;
    }
  }
  return fail(ErrorCode::kNoUniqueSolution,
              "the rejection of outliers does not come to an end; most observations contradict each other");
}

/// Data snooping of the image points reduced to circle centres; what was rejected and fits after all is taken back.
Result<Estimate> snoop_all(Survey& survey, const AdjustOptions& options, Weights& weights, ModelPlan& plan, State& state,
                           Reasons& reasons, const Progress& progress) {
  detail::reduce_to_circle_centres(survey, state);
  auto at = snoop(survey, options, weights, plan, state, reasons, progress);
  if (!at) return at;
  detail::reduce_to_circle_centres(survey, state);
  if (!options.reject_outliers) return at;
  const auto w = detail::standardised_of_rays(survey, state, *at, weights);
  if (detail::readmit(survey, options, w, at->sigma0(), at->redundancy, reasons, state) == 0) return at;
  return snoop(survey, options, weights, plan, state, reasons, progress);
}

/// Least squares with the variance component in balance.
Result<Estimate> settle_weights(const Survey& survey, const AdjustOptions& options, Weights& weights, ModelPlan& plan,
                                State& state, const Progress& progress) {
  constexpr int kMaxUpdates = 30;
  if (!weights.estimated()) {
    plan.whitening = weights.whitening();
    return detail::estimate(survey, state, plan, {options.max_iterations}, progress);
  }
  for (int update = 0;; ++update) {
    plan.whitening = weights.whitening();
    auto at = detail::estimate(survey, state, plan, {options.max_iterations, kCoarse}, progress);
    if (!at || update == kMaxUpdates) return at;
    if (weights.update(survey, *at, false) < kSettled) {
      plan.whitening = weights.whitening();
      return detail::estimate(survey, state, plan, {options.max_iterations}, progress);
    }
  }
}

/// Start values as given where they serve, else from the images alone.
Result<State> start(Survey& survey, const AdjustOptions& options, const std::vector<std::vector<int>>& free_lens,
                    const Progress& progress) {
  if (auto given = detail::from_start_values(survey, options, free_lens, progress)) return std::move(*given);
  const bool none =
      std::none_of(survey.start_poses.begin(), survey.start_poses.end(), [](const auto& pose) { return pose.has_value(); });
  if (!none && !progress.cancelled()) {
    survey.warnings.push_back(
        {"start_values_unused", "",
         "the start values that were given do not lead to a network that agrees with the image points, or are "
         "not given of all images; others were found from the images alone"});
  }
  return detail::orient(survey, options, free_lens, progress);
}

/// Deactivates what stands in several places or far from where all the rest expects it.
Result<> tell_outliers(const Survey& survey, const AdjustOptions& options, Weights& weights, const ModelPlan& plan,
                       State& state, Reasons& reasons, const Progress& progress) {
  double robust_px = detail::robust_sigma_px(survey, state);
  detail::sort_out_points(survey, options, std::max(1.0, kAgreement * robust_px), state, reasons);
  detail::prune(survey, options, state, reasons);
  if (auto ok = settle_robustly(survey, options, weights, plan, state, progress); !ok) return ok;
  robust_px = detail::robust_sigma_px(survey, state);
  weights.guess(robust_px);
  detail::sort_out_points(survey, options, kAgreement * robust_px, state, reasons);
  for (std::size_t r = 0; r < survey.rays.size(); ++r) {
    const detail::Ray& ray = survey.rays[r];
    if (state.active[r] && state.knows(ray) && detail::distance_px(survey, state, ray) > kAgreement * robust_px)
      state.active[r] = 0;
  }
  return {};
}

Result<> bring_to_size(const Survey& survey, State& state) {
  const auto scale = detail::scale_factor(survey, state);
  if (!scale) return tl::unexpected(scale.error());
  detail::rescale(state, *scale);
  return {};
}

/// The markers' own size as a second witness of the scale: a length in another unit shows.
Result<> check_dot_diameter(const Survey& survey, const State& state) {
  constexpr double kFarOff = 1.25;  // diameters from ellipses are good to some percent
  if (!survey.dot_diameter_mm || survey.scale_is_free) return {};
  const auto measured = detail::dot_diameter_mm(survey, state);
  if (!measured) return {};
  const double ratio = *measured / *survey.dot_diameter_mm;
  if (ratio < kFarOff && ratio > 1.0 / kFarOff) return {};
  const auto near = [&](double unit) { return std::max(ratio / unit, unit / ratio) < kFarOff; };
  return fail(
      ErrorCode::kBadInput,
      fmt::format("the scale contradicts the markers: their dots measure {:.4g} mm, the job says {:.4g} mm; {}compare the "
                  "lengths that give the scale, and their unit, with dot_diameter_mm",
                  *measured, *survey.dot_diameter_mm,
                  near(1.0 / 25.4)          ? "are the lengths in inches? "
                  : near(1e-3)              ? "are the lengths in metres? "
                  : near(25.4) || near(1e3) ? "is the diameter in another unit? "
                                            : ""));
}

/// The network is only as deep as its rays are apart: a single projection centre gives none.
Result<> check_depth(const Survey& survey, const State& state) {
  std::vector<double> angles;
  for (std::size_t p = 0; p < survey.ids.size(); ++p) {
    std::vector<int> rays;
    for (const int r : survey.rays_of_point[p]) {
      if (state.active[static_cast<std::size_t>(r)] && state.knows(survey.rays[static_cast<std::size_t>(r)])) rays.push_back(r);
    }
    if (rays.size() > 1) angles.push_back(detail::largest_angle(survey, state, rays));
  }
  std::sort(angles.begin(), angles.end());
  if (angles.size() >= 3 && angles[angles.size() / 2] > kLeastAngle_rad) return {};
  return fail(
      ErrorCode::kNoUniqueSolution,
      fmt::format(
          "the rays to the points meet at {:.2f} degrees only (median of {} points): all images seem to be taken from one "
          "projection centre, so depths are not determined; take images from different places",
          angles.empty() ? 0.0 : angles[angles.size() / 2] * 57.29577951308232, angles.size()));
}

}  // namespace

Result<> AdjustOptions::validate() const {
  const auto bad = [](const std::string& what) { return fail(ErrorCode::kUsage, "adjustment options: " + what); };
  if (!(sigma_px > 0.0) || !std::isfinite(sigma_px)) return bad(fmt::format("sigma_px is {}, it must be positive", sigma_px));
  if (model_sigma_px && (!(*model_sigma_px >= 0.0) || !std::isfinite(*model_sigma_px))) {
    return bad(fmt::format("model_sigma_px is {}, it must be 0 or more", *model_sigma_px));
  }
  if (!(significance > 0.0 && significance < 0.5)) return bad(fmt::format("significance is {}, not in (0, 0.5)", significance));
  if (!(min_angle_rad >= 0.0 && min_angle_rad < 1.5))
    return bad(fmt::format("min_angle_rad is {}, not in [0, 1.5)", min_angle_rad));
  if (start_pairs < 1) return bad(fmt::format("start_pairs is {}, it must be 1 or more", start_pairs));
  if (max_iterations < 1) return bad(fmt::format("max_iterations is {}, it must be 1 or more", max_iterations));
  return {};
}

Result<base::AdjustedNetwork> adjust(const base::Network& network, const AdjustOptions& options, const Progress& progress) {
  if (auto ok = options.validate(); !ok) return fail(std::move(ok));
  auto survey = detail::make_survey(network);
  if (!survey) return fail(std::move(survey));
  if (auto ok = detail::check_connection(*survey); !ok) return fail(std::move(ok));
  auto plan = lens_plan(*survey);
  if (!plan) return fail(std::move(plan));

  // Start values, without a scale: those that were given, or from the images alone.
  auto state = start(*survey, options, plan->free_lens, progress);
  if (!state) return fail(std::move(state));
  Reasons reasons(*survey);
  if (auto ok = check_depth(*survey, *state); !ok) return fail(std::move(ok));
  detail::mount_cameras(*survey, *state);

  // What agrees, robustly; what stands in several places; then least squares with data snooping. The scale stays free until
  // all image points that take part are known, so that no bar bends the network while outliers are told.
  Weights weights(*survey, options);
  double robust_px = detail::robust_sigma_px(*survey, *state);
  weights.guess(robust_px);
  if (options.reject_outliers) {
    if (auto ok = tell_outliers(*survey, options, weights, *plan, *state, reasons, progress); !ok) return fail(std::move(ok));
    robust_px = detail::robust_sigma_px(*survey, *state);
  }
  // The network is good enough to tell how far ellipses' centres lie from circles' centres.
  auto at = snoop_all(*survey, options, weights, *plan, *state, reasons, progress);
  if (!at) return fail(std::move(at));
  base::UncodedDots uncoded;
  if (options.uncoded) {
    const auto matches = detail::match_uncoded(network, *survey, *state, *at, weights, options, progress);
    uncoded = detail::summary(matches, *survey);
    if (!matches.targets.empty()) {
      detail::enter_uncoded(matches, *survey, *state, weights, reasons);
      at = snoop_all(*survey, options, weights, *plan, *state, reasons, progress);
      if (!at) return fail(std::move(at));
    }
  }
  if (auto ok = check_depth(*survey, *state); !ok) return fail(std::move(ok));

  // The scale, the frame, and the final adjustment in it.
  if (auto ok = bring_to_size(*survey, *state); !ok) return fail(std::move(ok));
  const bool controlled = !survey->control.empty();
  if (controlled) {
    if (auto ok = detail::move_onto_datum(*survey, *state, false); !ok) return fail(std::move(ok));
  }
  plan->known_sizes = true;
  at = settle_weights(*survey, options, weights, *plan, *state, progress);
  if (!at) return fail(std::move(at));
  std::vector<base::VarianceComponent> components;
  const bool apply = options.variance_components == VarianceComponents::kApply;
  if (apply) {
    auto applied = detail::apply_components(*survey, options, weights, *plan, *state, at, progress);
    if (!applied) return fail(std::move(applied));
    components = *std::move(applied);
  }
  if (at->equations.null_space().cols() == 7) {
    if (auto ok = bring_to_size(*survey, *state); !ok) return fail(std::move(ok));
  }
  if (!controlled && survey->datum.empty()) {
    detail::transform(*state, detail::principal_frame_from_network(*survey, detail::coded_only(*survey, *state)));
  } else if (!controlled) {
    if (auto ok = detail::move_onto_datum(*survey, *state, survey->scale_is_free); !ok) return fail(std::move(ok));
  }
  at = detail::estimate(*survey, *state, *plan, {options.max_iterations}, progress);
  if (!at) return fail(std::move(at));
  if (auto ok = check_dot_diameter(*survey, detail::coded_only(*survey, *state)); !ok) return fail(std::move(ok));
  detail::explain(*survey, *state, kAgreement * robust_px, reasons);
  auto result = detail::make_outcome(*survey, options, *state, *at, weights, reasons);
  if (!result) return result;
  result->uncoded = std::move(uncoded);
  if (options.variance_components == VarianceComponents::kTell) {
    // Where the residuals do not tell them, the adjustment as stated stands without.
    if (auto told = detail::components_of(*survey, *at)) components = *std::move(told);
  }
  result->variance_components = std::move(components);
  result->variance_components_applied = apply;
  detail::diagnose(*survey, *state, weights, *result);
  return result;
}

}  // namespace crosstie::bundle
