#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "base/point_list.h"
#include "base/result.h"

namespace crosstie::base {

// The files of an AICON 3D Studio project as they stand: blank-separated ASCII, mm and rad. Image coordinates are in mm from
// the sensor's centre, x to the right and y up. Nothing is converted here, so that networks can be adjusted to their last
// digit.
//
// All readers: files over 1 GiB, other numbers of columns, values that are not finite, ids that are not non-negative integers,
// double entries and files without any entry are Errors (kBadInput) with file and line. `fix` in place of a sigma is nothing.

/// A row of a `.phc` file: image point x y sx sy vx vy method active internal. One image may list a point
/// several times, as candidates.
struct AiconImagePoint {
  int image = 0;
  int point = 0;
  Eigen::Vector2d xy_mm = Eigen::Vector2d::Zero();
  Eigen::Vector2d sigma_mm = Eigen::Vector2d::Zero();     ///< of the ellipse fit; not what AICON adjusts with
  Eigen::Vector2d residual_mm = Eigen::Vector2d::Zero();  ///< of AICON's own adjustment
  int method = 0;
  bool active = false;  ///< took part
  int internal = 0;
};

/// A row of an `.obc` file: point x y z sx sy sz rays active [new [datum]].
struct AiconObjectPoint {
  int id = 0;
  Eigen::Vector3d xyz_mm = Eigen::Vector3d::Zero();
  std::optional<Eigen::Vector3d> sigma_mm;
  int rays = 0;
  bool active = false;
  bool is_new = false;
  bool datum = false;
};

/// A row of an `.eor` file: image camera X0 Y0 Z0 omega phi kappa order status orientation.
///
/// With (kx, ky, kz) = R(omega, phi, kappa)^T (X - X0) a point lies at xs = -c kx / kz, ys = -c ky / kz on the ideal sensor;
/// R = R_x(omega) R_y(phi) R_z(kappa) for rotation order 0.
struct AiconImage {
  int image = 0;
  int camera = 0;
  Eigen::Vector3d position_mm = Eigen::Vector3d::Zero();
  Eigen::Vector3d omega_phi_kappa_rad = Eigen::Vector3d::Zero();
  int rotation_order = 0;
  int status = 0;
  int orientation_status = 0;
};

/// An entry of an `.ior` file: five lines `id -999 -c xh yh A1 A2 r0`, `A3`, `B1 B2`, `C1 C2`, `width height [mm] columns rows
/// [px]`. The principal distance stands there with its sign; here it is positive.
struct AiconCamera {
  int id = 0;
  double c_mm = 0.0;
  Eigen::Vector2d principal_point_mm = Eigen::Vector2d::Zero();  ///< from the sensor's centre, y up
  double a1 = 0.0, a2 = 0.0, a3 = 0.0;                           ///< radial, balanced: 1/mm^2, 1/mm^4, 1/mm^6
  double r0_mm = 0.0;                                            ///< radius at which the radial distortion is zero
  double b1 = 0.0, b2 = 0.0;                                     ///< decentring, 1/mm
  double c1 = 0.0, c2 = 0.0;                                     ///< affinity and shear
  Eigen::Vector2d sensor_mm = Eigen::Vector2d::Zero();
  int width_px = 0;
  int height_px = 0;
};

/// A row of a `.scale` file: number "name" a b length sigma active.
struct AiconScale {
  std::string name;
  int id_a = 0;
  int id_b = 0;
  double length_mm = 0.0;
  double sigma_mm = 0.0;
  bool active = false;
};

Result<std::vector<AiconImagePoint>> read_aicon_image_points(const std::filesystem::path& phc);
Result<std::vector<AiconObjectPoint>> read_aicon_object_points(const std::filesystem::path& obc);
Result<std::vector<AiconImage>> read_aicon_images(const std::filesystem::path& eor);
Result<std::vector<AiconCamera>> read_aicon_cameras(const std::filesystem::path& ior);
Result<std::vector<AiconScale>> read_aicon_scales(const std::filesystem::path& scale);

/// Writes an `.obc` file atomically, to 1e-9 mm: sigmas from the covariances' diagonals (`fix` where a point has none), rays 0,
/// active, not new, no datum point. What an `.obc` file cannot hold, the correlations, is lost.
Result<> write_aicon_object_points(const std::filesystem::path& obc, const PointList& list);

}  // namespace crosstie::base
