#pragma once

#include <cstdint>
#include <vector>

#include "devices/frame_check.h"

namespace crosstie::live {

/// What was wrong with the frames of one camera since it was started.
struct FrameFaults {
  std::uint64_t lost = 0;     ///< ids that are missing
  std::uint64_t swapped = 0;  ///< came late, or ids and device times order them differently
  std::uint64_t repeated = 0;
  std::uint64_t restarted = 0;  ///< the count began anew
  std::uint64_t missed = 0;     ///< exposures that the camera did not count
};

/// devices::check_frames for frames that never end: the latest 128 to 256 headers are held against each other, what was found in those
/// before is kept as a number. A frame that comes late by more than that is lost and swapped. Not safe to call from several threads.
class FrameCounter {
 public:
  /// `options` are valid.
  explicit FrameCounter(const devices::FrameCheckOptions& options = {}) : options_(options) {}
  /// Counts for what is added later, and for the latest frames.
  void set_options(const devices::FrameCheckOptions& options) { options_ = options; }
  void add(const devices::FrameHeader& header);
  [[nodiscard]] FrameFaults faults() const;

 private:
  devices::FrameCheckOptions options_;
  std::vector<devices::FrameHeader> latest_;
  FrameFaults before_;
};

}  // namespace crosstie::live
