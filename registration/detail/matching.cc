#include "registration/detail/matching.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Geometry>

#include "base/parallel.h"

namespace crosstie::registration::detail {
namespace {

using base::Pose;
using base::Result;
using Eigen::Vector3d;

constexpr std::size_t kChunk = 512;
constexpr double kAtBorder = 0.35;  // of a cell: how far beside a piece at the border its partner may lie
constexpr std::size_t kBoxSample = 200;

/// Distances of two pieces in the frame of both.
struct Meeting {
  Vector3d place, normal, along;
  double distance = 0.0;
};

Meeting meeting(const SurfacePiece& a, const SurfacePiece& b, const Pose& frame_from_a, const Pose& frame_from_b,
                bool oriented) {
  const Vector3d p = frame_from_a * a.point_mm;
  const Vector3d q = frame_from_b * b.point_mm;
  const Vector3d n_a = frame_from_a.rotation * a.normal;
  Vector3d n_b = frame_from_b.rotation * b.normal;
  if (!oriented && n_a.dot(n_b) < 0.0) n_b = -n_b;
  Meeting result;
  result.normal = (n_a + n_b).normalized();
  result.place = 0.5 * (p + q);
  result.distance = result.normal.dot(p - q);
  result.along = p - q - result.distance * result.normal;
  return result;
}

/// Fills in what depends on the poses; `sharing`: how many pieces of the first have each of the second as a partner.
void fill(const SurfacePiece& a, const SurfacePiece& b, const Meeting& at, int sharing, Match& match) {
  match.place_mm = at.place;
  match.normal = at.normal;
  match.distance_mm = at.distance;
  const double tilt = 0.25 * at.along.squaredNorm();
  const double first = a.sigma_mm * a.sigma_mm + a.tilt_rad * a.tilt_rad * tilt;
  const double second = b.sigma_mm * b.sigma_mm + b.tilt_rad * b.tilt_rad * tilt;
  match.sigma_mm = std::sqrt(first + sharing * second);
  match.scatter_mm = std::sqrt(first + second);
}

void fill_all(const Surface& first, const Surface& second, const Pose& frame_from_first, const Pose& frame_from_second,
              std::vector<Match>& matches) {
  std::vector<int> sharing(second.pieces().size(), 0);
  for (const Match& match : matches) ++sharing[static_cast<std::size_t>(match.b)];
  const bool oriented = first.oriented() && second.oriented();
  for (Match& match : matches) {
    const SurfacePiece& a = first.pieces()[static_cast<std::size_t>(match.a)];
    const SurfacePiece& b = second.pieces()[static_cast<std::size_t>(match.b)];
    fill(a, b, meeting(a, b, frame_from_first, frame_from_second, oriented), sharing[static_cast<std::size_t>(match.b)], match);
  }
}

}  // namespace

Result<std::vector<Match>> find_matches(const Surface& first, const Surface& second, const Pose& frame_from_first,
                                        const Pose& frame_from_second, const MatchGates& gates, int threads) {
  const Pose second_from_first = frame_from_second.inverse() * frame_from_first;
  const bool oriented = first.oriented() && second.oriented();
  const double cos_limit = std::cos(gates.max_normal_rad);
  const double radius = std::hypot(gates.reach_mm, gates.height_mm);
  const auto& pieces = first.pieces();
  std::vector<int> partner(pieces.size(), -1);
  const auto done =
      base::parallel_for((pieces.size() + kChunk - 1) / kChunk, threads, "matching", {}, [&](std::size_t chunk) -> Result<> {
        const std::size_t end = std::min(pieces.size(), (chunk + 1) * kChunk);
        for (std::size_t i = chunk * kChunk; i < end; ++i) {
          const Vector3d at = second_from_first * pieces[i].point_mm;
          if ((at - second.least_mm()).minCoeff() < -radius || (second.most_mm() - at).minCoeff() < -radius) continue;
          const int found = second.nearest(at, radius);
          if (found < 0) continue;
          const SurfacePiece& other = second.pieces()[static_cast<std::size_t>(found)];
          const double cosine = (second_from_first.rotation * pieces[i].normal).dot(other.normal);
          if ((oriented ? cosine : std::abs(cosine)) < cos_limit) continue;
          const Meeting meets = meeting(pieces[i], other, second_from_first, {}, oriented);
          const double reach = other.border ? std::min(gates.reach_mm, kAtBorder * second.cell_mm()) : gates.reach_mm;
          if (std::abs(meets.distance) > gates.height_mm || meets.along.squaredNorm() > reach * reach) continue;
          partner[i] = found;
        }
        return {};
      });
  if (!done) return tl::unexpected(done.error());
  std::vector<Match> matches;
  for (std::size_t i = 0; i < partner.size(); ++i) {
    if (partner[i] >= 0) matches.push_back({.a = static_cast<int>(i), .b = partner[i]});
  }
  fill_all(first, second, frame_from_first, frame_from_second, matches);
  return matches;
}

void update_matches(const Surface& first, const Surface& second, const Pose& frame_from_first, const Pose& frame_from_second,
                    std::vector<Match>& matches) {
  fill_all(first, second, frame_from_first, frame_from_second, matches);
}

bool may_overlap(const Surface& first, const Surface& second, const Pose& second_from_first, double margin_mm) {
  const std::size_t every = std::max<std::size_t>(1, first.pieces().size() / kBoxSample);
  for (std::size_t i = 0; i < first.pieces().size(); i += every) {
    const Vector3d at = second_from_first * first.pieces()[i].point_mm;
    if ((at - second.least_mm()).minCoeff() > -margin_mm && (second.most_mm() - at).minCoeff() > -margin_mm) return true;
  }
  return false;
}

}  // namespace crosstie::registration::detail
