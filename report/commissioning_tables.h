#pragma once

#include <filesystem>

#include "base/machine.h"
#include "base/result.h"

namespace crosstie::report {

/// Writes a commissioning as comma-separated tables into an existing folder, each atomically (docs/formats.md): stations.csv,
/// spheres.csv, terms.csv, residuals.csv, markers.csv, rejected.csv.
base::Result<> write_commissioning_tables(const std::filesystem::path& folder, const base::Commissioning& result);

}  // namespace crosstie::report
