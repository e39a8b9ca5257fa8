#pragma once

#include <string>

#include "base/cloud.h"
#include "base/stitching.h"
#include "report/context.h"

namespace crosstie::report {

/// The report of `stitch`: where every station is and which source tells each of its directions, how the surfaces agree where they
/// overlap, how far a row of stations may drift, markers, the matching loop (ICP), and the merged cloud in 3D.
std::string stitching_report(const base::Stitching& stitching, const base::Cloud& merged, const ReportContext& context);

}  // namespace crosstie::report
