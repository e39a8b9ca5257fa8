#include "scan/detail/edge_direction.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include <Eigen/Cholesky>

#include "math/median.h"

namespace crosstie::scan::detail {
namespace {

constexpr int kDirectionRounds = 2;

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
    return step_candidates(samples.profile, -kSearchInside_px, kSearchOutside_px, 1, 0.0).strongest;
  };
  PieceFrame turned = site.frame;
  turned.out = *by_gradient;
  if (strength(turned) > strength(site.frame)) site.frame = turned;
}

}  // namespace

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

base::Result<> find_directions(Sites& sites, const base::PhaseMap& map, const EdgeImages& images, const EdgeOptions& options,
                               const base::Progress& progress) {
  auto chosen = for_sites(sites.all, options.threads, "directions", progress, [&](std::size_t i, PieceSamples& samples) {
    choose_direction(sites.all[i], map, images, options, samples);
  });
  if (!chosen) return chosen;
  for (int round = 0; round < kDirectionRounds; ++round) {
    auto done = for_sites(sites.all, options.threads, "edges", progress, [&](std::size_t i, PieceSamples& samples) {
      fit_site(sites.all[i], images, options, kFirstBlur_px, 1, samples);
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

}  // namespace crosstie::scan::detail
