#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "base/parallel.h"
#include "base/progress.h"
#include "base/result.h"
#include "scan/detail/edge_class.h"
#include "scan/detail/edge_piece.h"
#include "scan/edge_pixels.h"

namespace crosstie::scan::detail {

inline constexpr double kFirstBlur_px = 0.7;     // until the camera's own is found
inline constexpr double kSearchInside_px = 4.5;  // phases reach beyond the surface by the blur, and over a bright lip
inline constexpr double kSearchOutside_px = 3.5;
inline constexpr double kNeighbours_px = 8.0;  // pieces that tell each other's direction and number of steps
inline constexpr double kConverged_px = 1e-3;

/// A place where an edge is looked for, and what was found there.
struct Site {
  PieceFrame frame;
  bool bend = false;
  bool paint = false;
  bool lost = false;
  bool line = false;                                ///< one step alone could not be fitted when its direction was looked for
  Eigen::Vector2i pixel = Eigen::Vector2i::Zero();  ///< at which it began
  std::optional<double> strongest_px = {};          ///< place of the strongest step: fitted, else as it was seen
  std::array<std::optional<StepProfile>, kMostSteps> fits = {};  ///< with one, two, three steps
  std::array<double, kMostSteps> criterion = {};                 ///< of the choice between them, smaller is better
  std::size_t images = 0;
  std::array<double, kMostEdgeImages> noise = {};
  double light_slope_sigma = 0.0;  ///< see PieceSamples
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

/// Where surfaces end or bend, and strong maxima of the gradient of the mean image away from these.
Sites find_sites(const EdgeInput& input, const EdgeOptions& options, const EdgeImages& images);

/// By how much variances of a fit are larger than independent residuals say.
double grain_factor(const StepProfile& fit, std::size_t images, const std::array<double, kMostEdgeImages>& noise,
                    double blur_px);

/// Fits one step, two, up to `most`. `last`: the edge is where the site is, and the blur the camera's; sides are evened out
/// (EdgeImages::read_even()).
void fit_site(Site& site, const EdgeImages& images, const EdgeOptions& options, double blur_px, std::size_t most,
              PieceSamples& samples, bool last = false);

/// By how much the first step was found too far out, since the modulation near a border is not averaged over as much phase as elsewhere: of
/// a surface whose phase changes by w = 2 pi slope blur over the blur, its step lies 0.395 w^2 blurs too far out (least squares; the
/// amplitude at t blurs from the edge exceeds that of a blurred step by w^2 phi(t)^2 / (2 Phi(-t)) to second order).
double modulation_shift(const StepProfile& fit, std::size_t images, double phase_slope_turns, double blur_px);

/// `work(index, samples)` of every site in parallel, `samples` for its own use.
template <typename Work>
base::Result<> for_sites(std::vector<Site>& sites, int threads, const char* stage, const base::Progress& progress,
                         const Work& work) {
  constexpr std::size_t kSitesPerTask = 256;
  const std::size_t tasks = (sites.size() + kSitesPerTask - 1) / kSitesPerTask;
  return base::parallel_for(tasks, threads, stage, progress, [&](std::size_t task) -> base::Result<> {
    PieceSamples samples;
    const std::size_t end = std::min(sites.size(), (task + 1) * kSitesPerTask);
    for (std::size_t i = task * kSitesPerTask; i < end; ++i) work(i, samples);
    return {};
  });
}

}  // namespace crosstie::scan::detail
