#pragma once

#include <array>
#include <condition_variable>
#include <mutex>
#include <optional>

#include "base/progress.h"
#include "base/result.h"
#include "devices/camera_pair.h"

namespace crosstie::app {

/// One source of pairs for two: every pair goes on to the preview, and the pairs that are wanted as measurements are kept here.
///
/// While something is measured the cameras run on the trigger of the settings given to measure(), so that no exposure is older than
/// the request; before and after they run as the preview started them.
class TappedPairs : public devices::PairSource {
 public:
  /// The source outlives it.
  explicit TappedPairs(devices::PairSource& source) : source_(&source) {}

  base::Result<devices::CameraSettings> start(const devices::CameraSettings& settings, devices::PairSink sink) override;
  void stop() override;
  base::Result<> trigger() override { return source_->trigger(); }
  [[nodiscard]] std::array<devices::CameraState, 2> states() override { return source_->states(); }
  [[nodiscard]] devices::FramePairingCounts counts() override { return source_->counts(); }

  /// Runs the cameras with these settings until preview() or the next measure(). Errors of the source; kDevice where they do not run.
  base::Result<> measure(const devices::CameraSettings& settings);
  /// Back to the preview's settings.
  base::Result<> preview();
  /// The settings that the cameras took for the preview; nothing while they do not run.
  [[nodiscard]] std::optional<devices::CameraSettings> settings();

  /// The pair of the next exposure: with a software trigger the cameras are triggered now, else it is the first pair whose frames
  /// arrive after `after`. Errors: kDevice where none came within `timeout_s` or the cameras are lost, kCancelled.
  base::Result<devices::FramePair> take(devices::HostTime after, double timeout_s, const base::Progress& progress = {});

 private:
  base::Result<devices::CameraSettings> run(const devices::CameraSettings& settings);
  void deliver(base::Result<devices::FramePair> pair);

  devices::PairSource* source_;
  std::mutex mutex_;  ///< of all below
  std::condition_variable changed_;
  devices::PairSink sink_;
  std::optional<devices::CameraSettings> wanted_;   ///< by the preview
  std::optional<devices::CameraSettings> running_;  ///< as the cameras took them
  std::optional<devices::HostTime> after_;          ///< a pair is waited for
  std::optional<base::Result<devices::FramePair>> taken_;
};

}  // namespace crosstie::app
