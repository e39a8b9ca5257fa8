#pragma once

#include <filesystem>

#include "base/network.h"
#include "base/result.h"
#include "base/verification.h"

namespace crosstie::report {

/// Writes an adjustment as comma-separated tables into an existing folder, each atomically; units stand in the column names
/// (docs/formats.md): points.csv, images.csv, cameras.csv, residuals.csv, scale_bars.csv, rejected.csv. Doubles read back
/// exactly. A table without rows is written with its header alone.
base::Result<> write_bundle_tables(const std::filesystem::path& folder, const base::AdjustedNetwork& network);

/// Writes deviations.csv and lengths.csv.
base::Result<> write_verification_tables(const std::filesystem::path& folder, const base::Verification& verification);

}  // namespace crosstie::report
