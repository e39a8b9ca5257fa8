#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "base/network.h"
#include "base/pose.h"
#include "base/result.h"
#include "math/circle_of_pair.h"

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

/// The images that the cameras of a rig took at one moment.
struct Station {
  std::string name;  ///< of its first image
  int rig = 0;
  std::vector<int> images;  ///< in the order of the rig's cameras
};

struct Rig {
  std::string name;
  std::vector<int> cameras;
};

/// A control group, reduced to the points of the survey.
struct Control {
  std::vector<int> points;
  Eigen::VectorXd xyz_mm;
  Eigen::VectorXd sigma_mm;
  std::vector<std::array<bool, 3>> held;  ///< the coordinates without variance
  Eigen::MatrixXd whitening;  ///< of the coordinates that are not held, columns of held ones zero; no rows: none is observed
};

struct Datum {
  int point = 0;
  Eigen::Vector3d xyz_mm = Eigen::Vector3d::Zero();
  std::array<bool, 3> axes = {true, true, true};
};

/// A network made ready for computing: checked, sorted, and with indices in place of names.
struct Survey {
  std::vector<base::NetworkCamera> cameras;  ///< sorted by name
  std::vector<std::string> images;           ///< sorted
  std::vector<int> camera_of_image;
  std::vector<int> ids;  ///< of the points, ascending
  /// The points before this index have ids of their own; those from it on are uncoded targets (uncoded.h).
  std::size_t coded_points = 0;
  std::vector<Ray> rays;  ///< by image, then point
  std::vector<std::vector<int>> rays_of_image;
  std::vector<std::vector<int>> rays_of_point;
  std::vector<Rig> rigs;
  std::vector<int> rig_of_camera;     ///< -1: it stands alone
  std::vector<int> station_of_image;  ///< -1: of a camera that stands alone
  std::vector<Station> stations;
  std::vector<Bar> bars;
  std::vector<Control> control;
  std::vector<Datum> datum;
  std::vector<std::optional<base::Pose>> start_poses;        ///< of each image
  std::vector<std::optional<Eigen::Vector3d>> start_points;  ///< of each point
  bool scale_is_free = false;
  std::optional<double> dot_diameter_mm;
  std::vector<base::Warning> warnings;

  /// The first camera of a rig, whose frame is the rig's.
  [[nodiscard]] bool leads_rig(int camera) const {
    const int rig = rig_of_camera[static_cast<std::size_t>(camera)];
    return rig >= 0 && rigs[static_cast<std::size_t>(rig)].cameras.front() == camera;
  }
  /// Index of a point by its id, -1 where no image shows it.
  [[nodiscard]] int point_of(int id) const;
  [[nodiscard]] base::LensModel lens(int image) const {
    return cameras[static_cast<std::size_t>(camera_of_image[static_cast<std::size_t>(image)])].camera.model();
  }
};

/// Checks and sorts. Detector covariances that are unusable (not finite, not positive, under a tenth of the median) become the
/// network's median; a sigma below a third of that median is raised to it, since no detector is that much better on one marker
/// of many.
base::Result<Survey> make_survey(const base::Network& network);

/// The same for the covariance of one more image point, where `typical_px` is the network's median sigma.
Eigen::Matrix2d usable_covariance(const Eigen::Matrix2d& cov_px2, double typical_px);

using math::shape_of;

}  // namespace crosstie::bundle::detail
