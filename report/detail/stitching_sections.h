#pragma once

#include <string>
#include <vector>

#include "base/cloud.h"
#include "base/stitching.h"
#include "report/detail/page.h"

namespace crosstie::report::detail {

std::vector<KeyFigure> stitching_key_figures(const base::Stitching& stitching, std::size_t merged_points);
std::string stitching_stations_section(const base::Stitching& stitching);
std::string stitching_sources_section(const base::Stitching& stitching);
std::string stitching_overlap_section(const base::Stitching& stitching);
std::string stitching_drift_section(const base::Stitching& stitching);
std::string stitching_markers_section(const base::Stitching& stitching);
std::string stitching_matching_section(const base::Stitching& stitching);

/// A sample of the merged cloud and the markers as the 3D view's JSON (detail/scene.h): points by the difference of two stations there, in
/// sigmas.
std::string stitching_scene(const base::Stitching& stitching, const base::Cloud& merged);

}  // namespace crosstie::report::detail
