#pragma once

#include <string>

#include "base/network.h"
#include "report/context.h"

namespace crosstie::report {

/// One self-contained HTML page on an adjustment: verdicts, sigma0 with its test, points, images and cameras with their
/// sigmas and U (k = 2), scale bars, rejected observations, residual plots and a 3D view. It opens offline, asks for no other
/// file and holds no date: the same input gives the same bytes. Without JavaScript or WebGL all but the 3D view and the
/// sorting of tables remains.
///
/// The network is taken as it is: nothing is adjusted or transformed here. An empty network gives a page that says so.
std::string bundle_report(const base::AdjustedNetwork& network, const ReportContext& context);

}  // namespace crosstie::report
