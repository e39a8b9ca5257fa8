#include "scan/detail/edge_piece.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numbers>

#include "math/median.h"

namespace crosstie::scan::detail {
namespace {

constexpr double kLeastSigma = 0.1;  // grey levels, of a mean over several images
constexpr std::size_t kSampleEvery = 101;
constexpr double kLeastShare = 0.6;     // of the pixels of a piece that must have levels
constexpr double kNearlyWhite = 0.985;  // of the white level: cut off

}  // namespace

EdgeImages::EdgeImages(const base::PhaseMap& map, const base::Image* white)
    : map_(&map), plane_(map.x ? &*map.x : &*map.y), white_(white) {
  std::vector<double> gains;
  for (std::size_t at = 0; at < map.status.size(); at += kSampleEvery) {
    if (map.status[at] != base::PhaseStatus::kValid) continue;
    const double sigma = 2.0 * std::numbers::pi * static_cast<double>(plane_->modulation[at] * plane_->sigma_turns[at]);
    gains.push_back(sigma * sigma / std::max(kLeastSigma * kLeastSigma, map.noise.variance(map.light[at])));
  }
  gain_ = math::median(gains);
}

double EdgeImages::white_level(std::size_t x, std::size_t y) const {
  const base::ImageView view = white_->view();
  return view.bits == 8 ? static_cast<double>(view.row<std::uint8_t>(static_cast<int>(y))[x])
                        : static_cast<double>(view.row<std::uint16_t>(static_cast<int>(y))[x]);
}

std::size_t EdgeImages::samples(const PieceFrame& frame, double half_piece_px, double from_px, double to_px,
                                std::vector<ProfileSample>& samples, std::array<double, kMostEdgeImages>& noise_sigma) const {
  samples.clear();
  bool white = white_ != nullptr;
  std::size_t seen = 0;
  std::array<double, kMostEdgeImages> variance = {};
  for_each(frame, half_piece_px, from_px, to_px, [&](std::size_t at, double t, double) {
    ++seen;
    if (map_->status[at] == base::PhaseStatus::kSaturated) return;
    ProfileSample sample;
    sample.across_px = t;
    sample.levels[0] = map_->light[at];
    sample.levels[1] = plane_->modulation[at];
    const double modulation_variance = gain_ * map_->noise.variance(sample.levels[0]);
    variance[0] += 0.5 * modulation_variance;  // N even steps: var(A) = var / N, var(B) = 2 var / N
    variance[1] += modulation_variance;
    if (white) {
      const auto width = static_cast<std::size_t>(map_->width);
      sample.levels[2] = white_level(at % width, at / width);
      white = sample.levels[2] < kNearlyWhite * white_->white_level();
      variance[2] += map_->noise.variance(sample.levels[2]);
    }
    samples.push_back(sample);
  });
  if (samples.empty() || static_cast<double>(samples.size()) < kLeastShare * static_cast<double>(seen)) return 0;
  for (std::size_t i = 0; i < kMostEdgeImages; ++i) {
    noise_sigma[i] = std::max(kLeastSigma, std::sqrt(variance[i] / static_cast<double>(samples.size())));
  }
  if (!phases_differ(frame, half_piece_px, from_px, to_px)) return white ? 3 : 2;
  if (!white) return 1;
  for (ProfileSample& sample : samples) sample.levels[1] = sample.levels[2];
  noise_sigma[1] = noise_sigma[2];
  return 2;
}

bool EdgeImages::phases_differ(const PieceFrame& frame, double half_piece_px, double from_px, double to_px) const {
  constexpr double kMixed_px = 3.0;
  constexpr double kLit = 0.3;          // of the other side's modulation
  constexpr double kSame_turns = 0.05;  // mixed light is then hardly weaker
  constexpr std::size_t kLeast = 8;
  std::array<std::vector<double>, 2> modulations;
  std::array<std::vector<double>, 2> phases;
  // The material side's slope is taken off: its own change is no jump.
  double tt = 0.0, tp = 0.0, t_sum = 0.0, p_sum = 0.0, count = 0.0;
  for_each(frame, half_piece_px, from_px, -kMixed_px, [&](std::size_t at, double t, double) {
    if (map_->status[at] != base::PhaseStatus::kValid) return;
    const double phase = plane_->turns[at];
    tt += t * t;
    tp += t * phase;
    t_sum += t;
    p_sum += phase;
    count += 1.0;
  });
  const double determinant = count * tt - t_sum * t_sum;
  const double slope = determinant > 1e-9 ? (count * tp - t_sum * p_sum) / determinant : 0.0;
  for_each(frame, half_piece_px, from_px, to_px, [&](std::size_t at, double t, double) {
    if (std::abs(t) < kMixed_px) return;
    const std::size_t side = t < 0.0 ? 0 : 1;
    modulations[side].push_back(plane_->modulation[at]);
    if (map_->status[at] == base::PhaseStatus::kValid)
      phases[side].push_back(static_cast<double>(plane_->turns[at]) - slope * t);
  });
  if (phases[0].size() < kLeast || phases[1].size() < kLeast) return false;
  const double before = math::median(modulations[0]);
  const double beyond = math::median(modulations[1]);
  if (std::min(before, beyond) < kLit * std::max(before, beyond)) return false;
  return std::abs(math::median(phases[1]) - math::median(phases[0])) > kSame_turns;
}

}  // namespace crosstie::scan::detail
