#include "scan/detail/edge_sites.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "scan/detail/surface_end.h"

namespace crosstie::scan::detail {
namespace {

constexpr double kSearchPaint_px = 1.5;  // of gradients, whose place is known
constexpr int kPaintDistance_px = 6;     // from the end of a surface

/// Strong maxima of the gradient of the mean image, away from the ends of surfaces.
void add_paint_sites(const base::PhaseMap& map, const EdgeOptions& options, const std::vector<char>& near_end,
                     std::vector<Site>& sites) {
  const auto w = static_cast<std::size_t>(map.width);
  // Sobel's: noise of a single line makes no edge.
  const auto gradient = [&](std::size_t at) -> Eigen::Vector2f {
    const float* p = &map.light[at];
    const auto s = static_cast<std::ptrdiff_t>(w);
    const float diagonal = p[s + 1] - p[-s - 1];
    const float other = p[-s + 1] - p[s - 1];
    return Eigen::Vector2f(diagonal + other + 2.0F * (p[1] - p[-1]), diagonal - other + 2.0F * (p[s] - p[-s])) * 0.125F;
  };
  for (int y = 2; y + 2 < map.height; ++y) {
    for (int x = 2; x + 2 < map.width; ++x) {
      const std::size_t at = map.at(x, y);
      if (near_end[at] || map.status[at] != base::PhaseStatus::kValid) continue;
      const Eigen::Vector2f here = gradient(at);
      const float strength = here.norm();
      // A blurred step's largest difference is some 0.4 of its height.
      if (strength < 0.4F * static_cast<float>(options.min_paint_step) * map.light[at]) continue;
      const bool flat = std::abs(here.x()) > std::abs(here.y());
      const std::size_t step = flat ? 1 : w;
      if (gradient(at - step).norm() > strength || gradient(at + step).norm() >= strength) continue;
      Site site;
      site.pixel = {x, y};
      site.frame.origin_px = Eigen::Vector2d(x, y);
      site.frame.out = -here.cast<double>().normalized();
      site.paint = true;
      sites.push_back(site);
    }
  }
}

/// Grain is seen through the point spread: that many pixels vary together.
double grain_area(double blur_px) { return std::max(1.0, 4.0 * std::numbers::pi * blur_px * blur_px); }

/// Whether the first step stands out beside the others: a faint one is a stain before the edge.
bool begins_clearly(const StepProfile& fit, std::size_t images) {
  constexpr double kShare = 0.1;
  for (std::size_t image = 0; image < images; ++image) {
    const auto& levels = fit.levels[image];
    double largest = 0.0;
    for (int j = 0; j < fit.steps; ++j) {
      const auto at = static_cast<std::size_t>(j);
      largest = std::max(largest, std::abs(levels[at + 1] - levels[at]));
    }
    if (std::abs(levels[1] - levels[0]) >= kShare * largest) return true;
  }
  return false;
}

}  // namespace

Sites find_sites(const EdgeInput& input, const EdgeOptions& options, const EdgeImages& images) {
  const base::PhaseMap& map = *input.phases;
  Sites sites;
  sites.width = map.width;
  sites.height = map.height;
  std::vector<char> near_end(map.status.size(), 0);
  for (const SurfaceEnd& end : surface_ends(map, options.threads)) {
    Site site;
    site.pixel = {end.x, end.y};
    site.frame.origin_px = Eigen::Vector2d(end.x, end.y);
    site.frame.out = end.out;
    site.bend = end.bend;
    if (end.bend && input.depth_mm != nullptr) {
      const auto slopes = depth_slopes(*input.depth_mm, images, site.frame);
      if (slopes && std::abs(slopes->before) > std::abs(slopes->beyond)) site.frame.out = -site.frame.out;
    }
    sites.all.push_back(site);
    for (int y = std::max(0, end.y - kPaintDistance_px); y <= std::min(map.height - 1, end.y + kPaintDistance_px); ++y) {
      for (int x = std::max(0, end.x - kPaintDistance_px); x <= std::min(map.width - 1, end.x + kPaintDistance_px); ++x) {
        near_end[map.at(x, y)] = 1;
      }
    }
  }
  add_paint_sites(map, options, near_end, sites.all);
  sites.index();
  return sites;
}

double grain_factor(const StepProfile& fit, std::size_t images, const std::array<double, kMostEdgeImages>& noise,
                    double blur_px) {
  double sum = 0.0;
  for (std::size_t i = 0; i < images; ++i) {
    const double all = std::max(fit.rms[i] * fit.rms[i], noise[i] * noise[i]);
    const double own = noise[i] * noise[i];
    sum += (own + (all - own) * grain_area(blur_px)) / all;
  }
  return sum / static_cast<double>(images);
}

double modulation_shift(const StepProfile& fit, std::size_t images, double phase_slope_turns, double blur_px) {
  constexpr double kOfSquare = 0.395;
  constexpr std::size_t kModulation = 1;
  if (images <= kModulation) return 0.0;
  const auto& levels = fit.levels[kModulation];
  const double lost = std::clamp((levels[0] - levels[1]) / std::max(1e-9, levels[0]), 0.0, 1.0);
  const double turn = 2.0 * std::numbers::pi * phase_slope_turns * blur_px;
  return fit.share[kModulation] * lost * kOfSquare * turn * turn * blur_px;
}

void fit_site(Site& site, const EdgeImages& images, const EdgeOptions& options, double blur_px, std::size_t most,
              PieceSamples& samples, bool last) {
  site.fits = {};
  site.images = last
                    ? images.read_even(site.frame, options.half_piece_px, -options.reach_px, options.reach_px, blur_px, samples)
                    : images.read(site.frame, options.half_piece_px, -options.reach_px, options.reach_px, samples);
  if (site.images == 0) return;
  site.noise = samples.noise_sigma;
  site.light_slope_sigma = samples.light_slope_sigma;
  // Where the image's gradient told the place, the direction is that of the step there.
  const bool there = site.paint && most == 1;
  const auto candidates = step_candidates(samples.profile, there ? -kSearchPaint_px : -kSearchInside_px,
                                          there ? kSearchPaint_px : kSearchOutside_px, most, options.min_step_sigmas);
  for (std::size_t k = 1; k <= candidates.count; ++k) {
    StepProfile profile;
    if (!fit_steps(samples.profile, site.noise, blur_px, candidates.first(k), kConverged_px, profile)) continue;
    if (last) profile.at_px[0] -= modulation_shift(profile, site.images, samples.phase_slope_turns, blur_px);
    site.fits[k - 1] = profile;
  }
  // One step alone does not come to rest on a bright line, such as a chamfer that shines.
  site.strongest_px.reset();
  if (site.fits[0])
    site.strongest_px = site.fits[0]->at_px[0];
  else if (candidates.count > 0)
    site.strongest_px = candidates.at_px[0];
  // What the best fit leaves is grain and noise; the same for all, or they could not be compared.
  double grain = 0.0;
  for (std::size_t k = 1; k <= site.fits.size(); ++k) {
    if (!site.fits[k - 1]) continue;
    const double here = grain_factor(*site.fits[k - 1], site.images, site.noise, blur_px);
    grain = grain == 0.0 ? here : std::min(grain, here);
  }
  for (std::size_t k = 1; k <= site.fits.size(); ++k) {
    if (!site.fits[k - 1]) continue;
    if (!begins_clearly(*site.fits[k - 1], site.images)) {
      site.fits[k - 1].reset();
      continue;
    }
    const double unknowns = static_cast<double>(k + site.images * (k + 1));
    site.criterion[k - 1] = -2.0 * site.fits[k - 1]->log_likelihood / grain +
                            unknowns * std::log(static_cast<double>(samples.profile.size()) / grain);
  }
}

}  // namespace crosstie::scan::detail
