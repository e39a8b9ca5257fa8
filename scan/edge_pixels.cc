#include "scan/edge_pixels.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <span>

#include <fmt/format.h>

#include "scan/detail/edge_blur.h"
#include "scan/detail/edge_class.h"
#include "scan/detail/edge_direction.h"
#include "scan/detail/edge_piece.h"
#include "scan/detail/edge_sites.h"

namespace crosstie::scan {
namespace {

using base::ErrorCode;
using base::fail;
using base::Result;
using detail::Blur;
using detail::EdgeImages;
using detail::kConverged_px;
using detail::PieceFrame;
using detail::PieceSamples;
using detail::Site;
using detail::Sites;
using detail::StepProfile;

/// Of a step between sides that were taken for even, per relative change of brightness per px of one side [px^2]: by least squares over 7 px to
/// each side, nearly the same for all blurs that cameras have.
constexpr double kShiftBySlope = 3.8;

/// The number of steps that a piece and its neighbours agree on; 0: none was found.
std::size_t steps_of(const Sites& sites, const Site& site) {
  std::size_t best = site.fits[0] ? 1 : 0;
  for (std::size_t k = 2; k <= site.fits.size(); ++k) {
    if (!site.fits[k - 1]) continue;
    if (best == 0) {
      best = k;
      continue;
    }
    double difference = 0.0;
    sites.neighbours(site, detail::kNeighbours_px, [&](const Site& other) {
      if (other.fits[k - 1] && other.fits[best - 1]) difference += other.criterion[k - 1] - other.criterion[best - 1];
      if (!other.fits[k - 1] && other.fits[best - 1]) difference += 2.0 * std::log(100.0);
    });
    if (difference < 0.0) best = k;
  }
  return best;
}

std::optional<base::EdgePixel> edge_of(const Sites& sites, const Site& site, const EdgeInput& input, const EdgeImages& images,
                                       const EdgeOptions& options, const Blur& blur, PieceSamples& samples) {
  const std::size_t steps = steps_of(sites, site);
  if (steps == 0 || (steps == 1 && site.line)) return std::nullopt;
  const StepProfile& fit = *site.fits[steps - 1];
  base::EdgePixel edge;
  PieceFrame frame = site.frame;
  frame.origin_px += fit.at_px[0] * frame.out;
  edge.at_px = frame.origin_px;
  edge.out = frame.out;
  edge.band_px = fit.at_px[steps - 1] - fit.at_px[0];
  edge.step = fit.levels[0][1] - fit.levels[0][0];
  const double grain = detail::grain_factor(fit, site.images, site.noise, blur.px);
  // Steps near each other lean on the point spread.
  double by_blur = 0.0;
  if (steps > 1) {
    images.read_even(site.frame, options.half_piece_px, -options.reach_px, options.reach_px, blur.px, samples);
    StepProfile wider;
    constexpr double kWider = 1.05;
    const bool fits = detail::fit_steps(samples.profile, samples.noise_sigma, kWider * blur.px,
                                        std::span(fit.at_px).first(steps), kConverged_px, wider);
    if (fits) wider.at_px[0] -= detail::modulation_shift(wider, site.images, samples.phase_slope_turns, blur.px);
    by_blur = fits ? (wider.at_px[0] - fit.at_px[0]) / (kWider - 1.0) * blur.relative_sigma : 0.5 * blur.px;
  }
  edge.noise_px = std::sqrt(fit.noise_cov_px2(0, 0));
  const double by_light = kShiftBySlope * site.light_slope_sigma;
  edge.sigma_px = std::max(edge.noise_px, std::sqrt(fit.cov_px2(0, 0) * grain * std::max(1.0, fit.disagreement) +
                                                    fit.band_variance_px2 + by_blur * by_blur + by_light * by_light));
  if (!(edge.sigma_px < 1.0) || edge.at_px.minCoeff() < 0.0) return std::nullopt;
  const auto kind = detail::classify_edge(*input.phases, input.depth_mm, images, frame, edge.band_px);
  if (!kind) return std::nullopt;
  edge.kind = *kind;
  if (site.bend && edge.kind == base::EdgeClass::kPaint) return std::nullopt;
  // Of two edges near each other only the one at which the phases end.
  if (site.paint && edge.kind != base::EdgeClass::kPaint && !detail::ends_here(*input.phases, images, frame, edge.band_px))
    return std::nullopt;
  if (edge.kind == base::EdgeClass::kPaint) {
    const double brighter = std::max(fit.levels[0][0], fit.levels[0][1]);
    if (std::abs(edge.step) < options.min_paint_step * brighter) return std::nullopt;
    if (edge.step > 0.0) {
      edge.out = -edge.out;
      edge.step = -edge.step;
    }
  }
  return edge;
}

/// Whether an edge lies off the line of its neighbours by far more than its sigma: it took another step for the first one.
bool is_stray(const Sites& sites, const std::vector<std::optional<base::EdgePixel>>& edges, std::size_t at) {
  constexpr std::size_t kLeast = 6;
  constexpr double kSigmas = 4.0;
  constexpr double kSlack_px = 0.25;  // rims are no parabolas
  const base::EdgePixel& own = *edges[at];
  const Eigen::Vector2d along(-own.out.y(), own.out.x());
  std::vector<Eigen::Vector2d> places;
  sites.neighbours(sites.all[at], detail::kNeighbours_px, [&](const Site& other) {
    const auto& edge = edges[static_cast<std::size_t>(&other - sites.all.data())];
    if (!edge || &other == &sites.all[at]) return;
    const Eigen::Vector2d d = edge->at_px - own.at_px;
    places.emplace_back(along.dot(d), own.out.dot(d));
  });
  if (places.size() < kLeast) return true;  // a piece on its own has no direction
  return std::abs(detail::robust_curve(places).x()) > kSlack_px + kSigmas * own.sigma_px;
}

}  // namespace

Result<> EdgeOptions::validate() const {
  const auto bad = [](const std::string& what) { return fail(ErrorCode::kUsage, "edge options: " + what); };
  if (!(half_piece_px >= 1.0 && half_piece_px <= 20.0))
    return bad(fmt::format("half_piece_px is {}, not in 1..20", half_piece_px));
  if (!(reach_px >= 5.0 && reach_px <= 30.0)) return bad(fmt::format("reach_px is {}, not in 5..30", reach_px));
  if (!(min_step_sigmas > 0.0)) return bad(fmt::format("min_step_sigmas is {}, it must be positive", min_step_sigmas));
  if (!(min_paint_step > 0.0 && min_paint_step < 1.0))
    return bad(fmt::format("min_paint_step is {}, not in (0, 1)", min_paint_step));
  return {};
}

Result<base::EdgePixels> find_edges(const EdgeInput& input, const EdgeOptions& options, const base::Progress& progress) {
  if (auto ok = options.validate(); !ok) return fail(std::move(ok));
  const base::PhaseMap& map = *input.phases;
  if (input.white != nullptr && (input.white->width() != map.width || input.white->height() != map.height)) {
    return fail(ErrorCode::kBadInput, fmt::format("the white image has {} x {} px, the phases {} x {}", input.white->width(),
                                                  input.white->height(), map.width, map.height));
  }
  if (input.depth_mm != nullptr && input.depth_mm->size() != map.status.size()) {
    return fail(ErrorCode::kBadInput, "depths and phases are of different sizes");
  }
  const EdgeImages images(map, input.white);
  Sites sites = detail::find_sites(input, options, images);
  auto done = detail::find_directions(sites, map, images, options, progress);
  if (!done) return fail(std::move(done));
  base::EdgePixels result;
  result.width = map.width;
  result.height = map.height;
  result.piece_px = 2.0 * options.half_piece_px + 1.0;
  const auto blur = detail::find_blur(sites, images, options, progress);
  if (!blur) return tl::unexpected(blur.error());
  result.blur_px = blur->px;
  done = detail::for_sites(sites.all, options.threads, "edges", progress, [&](std::size_t i, PieceSamples& samples) {
    detail::fit_site(sites.all[i], images, options, result.blur_px, detail::kMostSteps, samples, true);
  });
  if (!done) return fail(std::move(done));
  std::vector<std::optional<base::EdgePixel>> edges(sites.all.size());
  done = detail::for_sites(sites.all, options.threads, "classes", progress, [&](std::size_t i, PieceSamples& samples) {
    edges[i] = edge_of(sites, sites.all[i], input, images, options, *blur, samples);
  });
  if (!done) return fail(std::move(done));
  std::vector<char> stray(edges.size(), 0);
  done = detail::for_sites(sites.all, options.threads, "strays", progress,
                           [&](std::size_t i, PieceSamples&) { stray[i] = edges[i] && is_stray(sites, edges, i); });
  if (!done) return fail(std::move(done));
  for (std::size_t i = 0; i < edges.size(); ++i) {
    if (edges[i] && !stray[i]) result.pixels.push_back(*edges[i]);
  }
  return result;
}

}  // namespace crosstie::scan
