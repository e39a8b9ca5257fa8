#include "scan/detail/edge_blur.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "math/median.h"

namespace crosstie::scan::detail {
namespace {

constexpr double kLeastBlur_px = 0.3;  // a pixel's own extent
constexpr double kMostBlur_px = 3.0;
constexpr std::size_t kBlurSites = 150;
constexpr std::size_t kLeastBlurs = 5;
constexpr double kBlurStep = 1.08;
constexpr double kLeastBlurSigma = 0.01;  // relative: a point spread is no Gaussian curve

/// The point spread at which a piece's steps fit best; nothing where that is not one within the range.
std::optional<double> blur_at(const Site& site, const EdgeImages& images, const EdgeOptions& options, PieceSamples& samples) {
  const std::size_t count = images.read(site.frame, options.half_piece_px, -options.reach_px, options.reach_px, samples);
  const auto candidates =
      step_candidates(samples.profile, -kSearchInside_px, kSearchOutside_px, kMostSteps, options.min_step_sigmas);
  // With as many steps as it takes: two that are taken for one look blurred.
  std::vector<double> criteria;
  for (double blur = kLeastBlur_px; blur < kMostBlur_px; blur *= kBlurStep) {
    criteria.push_back(std::numeric_limits<double>::infinity());
    for (std::size_t k = 1; k <= candidates.count; ++k) {
      StepProfile profile;
      if (!fit_steps(samples.profile, samples.noise_sigma, blur, candidates.first(k), kConverged_px, profile)) continue;
      if (profile.band_variance_px2 > 0.0) continue;
      const double criterion = -2.0 * profile.log_likelihood +
                               static_cast<double>(k + count * (k + 1)) * std::log(static_cast<double>(samples.profile.size()));
      criteria.back() = std::min(criteria.back(), criterion);
    }
  }
  const auto least = static_cast<std::size_t>(std::min_element(criteria.begin(), criteria.end()) - criteria.begin());
  if (least == 0 || least + 1 >= criteria.size() || !std::isfinite(criteria[least])) return std::nullopt;
  const double before = criteria[least - 1] - criteria[least];
  const double beyond = criteria[least + 1] - criteria[least];
  if (!(std::isfinite(before + beyond) && before + beyond > 0.0)) return std::nullopt;
  return kLeastBlur_px * std::pow(kBlurStep, static_cast<double>(least) + 0.5 * (before - beyond) / (before + beyond));
}

}  // namespace

base::Result<Blur> find_blur(const Sites& sites, const EdgeImages& images, const EdgeOptions& options,
                             const base::Progress& progress) {
  std::vector<std::pair<double, std::size_t>> clean;
  for (std::size_t i = 0; i < sites.all.size(); ++i) {
    const Site& site = sites.all[i];
    if (!site.fits[0] || site.bend) continue;
    double strength = 0.0;
    for (std::size_t image = 0; image < site.images; ++image) {
      strength = std::max(strength, std::abs(site.fits[0]->levels[image][1] - site.fits[0]->levels[image][0]) /
                                        std::max(site.fits[0]->rms[image], site.noise[image]));
    }
    clean.emplace_back(-strength, i);
  }
  std::sort(clean.begin(), clean.end());
  if (clean.size() > kBlurSites) clean.resize(kBlurSites);
  std::vector<std::optional<double>> found(clean.size());
  auto done = base::parallel_for(clean.size(), options.threads, "blur", progress, [&](std::size_t i) -> base::Result<> {
    PieceSamples samples;
    found[i] = blur_at(sites.all[clean[i].second], images, options, samples);
    return {};
  });
  if (!done) return base::fail(std::move(done));
  std::vector<double> blurs;
  for (const auto& one : found) {
    if (one) blurs.push_back(*one);
  }
  if (blurs.size() < kLeastBlurs) return Blur();
  // Soft shadows and borders of the projector's light are wider, never narrower: the median of the sharpest, as far as they agree.
  constexpr double kSharp = 0.2;
  constexpr double kAgree = 1.04;
  std::sort(blurs.begin(), blurs.end());
  const double sharp = blurs[static_cast<std::size_t>(kSharp * static_cast<double>(blurs.size()))];
  const auto wider = std::upper_bound(blurs.begin(), blurs.end(), kAgree * sharp);
  Blur result{blurs[static_cast<std::size_t>(wider - blurs.begin()) / 2]};
  for (double& blur : blurs) blur = std::abs(blur / result.px - 1.0);
  result.relative_sigma = std::max(kLeastBlurSigma, 1.4826 * math::median(blurs));
  return result;
}

}  // namespace crosstie::scan::detail
