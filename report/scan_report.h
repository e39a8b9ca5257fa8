#pragma once

#include <string>

#include "base/scan_summary.h"
#include "report/context.h"

namespace crosstie::report {

/// One HTML page on a scan: how many points and how good, what became of the pixels, depths and sigmas over the image, the cameras' noise and
/// the fringes' quality, the test of the calibration. The same input gives the same bytes.
std::string scan_report(const base::ScanSummary& scan, const ReportContext& context);

}  // namespace crosstie::report
