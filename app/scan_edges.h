#pragma once

#include <vector>

#include "app/scan_view.h"
#include "base/edge_pixels.h"
#include "base/pattern_sequence.h"
#include "base/progress.h"

namespace crosstie::app {

/// Edges in both cameras' images, left first; white images are read again, since decoding lets images go.
base::Result<std::vector<base::EdgePixels>> scan_edges(const ScanTask& task, const base::PatternSequence& sequence,
                                                       const base::Head& head, const ScanParts& parts,
                                                       const base::Progress& progress);

}  // namespace crosstie::app
