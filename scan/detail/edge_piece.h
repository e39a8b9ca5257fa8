#pragma once

#include <algorithm>
#include <array>
#include <cmath>
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

/// What is read of the pixels of a piece, and room for work: one for each thread, used again from piece to piece.
struct PieceSamples {
  ProfileSamples profile;
  std::array<double, kMostEdgeImages> noise_sigma = {};  ///< of the camera, in each image
  double phase_slope_turns = 0.0;                        ///< per px across the edge, of the material side
  double light_slope_sigma = 0.0;  ///< of the relative change of brightness per px that was taken off the material side

  /// Pixels to one side of the edge.
  struct Side {
    std::vector<double> modulations;
    std::vector<double> across_px, phases;  ///< of those with a phase
  };
  std::array<Side, 2> sides;
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
  std::size_t read(const PieceFrame& frame, double half_piece_px, double from_px, double to_px, PieceSamples& samples) const;
  /// The same about an edge that is known to some tenths of a pixel, whose point spread is `blur_px`: a steady change of brightness on the
  /// material side is taken off. Levels that step between even sides would be 3.8 times its relative change per px too far out, towards
  /// where it becomes brighter (with 7 px to each side): 0.01 px where a projector's light falls off by 0.25 % per px.
  std::size_t read_even(const PieceFrame& frame, double half_piece_px, double from_px, double to_px, double blur_px,
                        PieceSamples& samples) const;

 private:
  /// Whether both sides of a piece are lit with different phases; `slope` becomes the material side's, in turns per px.
  [[nodiscard]] bool phases_differ(const PieceFrame& frame, double half_piece_px, double from_px, double to_px,
                                   std::array<PieceSamples::Side, 2>& sides, double& slope) const;

  const base::PhaseMap* map_;
  const base::PhasePlane* plane_;
  std::vector<float> white_;   ///< levels; empty: there is no white image
  double nearly_white_ = 0.0;  ///< from there on they are cut off
  double gain_ = 0.0;          ///< variance of the modulation over that of a level
};

/// The middle value, of an even number the upper one; the values are reordered, none may be missing.
inline double middle(std::vector<double>& values) {
  const auto at = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

/// Narrows [low, high] to the x with from <= slope x + offset <= to.
inline void narrow(double slope, double offset, double from, double to, double& low, double& high) {
  if (std::abs(slope) < 1e-9) return;
  const double a = (from - offset) / slope;
  const double b = (to - offset) / slope;
  low = std::max(low, std::min(a, b));
  high = std::min(high, std::max(a, b));
}

template <typename Visit>
void EdgeImages::for_each(const PieceFrame& frame, double half_piece_px, double from_px, double to_px,
                          const Visit& visit) const {
  const Eigen::Vector2d along = frame.along();
  const double sagitta = 0.5 * std::abs(frame.curvature) * half_piece_px * half_piece_px;
  const double reach_y = std::abs(along.y()) * half_piece_px;
  const double low = std::min(frame.out.y() * from_px, frame.out.y() * to_px) - reach_y - sagitta;
  const double high = std::max(frame.out.y() * from_px, frame.out.y() * to_px) + reach_y + sagitta;
  const int y0 = std::max(0, static_cast<int>(std::floor(frame.origin_px.y() + low)));
  const int y1 = std::min(map_->height - 1, static_cast<int>(std::ceil(frame.origin_px.y() + high)));
  for (int y = y0; y <= y1; ++y) {
    const double dy = y - frame.origin_px.y();
    double left = -frame.origin_px.x();
    double right = map_->width - 1 - frame.origin_px.x();
    narrow(along.x(), along.y() * dy, -half_piece_px, half_piece_px, left, right);
    narrow(frame.out.x(), frame.out.y() * dy, from_px - sagitta, to_px + sagitta, left, right);
    const int x0 = std::max(0, static_cast<int>(std::floor(frame.origin_px.x() + left)));
    const int x1 = std::min(map_->width - 1, static_cast<int>(std::ceil(frame.origin_px.x() + right)));
    for (int x = x0; x <= x1; ++x) {
      const double dx = x - frame.origin_px.x();
      const double s = along.x() * dx + along.y() * dy;
      if (std::abs(s) > half_piece_px) continue;
      const double t = frame.out.x() * dx + frame.out.y() * dy - 0.5 * frame.curvature * s * s;
      if (t < from_px || t > to_px) continue;
      visit(map_->at(x, y), t, s);
    }
  }
}

}  // namespace crosstie::scan::detail
