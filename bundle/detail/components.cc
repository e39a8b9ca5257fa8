#include "bundle/detail/components.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "math/variance_components.h"

namespace crosstie::bundle::detail {
namespace {

using base::fail;
using base::Result;
using base::VarianceComponent;

/// Which group each group of rows belongs to: a camera, then bars, then control points; -1 for others.
std::vector<int> component_of_rows(const Survey& survey, const Estimate& at) {
  const auto cameras = static_cast<int>(survey.cameras.size());
  std::vector<int> result;
  for (int g = 0; g < at.rows.group_count(); ++g) {
    const auto group = static_cast<std::size_t>(g);
    const int ray = at.network.ray_of_group[group];
    if (ray >= 0) {
      const int image = survey.rays[static_cast<std::size_t>(ray)].image;
      result.push_back(survey.camera_of_image[static_cast<std::size_t>(image)]);
    } else {
      result.push_back(at.network.bar_of_group[group] >= 0       ? cameras
                       : at.network.control_of_group[group] >= 0 ? cameras + 1
                                                                 : -1);
    }
  }
  return result;
}

VarianceComponent component(std::string group, const math::VarianceFactor& factor) {
  VarianceComponent result{.group = std::move(group), .observations = factor.observations, .redundancy = factor.redundancy};
  result.estimated = factor.estimated;
  if (!factor.estimated) return result;
  result.sigma_ratio = std::sqrt(factor.factor);
  result.sigma = 0.5 * factor.sigma / result.sigma_ratio;
  result.low = std::sqrt(factor.low());
  result.high = std::sqrt(factor.high());
  result.p = factor.probability_if_one();
  return result;
}

}  // namespace

Result<std::vector<VarianceComponent>> components_of(const Survey& survey, const Estimate& at) {
  if (at.redundancy <= 0) return {};
  const auto cameras = survey.cameras.size();
  const auto factors = math::variance_components(at.equations.parameters(), at.rows, at.equations.null_space(),
                                                 component_of_rows(survey, at), static_cast<int>(cameras) + 2);
  if (!factors) return tl::unexpected(factors.error());
  std::vector<VarianceComponent> result;
  for (std::size_t i = 0; i < factors->size(); ++i) {
    if ((*factors)[i].observations == 0) continue;
    result.push_back(component(i < cameras    ? "image points " + survey.cameras[i].name
                               : i == cameras ? "scale bars"
                                              : "control points",
                               (*factors)[i]));
  }
  return result;
}

Result<std::vector<VarianceComponent>> apply_components(const Survey& survey, const AdjustOptions& options, Weights& weights,
                                                        ModelPlan& plan, State& state, Result<Estimate>& at,
                                                        const base::Progress& progress) {
  constexpr int kMaxRounds = 20;     // three are usual: the estimate is that of a linear model
  constexpr double kSettled = 1e-4;  // far below the sigma of any ratio
  std::vector<VarianceComponent> total;
  for (int round = 0; round < kMaxRounds; ++round) {
    auto now = components_of(survey, *at);
    if (!now || now->empty()) return now;
    double change = 0.0;
    for (std::size_t i = 0; i < now->size(); ++i) {
      VarianceComponent& of = (*now)[i];
      const double ratio = of.sigma_ratio;
      change = std::max(change, std::abs(ratio - 1.0));
      const double before = total.empty() ? 1.0 : total[i].sigma_ratio;
      const double first_p = total.empty() ? of.p : total[i].p;
      for (double* value : {&of.sigma_ratio, &of.sigma, &of.low, &of.high}) *value *= before;
      of.p = first_p;
      if (of.group == "scale bars") {
        plan.bar_ratio *= ratio;
      } else if (of.group == "control points") {
        plan.control_ratio *= ratio;
      } else {
        for (std::size_t c = 0; c < survey.cameras.size(); ++c) {
          if (of.group == "image points " + survey.cameras[c].name) weights.scale(static_cast<int>(c), ratio);
        }
      }
    }
    total = *std::move(now);
    plan.whitening = weights.whitening();
    at = estimate(survey, state, plan, {options.max_iterations}, progress);
    if (!at) return fail(std::move(at));
    if (change < kSettled) return total;
  }
  return fail(base::ErrorCode::kNoUniqueSolution,
              "the variance components do not settle; adjust with the stated sigmas and look at the residuals of each group");
}

void about_components(base::AdjustedNetwork& result) {
  constexpr double kUnlikely = 0.001;
  constexpr double kMuch = 1.5;
  // One group alone is told by sigma0.
  if (result.variance_components.size() < 2) return;
  for (const VarianceComponent& of : result.variance_components) {
    if (!of.estimated || of.p >= kUnlikely || (of.sigma_ratio < kMuch && of.sigma_ratio > 1.0 / kMuch)) continue;
    result.warnings.push_back(
        {"sigma_ratio", of.group,
         fmt::format("{}: the residuals ask for sigmas {:.2g} times the stated ones (95 %: {:.2g} to {:.2g}); {}", of.group,
                     of.sigma_ratio, of.low, of.high,
                     result.variance_components_applied
                         ? "they were multiplied by it"
                         : "the groups have wrong weights against each other. Correct the sigmas at their source, or let "
                           "variance_components = \"apply\" in [network] do it")});
  }
}

}  // namespace crosstie::bundle::detail
