#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

#include "base/result.h"
#include "devices/frame.h"

namespace crosstie::devices {

struct FrameCheckOptions {
  /// Bits in which the camera counts. 16: GigE Vision 1.x, whose ids run from 1 to 65535 and leave out 0. 64: they never start over.
  int id_bits = 64;
  /// Time between two exposures where the trigger has a period: a step of more than 1.5 of it in the device's time is an exposure that
  /// the camera missed without counting it. 0: the trigger has none.
  double period_s = 0.0;

  [[nodiscard]] base::Result<> validate() const;
};

enum class FrameFault {
  kLost,       ///< ids are missing: frames that the camera took and that did not arrive
  kRepeated,   ///< an id that came before
  kSwapped,    ///< the frame came after a later one, or ids and device times order the frames differently
  kRestarted,  ///< the count began anew although the time went on: what lies between is unknown
  kMissed,     ///< ids follow each other, but the time between them holds more than one period
};

[[nodiscard]] std::string_view frame_fault_name(FrameFault fault);

struct FrameFinding {
  FrameFault fault = FrameFault::kLost;
  std::size_t index = 0;    ///< of the header at which it shows
  std::uint64_t count = 1;  ///< frames lost or missed before it
};

/// Holds the headers of consecutive frames of one camera, in the order in which they arrived, against each other. Empty: every
/// exposure from the first to the last arrived once and in its order.
///
/// Ids are continued over their wrap by the nearest step, so a gap of half the range or more counts as a restart. A frame that arrives late
/// is swapped and not lost. Device times of 0 are not compared.
/// Error: kUsage for options out of their domain.
base::Result<std::vector<FrameFinding>> check_frames(std::span<const FrameHeader> headers,
                                                     const FrameCheckOptions& options = {});

}  // namespace crosstie::devices
