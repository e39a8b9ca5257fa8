#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "base/result.h"
#include "base/scale_bar.h"

namespace crosstie::base {

/// Known coordinates of a target, in mm, in the frame that its list belongs to.
struct ReferencePoint {
  int id = 0;
  Eigen::Vector3d xyz_mm = Eigen::Vector3d::Zero();
  std::optional<Eigen::Matrix3d> cov_mm2;  ///< nothing where the list gives no sigmas
  /// False: an uncoded target, numbered by the adjustment that found it; its number says nothing in another list.
  bool has_own_id = true;
};

/// A list of known points, sorted by id.
struct PointList {
  std::vector<ReferencePoint> points;

  [[nodiscard]] const ReferencePoint* find(int id) const;
};

/// How to read a list of points whose header does not say.
struct PointListOptions {
  std::string unit;  ///< "mm", "m", "inch"; empty: the column names must carry it (x_mm), or the file is an AICON object list
};

/// Reads a list of points.
///
/// Either a table with a header line that names the columns (`id,x_mm,y_mm,z_mm[,sigma_x_mm,sigma_y_mm,sigma_z_mm]` or
/// `cov_xx_mm2 ... cov_zz_mm2`; separated by comma, semicolon, tab or blanks, `#` starts a comment), or an AICON object list
/// (`id x y z sx sy sz rays ...`, blank-separated, no header, sigmas may read `fix`), which is recognised by its content and is
/// in mm. Units are never guessed. Duplicate ids, missing columns, values that are not finite and lines that cannot be read
/// are Errors with file and line. A column `kind` in which a point is "uncoded" clears ReferencePoint::has_own_id.
Result<PointList> read_point_list(const std::filesystem::path& path, const PointListOptions& options = {});

/// Writes `id,x_mm,y_mm,z_mm[,sigma...]` with 17 significant digits, atomically; sigmas where every point has a covariance.
Result<> write_point_list(const std::filesystem::path& path, const PointList& list);

/// Reads `id_a,id_b,length_mm,sigma_mm[,temperature_c,cte_per_k,role,certificate]`; role is used or check.
Result<std::vector<ScaleBar>> read_scale_bars(const std::filesystem::path& path);
Result<> write_scale_bars(const std::filesystem::path& path, const std::vector<ScaleBar>& bars);

}  // namespace crosstie::base
