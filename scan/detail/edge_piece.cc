#include "scan/detail/edge_piece.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numbers>
#include <utility>

#include "math/median.h"

namespace crosstie::scan::detail {
namespace {

constexpr double kLeastSigma = 0.1;  // grey levels, of a mean over several images
constexpr std::size_t kSampleEvery = 101;
constexpr double kLeastShare = 0.6;     // of the pixels of a piece that must have levels
constexpr double kNearlyWhite = 0.985;  // of the white level: cut off

template <typename Sample>
std::vector<float> levels_of(const base::ImageView& view) {
  std::vector<float> levels;
  levels.reserve(static_cast<std::size_t>(view.width) * static_cast<std::size_t>(view.height));
  for (int y = 0; y < view.height; ++y) {
    const Sample* row = view.row<Sample>(y);
    for (int x = 0; x < view.width; ++x) levels.push_back(static_cast<float>(row[x]));
  }
  return levels;
}

/// The line through the levels of one image on one side of an edge.
struct SideLine {
  std::size_t count = 0;
  double at_edge = 0.0, slope = 0.0;
  double spread = 0.0;    ///< sum of the squared distances from their mean
  double variance = 0.0;  ///< of a level round the line
};

SideLine line_of(const ProfileSamples& profile, std::size_t image, double from_px, double to_px) {
  double n = 0.0, t = 0.0, tt = 0.0, y = 0.0, ty = 0.0, yy = 0.0;
  for (std::size_t i = 0; i < profile.size(); ++i) {
    const double across = profile.across_px(i);
    if (across < from_px || across > to_px) continue;
    const double level = profile.level(image, i);
    n += 1.0;
    t += across;
    tt += across * across;
    y += level;
    ty += across * level;
    yy += level * level;
  }
  SideLine line;
  line.count = static_cast<std::size_t>(n);
  if (n < 3.0) return line;
  line.spread = tt - t * t / n;
  if (!(line.spread > 0.0)) return {};
  line.slope = (ty - t * y / n) / line.spread;
  line.at_edge = (y - line.slope * t) / n + profile.origin(image);
  line.variance = std::max(0.0, (yy - y * y / n - line.slope * line.slope * line.spread) / (n - 2.0));
  return line;
}

}  // namespace

EdgeImages::EdgeImages(const base::PhaseMap& map, const base::Image* white) : map_(&map), plane_(map.x ? &*map.x : &*map.y) {
  if (white != nullptr) {
    const base::ImageView view = white->view();
    white_ = view.bits == 8 ? levels_of<std::uint8_t>(view) : levels_of<std::uint16_t>(view);
    nearly_white_ = kNearlyWhite * white->white_level();
  }
  std::vector<double> gains;
  for (std::size_t at = 0; at < map.status.size(); at += kSampleEvery) {
    if (map.status[at] != base::PhaseStatus::kValid) continue;
    const double sigma = 2.0 * std::numbers::pi * static_cast<double>(plane_->modulation[at] * plane_->sigma_turns[at]);
    gains.push_back(sigma * sigma / std::max(kLeastSigma * kLeastSigma, map.noise.variance(map.light[at])));
  }
  gain_ = math::median(std::move(gains));
}

std::size_t EdgeImages::read(const PieceFrame& frame, double half_piece_px, double from_px, double to_px,
                             PieceSamples& samples) const {
  samples.profile.clear();
  const bool differ = phases_differ(frame, half_piece_px, from_px, to_px, samples.sides, samples.phase_slope_turns);
  bool white = !white_.empty();
  std::size_t seen = 0;
  double light_sum = 0.0, white_sum = 0.0;
  for_each(frame, half_piece_px, from_px, to_px, [&](std::size_t at, double t, double) {
    ++seen;
    if (map_->status[at] == base::PhaseStatus::kSaturated) return;
    const double light = map_->light[at];
    const double full = white ? static_cast<double>(white_[at]) : 0.0;
    white = white && full < nearly_white_;
    light_sum += light;
    white_sum += full;
    samples.profile.add(t, {light, differ ? full : static_cast<double>(plane_->modulation[at]), full});
  });
  const auto count = static_cast<double>(samples.profile.size());
  if (samples.profile.size() == 0 || count < kLeastShare * static_cast<double>(seen)) return 0;
  const auto at_least = [](double variance) { return std::max(kLeastSigma, std::sqrt(variance)); };
  const double by_modulation = gain_ * map_->noise.variance(light_sum / count);
  const double by_white = map_->noise.variance(white_sum / count);
  // N even steps: var(A) = var / N, var(B) = 2 var / N.
  samples.noise_sigma = {at_least(0.5 * by_modulation), at_least(differ ? by_white : by_modulation), at_least(by_white)};
  const std::size_t images = differ ? (white ? 2 : 1) : (white ? 3 : 2);
  samples.profile.finish(images);
  return images;
}

std::size_t EdgeImages::read_even(const PieceFrame& frame, double half_piece_px, double from_px, double to_px, double blur_px,
                                  PieceSamples& samples) const {
  constexpr double kClear_blurs = 3.5;  // of the edge itself
  constexpr double kMost = 0.03;        // per px; more is paint
  constexpr double kFallOff = 0.004;    // per px, what may be expected
  constexpr std::size_t kLeast = 20;
  samples.light_slope_sigma = 0.0;
  const std::size_t images = read(frame, half_piece_px, from_px, to_px, samples);
  if (images == 0) return 0;
  ProfileSamples& profile = samples.profile;
  const double clear_px = kClear_blurs * blur_px;
  const SideLine before = line_of(profile, 0, from_px, -clear_px);
  if (before.count < kLeast || !(before.at_edge > 0.0) || std::abs(before.slope) > kMost * before.at_edge) return images;
  // Grain is seen through the point spread: pixels within it vary together.
  const double own = samples.noise_sigma[0] * samples.noise_sigma[0];
  const double together = std::max(1.0, 4.0 * std::numbers::pi * blur_px * blur_px);
  const double grain = std::max(0.0, before.variance - own) * together;
  // Grain imitates slopes; light falls off by some tenths of a per cent per px.
  const double variance = (own + grain) / before.spread / (before.at_edge * before.at_edge);
  const double share = kFallOff * kFallOff / (kFallOff * kFallOff + variance);
  samples.light_slope_sigma = std::sqrt(share * variance);
  profile.even_out(share * before.slope / before.at_edge);
  profile.finish(images);
  return images;
}

bool EdgeImages::phases_differ(const PieceFrame& frame, double half_piece_px, double from_px, double to_px,
                               std::array<PieceSamples::Side, 2>& sides, double& slope) const {
  constexpr double kMixed_px = 3.0;
  constexpr double kLit = 0.3;          // of the other side's modulation
  constexpr double kSame_turns = 0.05;  // mixed light is then hardly weaker
  constexpr std::size_t kLeast = 8;
  for (PieceSamples::Side& side : sides) {
    side.modulations.clear();
    side.across_px.clear();
    side.phases.clear();
  }
  for_each(frame, half_piece_px, from_px, to_px, [&](std::size_t at, double t, double) {
    if (std::abs(t) < kMixed_px) return;
    PieceSamples::Side& side = sides[t < 0.0 ? 0 : 1];
    side.modulations.push_back(plane_->modulation[at]);
    if (map_->status[at] != base::PhaseStatus::kValid) return;
    side.across_px.push_back(t);
    side.phases.push_back(plane_->turns[at]);
  });
  slope = 0.0;
  if (sides[0].phases.size() < kLeast) return false;
  // The material side's slope is taken off: its own change is no jump.
  double tt = 0.0, tp = 0.0, t_sum = 0.0, p_sum = 0.0;
  const auto count = static_cast<double>(sides[0].phases.size());
  for (std::size_t i = 0; i < sides[0].phases.size(); ++i) {
    const double t = sides[0].across_px[i];
    tt += t * t;
    tp += t * sides[0].phases[i];
    t_sum += t;
    p_sum += sides[0].phases[i];
  }
  const double determinant = count * tt - t_sum * t_sum;
  slope = determinant > 1e-9 ? (count * tp - t_sum * p_sum) / determinant : 0.0;
  if (sides[1].phases.size() < kLeast) return false;
  const double before = middle(sides[0].modulations);
  const double beyond = middle(sides[1].modulations);
  if (std::min(before, beyond) < kLit * std::max(before, beyond)) return false;
  for (PieceSamples::Side& side : sides) {
    for (std::size_t i = 0; i < side.phases.size(); ++i) side.phases[i] -= slope * side.across_px[i];
  }
  return std::abs(middle(sides[1].phases) - middle(sides[0].phases)) > kSame_turns;
}

}  // namespace crosstie::scan::detail
