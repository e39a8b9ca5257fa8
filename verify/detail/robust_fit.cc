#include "verify/detail/robust_fit.h"

#include <algorithm>
#include <array>
#include <random>

#include "math/median.h"

namespace crosstie::verify::detail {
namespace {

using math::align;
using math::AlignmentPair;

constexpr std::size_t kAllTriplesUpTo = 12;  // 220 triples
constexpr int kSampledTriples = 400;
constexpr double kInlierMedians = 4.0;

std::vector<std::array<std::size_t, 3>> triples(std::size_t count) {
  std::vector<std::array<std::size_t, 3>> result;
  if (count <= kAllTriplesUpTo) {
    for (std::size_t i = 0; i < count; ++i) {
      for (std::size_t j = i + 1; j < count; ++j) {
        for (std::size_t k = j + 1; k < count; ++k) result.push_back({i, j, k});
      }
    }
    return result;
  }
  std::mt19937_64 random(1);
  while (result.size() < kSampledTriples) {
    const std::array<std::size_t, 3> triple = {random() % count, random() % count, random() % count};
    if (triple[0] != triple[1] && triple[0] != triple[2] && triple[1] != triple[2]) result.push_back(triple);
  }
  return result;
}

RobustFit evaluate(std::span<const AlignmentPair> pairs, const math::Alignment& alignment) {
  RobustFit fit;
  fit.a_from_b = alignment.a_from_b;
  fit.scale = alignment.scale;
  for (const AlignmentPair& pair : pairs) {
    const Eigen::Vector3d image =
        alignment.scale * (alignment.a_from_b.rotation * pair.b_mm) + alignment.a_from_b.translation_mm;
    fit.distance_mm.push_back((pair.a_mm - image).norm());
  }
  fit.median_mm = math::median(fit.distance_mm);
  return fit;
}

}  // namespace

std::vector<AlignmentPair> mirrored(std::span<const AlignmentPair> pairs) {
  std::vector<AlignmentPair> result(pairs.begin(), pairs.end());
  for (AlignmentPair& pair : result) pair.b_mm.z() = -pair.b_mm.z();
  return result;
}

std::optional<RobustFit> robust_fit(std::span<const AlignmentPair> pairs, bool with_scale) {
  if (pairs.size() < 4) return std::nullopt;
  const math::AlignmentOptions options{with_scale, false};
  std::optional<RobustFit> best;
  for (const auto& [i, j, k] : triples(pairs.size())) {
    const std::array<AlignmentPair, 3> triple = {pairs[i], pairs[j], pairs[k]};
    const auto alignment = align(triple, options);
    if (!alignment) continue;
    RobustFit fit = evaluate(pairs, *alignment);
    if (!best || fit.median_mm < best->median_mm) best = std::move(fit);
  }
  if (!best) return std::nullopt;
  std::vector<AlignmentPair> inliers;
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    if (best->distance_mm[i] <= kInlierMedians * best->median_mm) inliers.push_back(pairs[i]);
  }
  if (const auto alignment = align(inliers, options)) {
    RobustFit refined = evaluate(pairs, *alignment);
    if (refined.median_mm <= best->median_mm) best = std::move(refined);
  }
  return best;
}

}  // namespace crosstie::verify::detail
