#pragma once

#include <array>
#include <condition_variable>
#include <mutex>
#include <optional>
#include <stop_token>
#include <thread>

#include "base/progress.h"
#include "base/result.h"
#include "devices/camera_pair.h"

namespace crosstie::app {

/// One source of pairs for two: every pair goes on to the preview, and the pairs that are wanted as measurements are kept here.
///
/// Cameras on a software trigger are triggered at the preview's rate while nobody measures, since cameras that run freely each by itself
/// expose at different moments. measure() ends that and waits for what is under way, so that no exposure is older than the request.
class TappedPairs : public devices::PairSource {
 public:
  /// The source outlives it.
  TappedPairs(devices::PairSource& source, double preview_hz);
  ~TappedPairs() override;

  base::Result<devices::CameraSettings> start(const devices::CameraSettings& settings, devices::PairSink sink) override;
  void stop() override;
  base::Result<> trigger() override { return source_->trigger(); }
  [[nodiscard]] std::array<devices::CameraState, 2> states() override { return source_->states(); }
  [[nodiscard]] devices::FramePairingCounts counts() override { return source_->counts(); }

  /// The cameras run with these settings and are triggered by take() alone, until preview() or the next measure(). Errors of the source;
  /// kDevice where they do not run.
  base::Result<> measure(const devices::CameraSettings& settings);
  /// Back to the preview's settings; cameras that are lost stay so until start().
  base::Result<> preview();
  /// The settings that the cameras took for the preview; nothing while they do not run.
  [[nodiscard]] std::optional<devices::CameraSettings> settings();

  /// The pair of the next exposure: with a software trigger the cameras are triggered now, as soon as no pair of an earlier trigger is
  /// under way, and again where none arrives; with a hardware trigger it is the first pair that is complete after `after`, of cameras
  /// that run freely the first one that is so by its exposure time or more, since one before began to be exposed earlier.
  /// Errors: kDevice where none came within `timeout_s` or the cameras are lost, kCancelled.
  base::Result<devices::FramePair> take(devices::HostTime after, double timeout_s, const base::Progress& progress = {});

 private:
  base::Result<> change_to(const devices::CameraSettings& settings);
  base::Result<devices::CameraSettings> run(const devices::CameraSettings& settings);
  void trigger_preview(const std::stop_token& stop);
  void await_pairs(std::unique_lock<std::mutex>& lock, const base::Progress& progress = {});
  void deliver(base::Result<devices::FramePair> pair);

  devices::PairSource* source_;
  double preview_hz_;
  std::mutex mutex_;  ///< of all below
  std::condition_variable_any changed_;
  devices::PairSink sink_;
  std::optional<devices::CameraSettings> wanted_;   ///< by the preview
  std::optional<devices::CameraSettings> asked_;    ///< of the cameras that run
  std::optional<devices::CameraSettings> running_;  ///< the same as they took them
  bool lost_ = false;                               ///< until start(): who looks at the pictures was told so
  bool measuring_ = false;
  int under_way_ = 0;                       ///< pairs that were triggered and did not arrive yet
  std::optional<devices::HostTime> after_;  ///< a pair is waited for
  std::optional<base::Result<devices::FramePair>> taken_;
  std::jthread trigger_;  ///< last: ends before the rest
};

}  // namespace crosstie::app
