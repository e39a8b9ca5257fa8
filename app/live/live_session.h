#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "app/live/capture.h"
#include "app/live/live_status.h"
#include "app/live/tapped_pairs.h"
#include "base/image.h"
#include "base/pattern_sequence.h"
#include "base/result.h"
#include "devices/axis_reader.h"
#include "devices/camera_pair.h"
#include "devices/pattern_sequencer.h"
#include "live/feed.h"

namespace crosstie::app {

/// The images that the projector shows for a sequence, in its order. kBadInput where they are not those of this sequence.
using PatternImages = std::function<base::Result<std::vector<base::Image>>(const base::PatternSequence&)>;

/// What a job is taken with. All of it outlives the session.
struct LiveDevices {
  devices::PairSource* pairs = nullptr;
  devices::AxisReader* axis = nullptr;
  devices::TypedAxis* typed = nullptr;  ///< the same, where positions are typed in on the page
  double axis_max_age_s = 10.0;         ///< an older reading is refused; default: nobody drives the beam and forgets it within
  devices::PatternSequencer* projector = nullptr;  ///< none: nothing can be scanned
  PatternImages pattern_images = {};
  devices::CameraSettings preview = {};  ///< while the operator looks; best those of measuring images: changing them takes time
  double preview_hz = 10.0;              ///< of pairs on a software trigger
  CaptureOptions capture = {};           ///< of measuring images
  /// Hears what the operator is told to do next: how many shots the stage has, and which station is next. Must not wait.
  std::function<void(LiveStage stage, int have, const std::string& station)> wanted = {};
};

/// Guides an operator through a job at the machine: calibrate, commission, scan. It takes the images into an ordinary job folder, runs the
/// verbs on it, and publishes all that the page shows.
///
/// What counts is what lies in the folder: after a kill the next session goes on where this one was. An axis reading is written into
/// job.toml before the images that belong to it are put into their place. Nothing that was taken is deleted: repeat and undo put it
/// aside (put_aside()).
class LiveSession {
 public:
  /// Starts the cameras; cameras that do not answer are told of and can be connected again. Errors: those of the job.
  static base::Result<std::unique_ptr<LiveSession>> begin(const std::filesystem::path& job, LiveDevices devices,
                                                          live::Feed& feed, int threads);
  /// Cancels what runs, stops the cameras.
  ~LiveSession();
  LiveSession(const LiveSession&) = delete;
  LiveSession& operator=(const LiveSession&) = delete;

  /// Does what a page asks for (docs/live.md); returns at once, work goes on in the background. Errors: kBadInput for a text that is no
  /// command, kUsage for one that cannot be done now, with the reason.
  base::Result<> command(const std::string& json);

 private:
  struct Parts;
  explicit LiveSession(std::unique_ptr<Parts> parts);
  std::unique_ptr<Parts> parts_;
};

}  // namespace crosstie::app
