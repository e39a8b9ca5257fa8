#pragma once

#include <filesystem>
#include <string>

#include "base/result.h"
#include "edge/nominal.h"

namespace crosstie::edge {

struct NominalFileOptions {
  std::string unit = {};  ///< "mm", "m", "inch"; empty: the column names must carry it (x_mm, x_inch)
  bool closed = true;     ///< false: the list is an open curve
  bool spline = true;     ///< false: straight lines join its points
};

/// Reads a nominal hole as a list of points in their order along it: whatever base/measured_points.h reads, and of a table with the
/// columns nx, ny, nz the surface's normals towards the head. Where the last point is that of the beginning, it is left out.
///
/// Units are never guessed: kUsage where none is stated. Else the Errors of read_measured_points() and NominalCurve::make().
base::Result<Nominal> read_nominal(const std::filesystem::path& path, const NominalFileOptions& options = {});

}  // namespace crosstie::edge
