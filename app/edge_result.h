#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include <nlohmann/json_fwd.hpp>

#include "base/result.h"
#include "edge/hole_edge.h"
#include "edge/nominal_fit.h"
#include "report/edge_report.h"

namespace crosstie::app {

/// The body of a result of `edge`: the rim, its gaps and the nominal fitted to it (null where none could be).
nlohmann::ordered_json edge_json(const edge::HoleEdge& hole, const std::optional<edge::NominalFit>& fit);

/// edge.csv (docs/formats.md). `source` tells the cameras that saw a point where there is one station, else the stations.
base::Result<> write_edge(const std::filesystem::path& path, const edge::HoleEdge& hole);

/// The page's lists and figures, without images.
report::EdgeView edge_view(const edge::HoleEdge& hole, const std::optional<edge::NominalFit>& fit);

/// Adds the two images of a station, with the edge pixels near the curve.
void add_edge_images(const edge::StationView& station, const base::EdgeCurve& curve, report::EdgeView& view);

/// "152 points over 4431.2 mm, closed, 0 gaps; ellipse 1400.1 mm (sigma 0.021) ..., rms 0.031 mm".
std::string edge_summary(const edge::HoleEdge& hole, const std::optional<edge::NominalFit>& fit);

}  // namespace crosstie::app
