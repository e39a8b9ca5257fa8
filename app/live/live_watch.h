#pragma once

#include <array>
#include <deque>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "app/live/live_model.h"
#include "app/live/live_status.h"
#include "app/live/tapped_pairs.h"
#include "app/steps.h"
#include "base/machine.h"
#include "base/result.h"
#include "devices/axis_reader.h"
#include "live/feed.h"
#include "live/preview_loop.h"
#include "live/spatial.h"
#include "live/warm_up.h"

namespace crosstie::app {

/// What both cameras see now: pictures to the page, markers in 3D as soon as the head is known. Safe to call from any thread.
class LiveWatch {
 public:
  /// Pairs and feed outlive it.
  LiveWatch(TappedPairs& pairs, live::Feed& feed, const std::optional<MarkerChoice>& markers);

  /// Connects the cameras, also again. Errors: those of the cameras.
  base::Result<> start(const devices::CameraSettings& settings);
  /// Why the cameras do not run; empty: they do.
  [[nodiscard]] std::string trouble() const;

  /// By what markers are located: the head, and its place in machine at this reading where both are known.
  void set_place(const std::shared_ptr<const KnownHead>& head, const base::Result<devices::AxisReading>& axis);

  /// Cameras, pairs and markers.
  void describe(LiveStatus& status);
  /// Where the head is in machine by the place that was set; nothing where that is not known.
  [[nodiscard]] std::optional<base::Pose> machine_from_rig() const;
  /// Whether the markers differ from those that were shown in 3D: one came or went, or moved by more than its sigmas explain.
  [[nodiscard]] bool markers_moved() const;
  void markers_shown();

 private:
  void take(base::Result<live::PreviewPair> pair);
  [[nodiscard]] CameraStatus camera_status(std::size_t side, const live::PreviewCamera& camera);
  void describe_markers(LiveStatus& status) const;

  /// The place as it was set last.
  struct Place {
    std::shared_ptr<const KnownHead> head = std::make_shared<KnownHead>();
    std::optional<double> axis_mm;
    std::optional<live::MachineTie> tie;
  };

  mutable std::mutex mutex_;  ///< of all below
  std::string trouble_;
  devices::CameraSettings settings_;
  std::shared_ptr<const Place> place_ = std::make_shared<Place>();
  std::array<std::optional<live::CameraPicture>, 2> pictures_;  ///< the latest ones, without their JPEG
  std::vector<live::SpatialMarker> markers_;
  std::string frame_;  ///< of their coordinates; empty: there are none
  std::vector<live::SpatialMarker> shown_;
  std::array<std::deque<live::TemperatureReading>, 2> temperatures_;
  std::unique_ptr<live::PreviewLoop> loop_;  ///< last: its threads end first
};

}  // namespace crosstie::app
