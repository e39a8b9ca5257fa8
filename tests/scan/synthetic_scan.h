#pragma once

#include <array>
#include <cmath>
#include <functional>
#include <optional>
#include <random>
#include <vector>

#include <Eigen/Core>

#include "base/image.h"
#include "base/machine.h"
#include "base/pattern_sequence.h"

namespace crosstie::tests {

/// A head of two distorted cameras before a surface on which a pinhole projector shows patterns; images by the formula of light, pixel
/// by pixel, with what every pixel sees known exactly. Nothing here calls the module under test.
struct SyntheticScan {
  int width = 320;
  int height = 240;
  base::Head head;
  /// Distance along a ray (unit direction, left camera's frame) at which it meets the surface from `origin`; nothing: it passes by.
  std::function<std::optional<double>(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction)> surface;
  std::function<double(double u, double v)> albedo = [](double, double) { return 1.0; };  ///< by projector coordinates 0..1
  double ambient = 20.0;                                                                  ///< grey levels of albedo 1
  double amplitude = 90.0;                                                                ///< B of albedo 1
  double read_sigma = 1.0;                                                                ///< grey levels
  double shot = 0.01;                                                                     ///< variance per grey level
  double gamma = 1.0;  ///< of the projector: light = level^gamma
  int bits = 8;
  double white = 255.0;

  SyntheticScan();

  /// What one pixel of a camera (0 left, 1 right) sees.
  struct Seen {
    Eigen::Vector3d point_mm;  ///< in the left camera's frame
    double u = 0.0, v = 0.0;   ///< of the projector, 0..1 over its extent
  };
  [[nodiscard]] const std::optional<Seen>& seen(int camera, int x, int y) const;
  /// The image of a pattern, noise drawn by `random`.
  [[nodiscard]] base::Image image(int camera, const base::PatternSequence& sequence, const base::Pattern& pattern,
                                  std::mt19937_64& random) const;

 private:
  [[nodiscard]] std::optional<Seen> trace(int camera, int x, int y) const;
  mutable std::array<std::vector<std::optional<Seen>>, 2> seen_;  ///< of all pixels, once they are asked for
};

/// Errors over their predicted sigmas.
class NormalisedErrors {
 public:
  /// Beyond 6 sigmas an error counts as far, and not in mean and rms.
  void add(double error) {
    ++count;
    if (std::abs(error) > 6.0) return add_far();
    sum_ += error;
    squares_ += error * error;
  }
  void add_far() { ++far; }
  [[nodiscard]] double mean() const { return sum_ / count; }
  [[nodiscard]] double rms() const { return std::sqrt(squares_ / count); }

  int count = 0;
  int far = 0;

 private:
  double sum_ = 0.0;
  double squares_ = 0.0;
};

/// A plane at `z_mm` on the axis, turned by `tilt_rad` about the vertical.
std::function<std::optional<double>(const Eigen::Vector3d&, const Eigen::Vector3d&)> tilted_plane(double z_mm, double tilt_rad);

/// Fringes of one axis with a Gray code to half periods: `steps` even shifts.
base::PatternSequence gray_and_fringes(double fringes, int steps, bool inverse, bool both_axes);

}  // namespace crosstie::tests
