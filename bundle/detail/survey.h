#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "base/network.h"
#include "base/result.h"

namespace crosstie::bundle::detail {

/// One coded marker in one image.
struct Ray {
  int image = 0;
  int point = 0;
  Eigen::Vector2d measured_px = Eigen::Vector2d::Zero();  ///< of the circle's centre (eccentricity.h); at first the ellipse's
  Eigen::Matrix2d cov_px2 = Eigen::Matrix2d::Zero();      ///< the detector's, made usable
  double size_px = 0.0;                                   ///< semi-major axis of the dot, 0 where unknown
  bool twin = false;                                      ///< its id was read more than once in its image
  Eigen::Vector2d ellipse_px = Eigen::Vector2d::Zero();   ///< centre of the ellipse, as the detector found it
  Eigen::Matrix2d shape_px2 =
      Eigen::Matrix2d::Zero();  ///< the ellipse: its points are c + sqrt(shape) (cos t, sin t); 0 unknown
};

/// A scale bar both ends of which are points of the survey.
struct Bar {
  int point_a = 0;
  int point_b = 0;
  base::ScaleBar bar;
};

/// A network made ready for computing: checked, sorted, and with indices in place of names.
struct Survey {
  std::vector<base::NetworkCamera> cameras;  ///< sorted by name
  std::vector<std::string> images;           ///< sorted
  std::vector<int> camera_of_image;
  std::vector<int> ids;   ///< of the points, ascending
  std::vector<Ray> rays;  ///< by image, then point
  std::vector<std::vector<int>> rays_of_image;
  std::vector<std::vector<int>> rays_of_point;
  std::vector<Bar> bars;
  bool scale_is_free = false;
  std::vector<base::Warning> warnings;

  [[nodiscard]] base::LensModel lens(int image) const {
    return cameras[static_cast<std::size_t>(camera_of_image[static_cast<std::size_t>(image)])].camera.model();
  }
};

/// Checks and sorts. Detector covariances that are unusable (not finite, not positive, under a tenth of the median) become the
/// network's median; a sigma below a third of that median is raised to it, since no detector is that much better on one marker
/// of many.
base::Result<Survey> make_survey(const base::Network& network);

}  // namespace crosstie::bundle::detail
