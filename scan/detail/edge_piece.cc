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
  const bool differ = phases_differ(frame, half_piece_px, from_px, to_px, samples.sides);
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

bool EdgeImages::phases_differ(const PieceFrame& frame, double half_piece_px, double from_px, double to_px,
                               std::array<PieceSamples::Side, 2>& sides) const {
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
  if (sides[0].phases.size() < kLeast || sides[1].phases.size() < kLeast) return false;
  const double before = middle(sides[0].modulations);
  const double beyond = middle(sides[1].modulations);
  if (std::min(before, beyond) < kLit * std::max(before, beyond)) return false;
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
  const double slope = determinant > 1e-9 ? (count * tp - t_sum * p_sum) / determinant : 0.0;
  for (PieceSamples::Side& side : sides) {
    for (std::size_t i = 0; i < side.phases.size(); ++i) side.phases[i] -= slope * side.across_px[i];
  }
  return std::abs(middle(sides[1].phases) - middle(sides[0].phases)) > kSame_turns;
}

}  // namespace crosstie::scan::detail
