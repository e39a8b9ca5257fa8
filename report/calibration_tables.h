#pragma once

#include <filesystem>
#include <span>

#include "base/calibration.h"
#include "base/calibration_quality.h"
#include "base/result.h"

namespace crosstie::report {

/// Writes a calibration as comma-separated tables into an existing folder, each atomically: cameras.csv, views.csv, board.csv,
/// corners.csv with every corner of `images`, whether it took part or not. Doubles read back exactly.
base::Result<> write_calibration_tables(const std::filesystem::path& folder, const base::Calibration& calibration,
                                        std::span<const base::BoardImage> images);

/// Writes the maps: uncertainty.csv of the cameras, and of a rig triangulation.csv.
base::Result<> write_map_tables(const std::filesystem::path& folder, const base::Calibration& calibration,
                                const base::CalibrationMaps& maps);

}  // namespace crosstie::report
