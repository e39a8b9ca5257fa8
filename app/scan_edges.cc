#include "app/scan_edges.h"

#include <optional>

#include "base/image.h"
#include "scan/edge_pixels.h"
#include "scan/right_depths.h"

namespace crosstie::app {
namespace {

using base::Result;

/// The first photograph under full light, where the sequence has one.
Result<std::optional<base::Image>> white_image(const ScanTask& task, const base::PatternSequence& sequence,
                                               std::size_t camera) {
  for (const base::Pattern& pattern : sequence.patterns) {
    if (pattern.kind != base::PatternKind::kWhite) continue;
    auto image = base::read_image((camera == 0 ? task.left : task.right) / pattern.files[camera]);
    if (!image) return base::fail(std::move(image));
    if (task.white_levels[camera]) image->set_white_level(*task.white_levels[camera]);
    return std::optional<base::Image>(*std::move(image));
  }
  return std::optional<base::Image>();
}

}  // namespace

Result<std::vector<base::EdgePixels>> scan_edges(const ScanTask& task, const base::PatternSequence& sequence,
                                                 const base::Head& head, const ScanParts& parts,
                                                 const base::Progress& progress) {
  const std::vector<float> right = scan::right_depths(parts.depths, head);
  std::vector<base::EdgePixels> edges;
  for (std::size_t camera = 0; camera < 2; ++camera) {
    const auto white = white_image(task, sequence, camera);
    if (!white) return tl::unexpected(white.error());
    const scan::EdgeInput input{&parts.maps[camera], *white ? &**white : nullptr,
                                camera == 0 ? &parts.depths.depth_mm : &right};
    auto found = scan::find_edges(input, task.edges, progress);
    if (!found) return base::fail(std::move(found));
    found->camera = camera == 0 ? head.left_name : head.right_name;
    edges.push_back(*std::move(found));
  }
  return edges;
}

}  // namespace crosstie::app
