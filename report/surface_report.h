#pragma once

#include <filesystem>
#include <string>

#include "base/result.h"
#include "base/surface_verification.h"
#include "base/verification.h"
#include "report/context.h"

namespace crosstie::report {

/// One self-contained HTML page on a cloud and a hole held against their references: deviation map with a fixed legend, histogram, cone or
/// cylinder with sigmas, hair diagram of the rim; with `points` also what verification_report() shows of reference points.
std::string surface_report(const base::SurfaceVerification& verification, const ReportContext& context,
                           const base::Verification* points = nullptr);

/// surface.csv: x_mm,y_mm,z_mm,deviation_mm of every point that was compared, and edge_deviations.csv:
/// s_mm,u_mm,v_mm,sigma_u_mm,sigma_v_mm; those that there are.
base::Result<> write_surface_tables(const std::filesystem::path& folder, const base::SurfaceVerification& verification);

}  // namespace crosstie::report
