#include "calib/calibrate.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "base/parallel.h"
#include "calib/detail/findings.h"
#include "calib/detail/hold_out.h"
#include "calib/detail/ladder.h"
#include "calib/detail/outcome.h"
#include "calib/detail/outliers.h"
#include "calib/detail/start.h"
#include "calib/detail/turned.h"

namespace crosstie::calib {
namespace {

using base::Calibration;
using base::fail;
using base::Progress;
using base::Result;
using detail::Problem;
using detail::State;

/// Of the lens that was chosen: what its folds and halves say.
Result<> validate_halves(const Problem& problem, const CalibrateOptions& options, const State& state,
                         const std::vector<detail::HeldOut>& folds, Calibration& result, const Progress& progress) {
  base::CrossValidation validation;
  for (const auto& fold : folds) validation.folds.push_back(fold.summary);
  for (std::size_t c = 0; c < result.cameras.size(); ++c) {
    result.cameras[c].rms_heldout_px = detail::heldout_rms_px(problem, state, folds, static_cast<int>(c));
  }
  const std::vector<detail::Fold> parts = detail::halves_of(problem, state);
  std::vector<std::optional<detail::HeldOut>> halves(parts.size());
  auto ok = base::parallel_for(parts.size(), options.threads, "odd and even views", progress, [&](std::size_t h) -> Result<> {
    auto held = detail::hold_out(problem, state, parts[h], progress);
    if (held) {
      halves[h] = std::move(*held);
    } else if (held.error().code == base::ErrorCode::kCancelled) {
      return tl::unexpected(held.error());
    }
    return {};
  });
  if (!ok) return ok;
  if (halves.size() == 2 && halves[0] && halves[1]) {
    for (const auto& half : halves) validation.halves.push_back(half->summary);
    detail::compare_halves(problem, *halves[0], *halves[1], validation);
  } else {
    result.warnings.push_back(
        {"not_validated", "",
         "too few images for odd and even halves that each determine the calibration: nothing tells how well "
         "it predicts"});
  }
  result.validation = std::move(validation);
  return {};
}

}  // namespace

Result<> CalibrateOptions::validate() const {
  const auto refuse = [](std::string message) { return fail(base::ErrorCode::kUsage, std::move(message)); };
  if (sigma_px && !(*sigma_px > 0.0 && std::isfinite(*sigma_px))) return refuse("sigma_px must be positive");
  if (folds < 2 || folds > 1000) return refuse(fmt::format("{} folds; from 2 to 1000 are possible", folds));
  if (!(significance > 0.0 && significance < 1.0)) return refuse("significance must lie between 0 and 1");
  if (expected_baseline_mm && !(*expected_baseline_mm > 0.0 && std::isfinite(*expected_baseline_mm))) {
    return refuse("expected_baseline_mm must be positive");
  }
  if (threads < 0) return refuse("threads must not be negative");
  if (lens && *lens == base::LensModel::kAicon) return refuse("the lens model AICON is not calibrated from boards");
  return {};
}

Result<Calibration> calibrate(const BoardViews& views, const CalibrateOptions& options, const Progress& progress) {
  if (auto ok = options.validate(); !ok) return fail(std::move(ok));
  auto problem = detail::make_problem(views);
  if (!problem) return fail(std::move(problem));
  auto state = detail::start(*problem, progress);
  if (!state) return fail(std::move(state));
  detail::change_lens(*state, options.lens && !options.lens->is_splined() ? *options.lens : base::LensModel::kOpenCv5);
  auto at = detail::estimate_without_outliers(*problem, options, *state, progress);
  constexpr int kMaxTurns = 4;
  for (int round = 0; at && round < kMaxTurns && detail::turn_stations(*problem, *state) > 0; ++round) {
    at = detail::estimate_without_outliers(*problem, options, *state, progress);
  }
  if (at && options.lens && options.lens->is_splined()) {
    detail::change_lens(*state, *options.lens);
    at = detail::estimate_without_outliers(*problem, options, *state, progress);
  }
  if (!at) return fail(std::move(at));

  std::vector<detail::LensScore> scores;
  std::vector<detail::HeldOut> folds;
  if (options.cross_validate) {
    const auto models = options.lens ? std::vector{*options.lens} : detail::lens_ladder(*problem, *state);
    auto scored = detail::score_lenses(*problem, options, *state, models, progress);
    if (!scored) return fail(std::move(scored));
    scores = std::move(*scored);
    const int chosen = detail::choose_lens(*problem, scores);
    if (chosen >= 0) {
      auto& score = scores[static_cast<std::size_t>(chosen)];
      folds = std::move(score.folds);
      if (score.trial.lens != state->lens_model) {
        *state = std::move(score.state);
        at = detail::estimate_without_outliers(*problem, options, *state, progress);
        if (!at) return fail(std::move(at));
      }
    }
  }
  auto result = detail::make_outcome(*problem, *state, *at);
  if (!result) return result;
  for (const auto& score : scores) result->ladder.push_back(score.trial);
  if (auto ok = detail::check_baseline(*result, options); !ok) return fail(std::move(ok));
  if (options.cross_validate) {
    if (auto ok = validate_halves(*problem, options, *state, folds, *result, progress); !ok) return fail(std::move(ok));
  }
  detail::add_findings(*problem, *result);
  return result;
}

}  // namespace crosstie::calib
