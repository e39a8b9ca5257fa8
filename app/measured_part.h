#pragma once

#include <filesystem>
#include <optional>

#include "app/job.h"
#include "app/part_position.h"
#include "base/result.h"
#include "base/stitching.h"
#include "edge/nominal_fit.h"

namespace crosstie::app {

/// What a stitching holds of the part: its markers with their joint covariance, and where its list of markers lies. `cloud` is read where
/// [part] position asks for the tower; the hole's centre is then that of `fit`.
/// Errors: those of reading the cloud and of fitting the shell.
base::Result<MeasuredPart> measured_part(const Job& job, const base::Stitching& stitching, const std::filesystem::path& cloud,
                                         const std::optional<edge::NominalFit>& fit, const Eigen::Vector3d& hole_in_nominal);

}  // namespace crosstie::app
