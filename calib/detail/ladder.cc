#include "calib/detail/ladder.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "base/parallel.h"
#include "calib/detail/spline_lens.h"
#include "calib/detail/start.h"

namespace crosstie::calib::detail {
namespace {

using base::fail;
using base::Result;

/// Mean squares of each station held out: its two images share what is wrong with its pose and light.
std::vector<double> station_means(const Problem& problem, const LensScore& score) {
  std::vector<double> sums(problem.stations.size(), 0.0);
  std::vector<double> counts(problem.stations.size(), 0.0);
  for (const HeldOut& fold : score.folds) {
    for (std::size_t v = 0; v < problem.views.size(); ++v) {
      if (fold.square_px2[v] < 0.0) continue;
      const auto s = static_cast<std::size_t>(problem.views[v].station);
      sums[s] += fold.square_px2[v];
      counts[s] += static_cast<double>(problem.views[v].corners.size());
    }
  }
  std::vector<double> means;
  for (std::size_t s = 0; s < sums.size(); ++s) {
    if (counts[s] > 0.0) means.push_back(sums[s] / counts[s]);
  }
  return means;
}

}  // namespace

std::vector<base::LensModel> lens_ladder(const Problem& problem, const State& state) {
  // With a spline the normal equations of both cameras grow tenfold: beyond some thousand corners it is tried on request only.
  constexpr std::size_t kMostCorners = 8'000;
  std::vector<base::LensModel> models = {base::LensModel::kOpenCv4, base::LensModel::kOpenCv5, base::LensModel::kOpenCv8};
  if (problem.corners.size() > kMostCorners) return models;
  if (const auto spline = spline_for(problem, state)) models.push_back(*spline);
  return models;
}

Result<std::vector<LensScore>> score_lenses(const Problem& problem, const CalibrateOptions& options, const State& from,
                                            const std::vector<base::LensModel>& models, const base::Progress& progress) {
  const std::vector<Fold> folds = folds_of(problem, from, options.folds);
  std::vector<LensScore> scores(models.size());
  std::vector<std::vector<std::optional<HeldOut>>> outcomes(models.size());
  // All views first: their values start the folds.
  auto ok = base::parallel_for(models.size(), options.threads, "lens models", progress, [&](std::size_t m) -> Result<> {
    LensScore& score = scores[m];
    score.trial.lens = models[m];
    score.state = from;
    change_lens(score.state, models[m]);
    const auto at = options.sigma_px ? estimate(problem, score.state, {}, 1e-6, progress)
                                     : estimate_with_sigma(problem, score.state, {}, progress);
    if (!at) {
      if (at.error().code == base::ErrorCode::kCancelled) return tl::unexpected(at.error());
      score.trial.failure = at.error().message;
      return {};
    }
    double square = 0.0;
    int count = 0;
    for (std::size_t c = 0; c < problem.corners.size(); ++c) {
      if (!score.state.active[c] || !score.state.takes_part(problem.corners[c].view)) continue;
      square += std::pow(distance_px(problem, score.state, problem.corners[c]), 2);
      ++count;
    }
    score.trial.rms_px = std::sqrt(square / std::max(1, count));
    return {};
  });
  if (!ok) return fail(std::move(ok));
  for (auto& of : outcomes) of.resize(folds.size());
  ok = base::parallel_for(models.size() * folds.size(), options.threads, "cross-validation", progress,
                          [&](std::size_t task) -> Result<> {
                            const std::size_t m = task / folds.size();
                            const std::size_t k = task % folds.size();
                            if (!scores[m].trial.failure.empty()) return {};
                            auto held = hold_out(problem, scores[m].state, folds[k], progress);
                            if (held) {
                              outcomes[m][k] = std::move(*held);
                            } else if (held.error().code == base::ErrorCode::kCancelled) {
                              return tl::unexpected(held.error());
                            }
                            return {};
                          });
  if (!ok) return fail(std::move(ok));
  for (std::size_t m = 0; m < models.size(); ++m) {
    LensScore& score = scores[m];
    for (std::size_t k = 0; k < folds.size() && score.trial.failure.empty(); ++k) {
      if (outcomes[m][k]) {
        score.folds.push_back(std::move(*outcomes[m][k]));
      } else {
        score.trial.failure = "part " + folds[k].name + " of the views does not determine it";
      }
    }
    if (!score.trial.failure.empty()) {
      score.folds.clear();
    } else {
      score.trial.rms_heldout_px = heldout_rms_px(problem, score.state, score.folds, -1);
    }
  }
  return scores;
}

int choose_lens(const Problem& problem, std::vector<LensScore>& scores) {
  int best = -1;
  for (std::size_t m = 0; m < scores.size(); ++m) {
    if (!scores[m].trial.failure.empty()) continue;
    if (best < 0 || scores[m].trial.rms_heldout_px < scores[static_cast<std::size_t>(best)].trial.rms_heldout_px) {
      best = static_cast<int>(m);
    }
  }
  if (best < 0) return best;
  const std::vector<double> least = station_means(problem, scores[static_cast<std::size_t>(best)]);
  int chosen = -1;
  for (std::size_t m = 0; m < scores.size(); ++m) {
    LensScore& score = scores[m];
    if (!score.trial.failure.empty()) continue;
    const std::vector<double> means = station_means(problem, score);
    const auto count = static_cast<double>(means.size());
    double mean = 0.0;
    double square = 0.0;
    for (std::size_t s = 0; s < means.size(); ++s) mean += (means[s] - least[s]) / count;
    for (std::size_t s = 0; s < means.size(); ++s) square += std::pow(means[s] - least[s] - mean, 2);
    const double sigma = count > 1.0 ? std::sqrt(square / (count - 1.0) / count) : 0.0;
    score.trial.worse_by_sigmas = static_cast<int>(m) == best ? 0.0 : mean / std::max(sigma, 1e-300);
    if (chosen < 0 && score.trial.worse_by_sigmas <= 1.0) chosen = static_cast<int>(m);
  }
  scores[static_cast<std::size_t>(chosen)].trial.chosen = true;
  return chosen;
}

}  // namespace crosstie::calib::detail
