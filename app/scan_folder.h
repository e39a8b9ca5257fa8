#pragma once

#include <array>
#include <filesystem>
#include <string>
#include <vector>

#include "base/edge_pixels.h"
#include "base/machine.h"
#include "base/result.h"
#include "base/scan_summary.h"

namespace crosstie::app {

/// What a scan's result folder holds for those that go on with it.
struct ScanFolder {
  base::Head head;
  std::array<base::EdgePixels, 2> edges;  ///< left, right
  std::vector<float> depth_mm;            ///< of each left pixel, not a number where there is none
  std::vector<float> sigma_mm;            ///< along the ray
  std::vector<base::HeadTest::Place>
      off_curve;  ///< places of the scan's test of its head; none in scans that did not keep them
  std::vector<std::filesystem::path> files;
};

/// `head` as read_head() has it; empty: the one in the scan's options. kBadInput where files of the folder contradict each other, or
/// the head's files are not those that the scan was made with.
base::Result<ScanFolder> read_scan_folder(const std::filesystem::path& folder, const std::string& head);

}  // namespace crosstie::app
