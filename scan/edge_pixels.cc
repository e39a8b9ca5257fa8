#include "scan/edge_pixels.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>
#include <span>

#include <fmt/format.h>
#include <Eigen/Cholesky>

#include "base/parallel.h"
#include "math/median.h"
#include "scan/detail/edge_class.h"
#include "scan/detail/edge_piece.h"
#include "scan/detail/surface_end.h"

namespace crosstie::scan {
namespace {

using base::ErrorCode;
using base::fail;
using base::Result;
using detail::EdgeImages;
using detail::PieceFrame;
using detail::PieceSamples;
using detail::StepProfile;

constexpr double kFirstBlur_px = 0.7;  // until the camera's own is found
constexpr double kLeastBlur_px = 0.3;  // a pixel's own extent
constexpr double kMostBlur_px = 3.0;
constexpr std::size_t kBlurSites = 150;
constexpr std::size_t kLeastBlurs = 5;
constexpr double kBlurStep = 1.08;
constexpr double kLeastBlurSigma = 0.01;  // relative: a point spread is no Gaussian curve
constexpr double kSearchInside_px = 4.5;  // phases reach beyond the surface by the blur, and over a bright lip
constexpr double kSearchOutside_px = 3.5;
constexpr double kSearchPaint_px = 1.5;  // of gradients, whose place is known
constexpr double kNeighbours_px = 8.0;   // pieces that tell each other's direction and number of steps
constexpr int kPaintDistance_px = 6;     // from the end of a surface
constexpr int kDirectionRounds = 2;
constexpr std::size_t kSitesPerTask = 256;
constexpr double kConverged_px = 1e-3;

/// A place where an edge is looked for, and what was found there.
struct Site {
  PieceFrame frame;
  bool bend = false;
  bool paint = false;
  bool lost = false;
  bool line = false;                                ///< one step alone could not be fitted when its direction was looked for
  Eigen::Vector2i pixel = Eigen::Vector2i::Zero();  ///< at which it began
  std::optional<double> strongest_px = {};          ///< place of the strongest step: fitted, else as it was seen
  std::array<std::optional<StepProfile>, detail::kMostSteps> fits = {};  ///< with one, two, three steps
  std::array<double, detail::kMostSteps> criterion = {};                 ///< of the choice between them, smaller is better
  std::size_t images = 0;
  std::array<double, detail::kMostEdgeImages> noise = {};
};

/// The sites of a camera and where they lie.
struct Sites {
  std::vector<Site> all;
  std::vector<std::int32_t> at_pixel;  ///< index of the site that began there, -1: none
  int width = 0;
  int height = 0;

  void index() {
    at_pixel.assign(static_cast<std::size_t>(width) * static_cast<std::size_t>(height), -1);
    for (std::size_t i = 0; i < all.size(); ++i)
      at_pixel[pixel_index(all[i].pixel.x(), all[i].pixel.y())] = static_cast<std::int32_t>(i);
  }
  [[nodiscard]] std::size_t pixel_index(int x, int y) const {
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x);
  }

