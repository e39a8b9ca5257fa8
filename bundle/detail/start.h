#pragma once

#include <optional>
#include <string>
#include <vector>

#include "base/progress.h"
#include "base/result.h"
#include "bundle/adjust.h"
#include "bundle/detail/state.h"

namespace crosstie::bundle::detail {

/// Poses, points and lenses good enough for the adjustment to converge, from the image points alone.
///
/// For the pairs of images with many common markers and a large parallax: relative orientation (all candidates of two_view.h),
/// then image by image: resection, triangulation, a robust bundle in between; lens parameters are freed step by step as images
/// of their camera come in. The outcome with the least truncated sum of squares wins; an outcome that explains nearly
/// everything ends the search. Images that cannot be oriented stay without a pose.
///
/// `free_lens` are the parameters that the adjustment will estimate in the end, for each camera.
base::Result<State> orient(const Survey& survey, const AdjustOptions& options, const std::vector<std::vector<int>>& free_lens,
                           const base::Progress& progress);

/// The network at the start values that were given, brought near its minimum; points without any are triangulated. Nothing where
/// an image has none, or where they lead to no minimum that explains nearly everything.
std::optional<State> from_start_values(const Survey& survey, const AdjustOptions& options,
                                       const std::vector<std::vector<int>>& free_lens, const base::Progress& progress);

/// Error kNoUniqueSolution where the images fall into blocks that share fewer than three markers, naming them.
base::Result<> check_connection(const Survey& survey);

}  // namespace crosstie::bundle::detail
