#pragma once

#include <string>
#include <vector>

#include "base/observation.h"
#include "report/context.h"

namespace crosstie::report {

/// One HTML page on what was found in which image: counts by status, exposure, sizes of the dots, predicted sigmas, and which
/// id was seen in which image.
///
/// `overlay_hrefs` is empty or has one entry per image: a path relative to the page of the picture with the markers drawn in,
/// or an empty string where there is none. This is the only report that needs files beside it. The same input gives the same
/// bytes; times of day and durations are not shown.
std::string detection_report(const std::vector<base::ImageObservations>& images, const std::vector<std::string>& overlay_hrefs,
                             const ReportContext& context);

}  // namespace crosstie::report
