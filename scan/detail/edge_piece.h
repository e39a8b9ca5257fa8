#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include <Eigen/Core>

#include "base/image.h"
#include "base/phase_map.h"
#include "scan/detail/step_profile.h"

namespace crosstie::scan::detail {

/// A short piece of an edge: across it t = out . d - curvature s^2 / 2, along it s, d from the origin.
struct PieceFrame {
  Eigen::Vector2d origin_px = Eigen::Vector2d::Zero();
  Eigen::Vector2d out = Eigen::Vector2d::UnitX();  ///< unit, across the edge
  double curvature = 0.0;                          ///< [1/px]

  [[nodiscard]] Eigen::Vector2d along() const { return {-out.y(), out.x()}; }
};

/// The images of one camera in which edges are looked for: mean of the fringe images, modulation, the white image where there is one.
class EdgeImages {
 public:
  EdgeImages(const base::PhaseMap& map, const base::Image* white);

  /// Calls visit(pixel index, t, s) for the pixels within `half_piece_px` along and from_px to to_px across. Pixels outside of the image do not count.
  template <typename Visit>
  void for_each(const PieceFrame& frame, double half_piece_px, double from_px, double to_px, const Visit& visit) const;

  /// The levels about a piece, and the camera's noise in each image there. Returns how many images have them (the white one not where it is
  /// saturated, the modulation not where both sides are lit with different phases: mixed, they are weaker than either); 0 where too few
  /// pixels do.
  std::size_t samples(const PieceFrame& frame, double half_piece_px, double from_px, double to_px,
                      std::vector<ProfileSample>& samples, std::array<double, kMostEdgeImages>& noise_sigma) const;

 private:
  /// Whether both sides of a piece are lit with different phases.
  [[nodiscard]] bool phases_differ(const PieceFrame& frame, double half_piece_px, double from_px, double to_px) const;
  [[nodiscard]] double white_level(std::size_t x, std::size_t y) const;

  const base::PhaseMap* map_;
  const base::PhasePlane* plane_;
  const base::Image* white_;
  double gain_ = 0.0;  ///< variance of the modulation over that of a level
};

template <typename Visit>
void EdgeImages::for_each(const PieceFrame& frame, double half_piece_px, double from_px, double to_px,
                          const Visit& visit) const {
  const Eigen::Vector2d along = frame.along();
  Eigen::Vector2d low = frame.origin_px, high = frame.origin_px;
  for (const double t : {from_px, to_px}) {
    for (const double s : {-half_piece_px, half_piece_px}) {
      const Eigen::Vector2d corner = frame.origin_px + t * frame.out + s * along;
      low = low.cwiseMin(corner);
      high = high.cwiseMax(corner);
    }
  }
  const int x0 = std::max(0, static_cast<int>(std::floor(low.x())));
  const int x1 = std::min(map_->width - 1, static_cast<int>(std::ceil(high.x())));
  const int y0 = std::max(0, static_cast<int>(std::floor(low.y())));
  const int y1 = std::min(map_->height - 1, static_cast<int>(std::ceil(high.y())));
  for (int y = y0; y <= y1; ++y) {
    for (int x = x0; x <= x1; ++x) {
      const Eigen::Vector2d d = Eigen::Vector2d(x, y) - frame.origin_px;
      const double s = along.dot(d);
      if (std::abs(s) > half_piece_px) continue;
      const double t = frame.out.dot(d) - 0.5 * frame.curvature * s * s;
      if (t < from_px || t > to_px) continue;
      visit(map_->at(x, y), t, s);
    }
  }
}

}  // namespace crosstie::scan::detail
