#include "live/frame_counter.h"

#include <cstddef>
#include <span>

namespace crosstie::live {
namespace {

constexpr std::size_t kKept = 128;

void count(std::span<const devices::FrameHeader> headers, const devices::FrameCheckOptions& options, FrameFaults& faults) {
  const auto findings = devices::check_frames(headers, options);
  if (!findings) return;
  for (const devices::FrameFinding& finding : *findings) {
    switch (finding.fault) {
      case devices::FrameFault::kLost:
        faults.lost += finding.count;
        break;
      case devices::FrameFault::kRepeated:
        ++faults.repeated;
        break;
      case devices::FrameFault::kSwapped:
        ++faults.swapped;
        break;
      case devices::FrameFault::kRestarted:
        ++faults.restarted;
        break;
      case devices::FrameFault::kMissed:
        faults.missed += finding.count;
        break;
    }
  }
}

}  // namespace

void FrameCounter::add(const devices::FrameHeader& header) {
  latest_.push_back(header);
  if (latest_.size() < 2 * kKept) return;
  // The last of the settled ones stays, for the step to the next.
  count(std::span(latest_).first(kKept), options_, before_);
  latest_.erase(latest_.begin(), latest_.begin() + static_cast<std::ptrdiff_t>(kKept - 1));
}

FrameFaults FrameCounter::faults() const {
  FrameFaults all = before_;
  count(latest_, options_, all);
  return all;
}

}  // namespace crosstie::live
