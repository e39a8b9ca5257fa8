#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "base/result.h"

namespace crosstie::base {

/// Points that somebody measured on a thing, in the order of their file; they need no ids.
struct MeasuredPoints {
  std::vector<Eigen::Vector3d> points_mm;
  std::vector<Eigen::Matrix3d> cov_mm2;  ///< empty, or one for each point
  std::string frame;                     ///< where the file says it
};

struct MeasuredPointsOptions {
  std::string unit;                  ///< "mm", "m", "inch"; empty: the file must say it
  std::vector<std::string> columns;  ///< three names, or three numbers from 1 on; empty: x, y, z, or the first three
};

/// Reads points from whatever holds some, recognised by content:
///   - PLY (base/ply.h); a comment `unit mm` states the unit;
///   - lists of points (base/point_list.h: a header with id, or an AICON .obc), with their sigmas or covariances;
///   - a table with a header (base/table.h) with x_mm, y_mm, z_mm (or _m, _inch), or x, y, z and a stated unit, or with the columns
///     that `columns` names;
///   - numbers without a header, three or more a line and everywhere as many, separated by blanks, tabs, commas or semicolons; `#`
///     starts a comment. A first line with one whole number (NIST's .ds) is the number of lines that follow.
///
/// Units are never guessed: a kUsage Error asks for one where the file does not say it; kBadInput where it says another one, and,
/// with file and line, for what cannot be read, values that are not finite, and counts that do not agree.
Result<MeasuredPoints> read_measured_points(const std::filesystem::path& path, const MeasuredPointsOptions& options = {});

}  // namespace crosstie::base