  template <typename Visit>
  void neighbours(const Site& site, double radius, const Visit& visit) const {
    const int reach = static_cast<int>(std::ceil(radius)) + 1;
    const int cx = site.pixel.x();
    const int cy = site.pixel.y();
    for (int y = std::max(0, cy - reach); y <= std::min(height - 1, cy + reach); ++y) {
      for (int x = std::max(0, cx - reach); x <= std::min(width - 1, cx + reach); ++x) {
        const std::int32_t index = at_pixel[pixel_index(x, y)];
        if (index < 0) continue;
        const Site& other = all[static_cast<std::size_t>(index)];
        if (other.paint != site.paint || other.frame.out.dot(site.frame.out) < 0.7) continue;
        if ((other.frame.origin_px - site.frame.origin_px).norm() <= radius) visit(other);
      }
    }
  }
};

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

Sites find_sites(const EdgeInput& input, const EdgeOptions& options, const EdgeImages& images) {
  const base::PhaseMap& map = *input.phases;
  Sites sites;
  sites.width = map.width;
  sites.height = map.height;
  std::vector<char> near_end(map.status.size(), 0);
  for (const detail::SurfaceEnd& end : detail::surface_ends(map, options.threads)) {
    Site site;
    site.pixel = {end.x, end.y};
    site.frame.origin_px = Eigen::Vector2d(end.x, end.y);
    site.frame.out = end.out;
    site.bend = end.bend;
    if (end.bend && input.depth_mm != nullptr) {
      const auto slopes = detail::depth_slopes(*input.depth_mm, images, site.frame);
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

/// Grain is seen through the point spread: that many pixels vary together.
double grain_area(double blur_px) { return std::max(1.0, 4.0 * std::numbers::pi * blur_px * blur_px); }

/// By how much variances of a fit are larger than independent residuals say.
double grain_factor(const StepProfile& fit, std::size_t images, const std::array<double, detail::kMostEdgeImages>& noise,
                    double blur_px) {
  double sum = 0.0;
  for (std::size_t i = 0; i < images; ++i) {
    const double all = std::max(fit.rms[i] * fit.rms[i], noise[i] * noise[i]);
    const double own = noise[i] * noise[i];
    sum += (own + (all - own) * grain_area(blur_px)) / all;
  }
  return sum / static_cast<double>(images);
}

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

/// Fits one, two and three steps.
void fit_site(Site& site, const EdgeImages& images, const EdgeOptions& options, double blur_px, std::size_t most,
              double converged_px, PieceSamples& samples) {
  site.fits = {};
  site.images = images.read(site.frame, options.half_piece_px, -options.reach_px, options.reach_px, samples);
  if (site.images == 0) return;
  site.noise = samples.noise_sigma;
  // Where the image's gradient told the place, the direction is that of the step there.
  const bool there = site.paint && most == 1;
  const auto candidates = detail::step_candidates(samples.profile, there ? -kSearchPaint_px : -kSearchInside_px,
                                                  there ? kSearchPaint_px : kSearchOutside_px, most, options.min_step_sigmas);
  for (std::size_t k = 1; k <= candidates.count; ++k) {
    StepProfile profile;
    if (!detail::fit_steps(samples.profile, site.noise, blur_px, candidates.first(k), converged_px, profile)) continue;
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

template <typename Work>
Result<> for_sites(std::vector<Site>& sites, int threads, const char* stage, const base::Progress& progress, const Work& work) {
  const std::size_t tasks = (sites.size() + kSitesPerTask - 1) / kSitesPerTask;
  return base::parallel_for(tasks, threads, stage, progress, [&](std::size_t task) -> Result<> {
    PieceSamples samples;
    const std::size_t end = std::min(sites.size(), (task + 1) * kSitesPerTask);
    for (std::size_t i = task * kSitesPerTask; i < end; ++i) work(i, samples);
    return {};
  });
}

/// The camera's point spread, and how well it is known at a place: it varies over image and depth.
struct Blur {
  double px = kFirstBlur_px;
  double relative_sigma = 0.1;
};

/// The point spread at which a piece's steps fit best; nothing where that is not one within the range.
std::optional<double> blur_at(const Site& site, const EdgeImages& images, const EdgeOptions& options, PieceSamples& samples) {
  const std::size_t count = images.read(site.frame, options.half_piece_px, -options.reach_px, options.reach_px, samples);
  const auto candidates = detail::step_candidates(samples.profile, -kSearchInside_px, kSearchOutside_px, detail::kMostSteps,
                                                  options.min_step_sigmas);
  // With as many steps as it takes: two that are taken for one look blurred.
  std::vector<double> criteria;
  for (double blur = kLeastBlur_px; blur < kMostBlur_px; blur *= kBlurStep) {
    criteria.push_back(std::numeric_limits<double>::infinity());
    for (std::size_t k = 1; k <= candidates.count; ++k) {
      StepProfile profile;
      if (!detail::fit_steps(samples.profile, samples.noise_sigma, blur, candidates.first(k), kConverged_px, profile)) continue;
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

/// The point spread at the clean single steps that stand out most from their residuals.
Result<Blur> find_blur(const Sites& sites, const EdgeImages& images, const EdgeOptions& options,
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
  auto done = base::parallel_for(clean.size(), options.threads, "blur", progress, [&](std::size_t i) -> Result<> {
    PieceSamples samples;
    found[i] = blur_at(sites.all[clean[i].second], images, options, samples);
    return {};
  });
  if (!done) return fail(std::move(done));
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

/// Offset, slope and curvature of a line through places (along, across), robust.
Eigen::Vector3d robust_curve(const std::vector<Eigen::Vector2d>& places) {
  std::vector<double> weights(places.size(), 1.0);
  Eigen::Vector3d curve = Eigen::Vector3d::Zero();
  for (int round = 0; round < 4; ++round) {
    // Places are good to a tenth of a pixel, curves of less than some 10 px radius are corners: a prior of weight one.
    Eigen::Matrix3d normal = Eigen::Vector3d(1e-6, 1e-6, 1.0).asDiagonal();
    Eigen::Vector3d right = Eigen::Vector3d::Zero();
    for (std::size_t i = 0; i < places.size(); ++i) {
      const Eigen::Vector3d row(1.0, places[i].x(), 0.5 * places[i].x() * places[i].x());
      normal += weights[i] * row * row.transpose();
      right += weights[i] * places[i].y() * row;
    }
    curve = normal.ldlt().solve(right);
    std::vector<double> off(places.size());
    for (std::size_t i = 0; i < places.size(); ++i) {
      off[i] =
          std::abs(places[i].y() - curve.x() - curve.y() * places[i].x() - 0.5 * curve.z() * places[i].x() * places[i].x());
    }
    std::vector<double> sorted = off;
    const double scale = std::max(0.1, 1.4826 * math::median(sorted)) * 4.0;
    for (std::size_t i = 0; i < places.size(); ++i) {
      const double ratio = off[i] / scale;
      weights[i] = ratio < 1.0 ? std::pow(1.0 - ratio * ratio, 2) : 0.0;
    }
  }
  return curve;
}

/// Direction and curvature of a piece from the strongest steps of its neighbours: a parabola, robust. Steps that were seen and could not be fitted
/// count where they are the most: on a bright line.
std::optional<PieceFrame> smoothed_frame(const Sites& sites, const Site& site) {
  constexpr std::size_t kLeast = 6;
  std::vector<Eigen::Vector2d> places, seen;
  const Eigen::Vector2d along = site.frame.along();
  sites.neighbours(site, kNeighbours_px, [&](const Site& other) {
    if (!other.strongest_px) return;
    const Eigen::Vector2d d = other.frame.origin_px + *other.strongest_px * other.frame.out - site.frame.origin_px;
    (other.fits[0] ? places : seen).emplace_back(along.dot(d), site.frame.out.dot(d));
  });
  if (seen.size() > places.size())
    places.insert(places.end(), seen.begin(), seen.end());
  else if (!site.fits[0])
    return std::nullopt;
  if (places.size() < kLeast) return std::nullopt;
  const Eigen::Vector3d curve = robust_curve(places);
  PieceFrame frame;
  frame.origin_px = site.frame.origin_px + curve.x() * site.frame.out;
  const double cosine = 1.0 / std::sqrt(1.0 + curve.y() * curve.y());
  frame.out = ((site.frame.out - curve.y() * along) * cosine).normalized();
  frame.curvature = curve.z() * cosine * cosine * cosine;
  return frame;
}

/// Across the image's edge about a site: the direction in which the levels change most (the structure tensor's), the same way as the site's own;
/// nothing where it is not clear or far from that.
std::optional<Eigen::Vector2d> gradient_direction(const Site& site, const base::PhaseMap& map) {
  constexpr int kRadius_px = 4;
  constexpr double kMostTurn = 0.7;  // cosine
  constexpr double kLeastAnisotropy = 0.3;
  const auto w = static_cast<std::size_t>(map.width);
  const int cx = site.pixel.x();
  const int cy = site.pixel.y();
  if (cx <= kRadius_px || cy <= kRadius_px || cx + kRadius_px + 1 >= map.width || cy + kRadius_px + 1 >= map.height)
    return std::nullopt;
  Eigen::Matrix2d tensor = Eigen::Matrix2d::Zero();
  for (int y = cy - kRadius_px; y <= cy + kRadius_px; ++y) {
    for (int x = cx - kRadius_px; x <= cx + kRadius_px; ++x) {
      if ((x - cx) * (x - cx) + (y - cy) * (y - cy) > kRadius_px * kRadius_px) continue;
      const float* level = &map.light[map.at(x, y)];
      const Eigen::Vector2d gradient(level[1] - level[-1], level[w] - level[-static_cast<std::ptrdiff_t>(w)]);
      tensor += gradient * gradient.transpose();
    }
  }
  const double half = 0.5 * (tensor(0, 0) - tensor(1, 1));
  if (std::hypot(half, tensor(0, 1)) < 0.5 * kLeastAnisotropy * tensor.trace()) return std::nullopt;
  const double angle = 0.5 * std::atan2(tensor(0, 1), half);
  const Eigen::Vector2d across(std::cos(angle), std::sin(angle));
  const double way = across.dot(site.frame.out);
  if (std::abs(way) < kMostTurn) return std::nullopt;
  return way > 0.0 ? across : Eigen::Vector2d(-across);
}

/// Of a site's own direction and that of the image's gradient the one across which the step stands out more: an end's own is only as good as its
/// pixels, and a step seen at a slant is blurred.
void choose_direction(Site& site, const base::PhaseMap& map, const EdgeImages& images, const EdgeOptions& options,
                      PieceSamples& samples) {
  const auto by_gradient = gradient_direction(site, map);
  if (!by_gradient) return;
  const auto strength = [&](const PieceFrame& frame) {
    if (images.read(frame, options.half_piece_px, -options.reach_px, options.reach_px, samples) == 0) return 0.0;
    return detail::step_candidates(samples.profile, -kSearchInside_px, kSearchOutside_px, 1, 0.0).strongest;
  };
  PieceFrame turned = site.frame;
  turned.out = *by_gradient;
  if (strength(turned) > strength(site.frame)) site.frame = turned;
}

/// Directions and curvatures from the strongest steps; these again, since a step seen at a slant is blurred. Sites without are left out.
Result<> find_directions(Sites& sites, const base::PhaseMap& map, const EdgeImages& images, const EdgeOptions& options,
                         const base::Progress& progress) {
  auto chosen = for_sites(sites.all, options.threads, "directions", progress, [&](std::size_t i, PieceSamples& samples) {
    choose_direction(sites.all[i], map, images, options, samples);
  });
  if (!chosen) return chosen;
  for (int round = 0; round < kDirectionRounds; ++round) {
    auto done = for_sites(sites.all, options.threads, "edges", progress, [&](std::size_t i, PieceSamples& samples) {
      fit_site(sites.all[i], images, options, kFirstBlur_px, 1, kConverged_px, samples);
    });
    if (!done) return done;
    std::vector<std::optional<PieceFrame>> frames(sites.all.size());
    done = for_sites(sites.all, options.threads, "directions", progress, [&](std::size_t i, PieceSamples&) {
      if (sites.all[i].strongest_px) frames[i] = smoothed_frame(sites, sites.all[i]);
    });
    if (!done) return done;
    for (std::size_t i = 0; i < frames.size(); ++i) {
      sites.all[i].lost = !frames[i];
      sites.all[i].line = !sites.all[i].fits[0];
      if (frames[i]) sites.all[i].frame = *frames[i];
    }
    std::erase_if(sites.all, [](const Site& site) { return site.lost; });
    sites.index();
  }
  return {};
}

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
    sites.neighbours(site, kNeighbours_px, [&](const Site& other) {
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
  const double grain = grain_factor(fit, site.images, site.noise, blur.px);
  // Steps near each other lean on the point spread.
  double by_blur = 0.0;
  if (steps > 1) {
    images.read(site.frame, options.half_piece_px, -options.reach_px, options.reach_px, samples);
    StepProfile wider;
    constexpr double kWider = 1.05;
    const bool fits = detail::fit_steps(samples.profile, samples.noise_sigma, kWider * blur.px,
                                        std::span(fit.at_px).first(steps), kConverged_px, wider);
    by_blur = fits ? (wider.at_px[0] - fit.at_px[0]) / (kWider - 1.0) * blur.relative_sigma : 0.5 * blur.px;
  }
  edge.noise_px = std::sqrt(fit.noise_cov_px2(0, 0));
  edge.sigma_px = std::max(edge.noise_px, std::sqrt(fit.cov_px2(0, 0) * grain * std::max(1.0, fit.disagreement) +
                                                    fit.band_variance_px2 + by_blur * by_blur));
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
  sites.neighbours(sites.all[at], kNeighbours_px, [&](const Site& other) {
    const auto& edge = edges[static_cast<std::size_t>(&other - sites.all.data())];
    if (!edge || &other == &sites.all[at]) return;
    const Eigen::Vector2d d = edge->at_px - own.at_px;
    places.emplace_back(along.dot(d), own.out.dot(d));
  });
  if (places.size() < kLeast) return true;  // a piece on its own has no direction
  return std::abs(robust_curve(places).x()) > kSlack_px + kSigmas * own.sigma_px;
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
  Sites sites = find_sites(input, options, images);
  auto done = find_directions(sites, map, images, options, progress);
  if (!done) return fail(std::move(done));
  base::EdgePixels result;
  result.width = map.width;
  result.height = map.height;
  result.piece_px = 2.0 * options.half_piece_px + 1.0;
  const auto blur = find_blur(sites, images, options, progress);
  if (!blur) return tl::unexpected(blur.error());
  result.blur_px = blur->px;
  done = for_sites(sites.all, options.threads, "edges", progress, [&](std::size_t i, PieceSamples& samples) {
    fit_site(sites.all[i], images, options, result.blur_px, detail::kMostSteps, kConverged_px, samples);
  });
  if (!done) return fail(std::move(done));
  std::vector<std::optional<base::EdgePixel>> edges(sites.all.size());
  done = for_sites(sites.all, options.threads, "classes", progress, [&](std::size_t i, PieceSamples& samples) {
    edges[i] = edge_of(sites, sites.all[i], input, images, options, *blur, samples);
  });
  if (!done) return fail(std::move(done));
  std::vector<char> stray(edges.size(), 0);
  done = for_sites(sites.all, options.threads, "strays", progress,
                   [&](std::size_t i, PieceSamples&) { stray[i] = edges[i] && is_stray(sites, edges, i); });
  if (!done) return fail(std::move(done));
  for (std::size_t i = 0; i < edges.size(); ++i) {
    if (edges[i] && !stray[i]) result.pixels.push_back(*edges[i]);
  }
  return result;
}

}  // namespace crosstie::scan
