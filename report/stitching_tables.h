#pragma once

#include <filesystem>

#include "base/result.h"
#include "base/stitching.h"

namespace crosstie::report {

/// Writes a stitching as comma-separated tables into an existing folder, each atomically (docs/formats.md): stations.csv, directions.csv,
/// overlap.csv, markers.csv, rejected.csv.
base::Result<> write_stitching_tables(const std::filesystem::path& folder, const base::Stitching& stitching);

}  // namespace crosstie::report
