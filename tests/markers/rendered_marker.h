#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "base/image.h"
#include "markers/family.h"

namespace crosstie::tests {

/// One marker and its photograph, for the tests' own renderer (it shares no code with the detector).
struct MarkerScene {
  markers::MarkerFamily family;
  std::uint64_t code = 0;  ///< as in MarkerCode
  bool coded = true;       ///< false: the dot alone
  bool mirrored = false;
  bool dark_on_bright = false;  ///< of tags: as they are published; false: inverted
  int width_px = 96;
  int height_px = 96;
  Eigen::Vector2d centre_px = {47.5, 47.5};
  double radius_px = 8.0;      ///< of the dot, along the tilt axis; of tags: the side of a cell
  double tilt_rad = 0.0;       ///< parallel projection: the dot shrinks by cos(tilt) across the tilt axis
  double tilt_axis_rad = 0.0;  ///< direction of the tilt axis in the image
  double roll_rad = 0.3;       ///< turns the marker in its plane
  Eigen::Vector2d perspective = {
      0.0, 0.0};         ///< per px: tags only: cells = parallel projection of e / (1 + perspective . e), e from the centre
  double blur_px = 0.7;  ///< Gaussian of the lens; the pixel's box comes on top
  double dark_level = 20.0;
  double bright_level = 180.0;
  Eigen::Vector2d light_slope = {0.0, 0.0};  ///< relative change of the light per px, 0 in the centre
  int samples_per_px = 10;                   ///< along each axis; 10 for centres, 4 are enough for reading
};

/// Mean grey levels of the pixels, row by row: samples_per_px squared samples per pixel with exact cover of the edges to first
/// order, blurred on the fine grid, then averaged over each pixel.
std::vector<double> rendered(const MarkerScene& scene);

struct Noise {
  double sigma = 0.0;  ///< grey levels
  std::uint64_t seed = 1;
};

/// Adds Gaussian noise, rounds and cuts off at 0 and the white level.
base::Image photograph(const std::vector<double>& levels, int width_px, int height_px, const Noise& noise = {}, int bits = 8,
                       double white_level = 255.0);

inline base::Image photograph(const MarkerScene& scene, const Noise& noise = {}) {
  return photograph(rendered(scene), scene.width_px, scene.height_px, noise);
}

}  // namespace crosstie::tests
