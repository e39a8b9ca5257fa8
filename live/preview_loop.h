#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>

#include "base/result.h"
#include "devices/camera_pair.h"
#include "live/feed.h"
#include "live/preview.h"

namespace crosstie::live {

/// A pair of frames with what was seen in it, left and right.
struct PreviewPair {
  devices::FramePair frames;  ///< as they came
  std::array<CameraPicture, 2> pictures;
};

/// Takes pairs in their order, from one thread at a time. An Error, once and last, says that the cameras are lost or a frame cannot be
/// looked at. It may take as long as pictures may be apart; it must not call the loop.
using PreviewSink = std::function<void(base::Result<PreviewPair>)>;

/// How one camera does, since start().
struct PreviewCamera {
  devices::CameraState camera;
  std::uint64_t shown = 0;    ///< pictures published
  std::uint64_t dropped = 0;  ///< pairs that came while two others waited: what is shown is new, not complete
  /// Frames of which nothing arrived: ids that are missing, less those that arrived without a partner.
  std::uint64_t lost = 0;
  std::uint64_t swapped = 0;
  double rate_hz = 0.0;     ///< of pictures over the last two seconds; 0: none
  double latency_ms = 0.0;  ///< from the frame's arrival on the host to its picture's publication, of the latest one
};

struct PreviewStatistics {
  std::array<PreviewCamera, 2> cameras;
  devices::FramePairingCounts pairs;
};

/// Shows what two cameras see: pairs of frames in, pictures to the feed, measurements to the sink.
///
/// Two threads of its own, one for each camera's picture, which wait for each other at the end of a pair; at most two pairs wait, the
/// newest ones. So memory is bounded, and a machine that is too slow shows fewer pictures, none older than about three of them take.
/// start(), stop(), set_options() and statistics() may be called from any thread but the sink's.
class PreviewLoop {
 public:
  /// Source and feed outlive the loop.
  PreviewLoop(devices::PairSource& source, Feed& feed, PreviewSink sink, std::array<PreviewOptions, 2> options = {},
              devices::Clock clock = devices::host_now);
  ~PreviewLoop();

  /// Starts the source and the threads; a loop that runs is stopped before. Also again after the cameras were lost. Errors: those of
  /// options and source; then nothing runs.
  base::Result<devices::CameraSettings> start(const devices::CameraSettings& settings);
  /// After it the sink is not called any more.
  void stop();
  /// From the next pair on. Error kUsage for options out of their domain; those before stay.
  base::Result<> set_options(std::array<PreviewOptions, 2> options);
  [[nodiscard]] PreviewStatistics statistics();
  [[nodiscard]] bool running() const;

 private:
  class Run;

  devices::PairSource& source_;
  Feed& feed_;
  PreviewSink sink_;
  devices::Clock clock_;
  std::mutex starting_;       ///< of start() and stop() against each other
  mutable std::mutex mutex_;  ///< of the two below
  std::shared_ptr<const std::array<PreviewOptions, 2>> preview_;
  std::shared_ptr<Run> run_;
};

}  // namespace crosstie::live
