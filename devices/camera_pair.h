#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <mutex>
#include <optional>

#include "devices/camera_device.h"

namespace crosstie::devices {

struct FramePairingOptions {
  /// Largest difference of the host times of one trigger's frames: transfer times and the load of the host. Must be below half of the
  /// time between two triggers, else the frames of neighbouring triggers may be taken for a pair. Default: for up to 20 triggers/s.
  double max_host_skew_s = 0.020;
  /// By how much the difference of the two cameras' own clocks may change from its median over the pairs before. Clocks of cameras
  /// run apart by up to 100 ppm, which is 5 us between two frames at 20 Hz.
  double max_device_skew_s = 0.002;

  [[nodiscard]] base::Result<> validate() const;
};

enum class Side : std::size_t { kLeft = 0, kRight = 1 };

struct FramePairingCounts {
  std::uint64_t pairs = 0;
  std::array<std::uint64_t, 2> unmatched = {};  ///< frames of the left, the right camera that the other one has no frame for
  std::uint64_t contradicted = 0;               ///< pairs by the host's time that the cameras' own clocks refuse
};

/// Finds the frames of one trigger among those of two cameras, whose ids and clocks have nothing in common.
///
/// Rule: a frame's partner is the other side's oldest frame within `max_host_skew_s`; a frame is given up when a later one of the other side
/// shows that its partner is lost. The difference of the device times of a pair must then agree with that of the pairs before: two
/// frames of different triggers that reach a busy host at one time are no pair. Three contradictions in a row say that the pairs before
/// were the wrong ones, or that a camera's clock was set: the comparison begins anew.
/// Not safe to call from several threads at once.
class FramePairing {
 public:
  explicit FramePairing(const FramePairingOptions& options = {}) : options_(options) {}
  /// The pair that this frame completes. Frames of one side must come in the order of their host times.
  [[nodiscard]] std::optional<FramePair> add(Side side, Frame frame);
  [[nodiscard]] const FramePairingCounts& counts() const { return counts_; }

 private:
  [[nodiscard]] bool agrees(const FramePair& pair);

  FramePairingOptions options_;
  FramePairingCounts counts_;
  std::array<std::deque<Frame>, 2> waiting_;
  std::deque<double> device_differences_s_;  ///< of the latest pairs
  int contradictions_in_a_row_ = 0;
};

/// Takes pairs; as FrameSink.
using PairSink = std::function<void(base::Result<FramePair>)>;

/// A source of pairs: two cameras, or the files of other capture software.
class PairSource {
 public:
  virtual ~PairSource() = default;
  virtual base::Result<CameraSettings> start(const CameraSettings& settings, PairSink sink) = 0;
  virtual void stop() = 0;
  virtual base::Result<> trigger() = 0;
  [[nodiscard]] virtual std::array<CameraState, 2> states() = 0;
  [[nodiscard]] virtual FramePairingCounts counts() = 0;
};

/// Two cameras with equal settings. With a software trigger the left one is triggered first; with a hardware trigger one edge exposes both.
/// A lost camera ends the pair with its error.
class CameraPair : public PairSource {
 public:
  /// The cameras outlive the pair.
  CameraPair(CameraDevice& left, CameraDevice& right, const FramePairingOptions& options = {});
  ~CameraPair() override;

  /// Returns the settings as the left camera took them. Errors of either camera, kDevice where both took different exposures or gains;
  /// then neither runs.
  base::Result<CameraSettings> start(const CameraSettings& settings, PairSink sink) override;
  void stop() override;
  base::Result<> trigger() override;
  [[nodiscard]] std::array<CameraState, 2> states() override;
  [[nodiscard]] FramePairingCounts counts() override;

 private:
  void take(Side side, base::Result<Frame> frame);

  std::array<CameraDevice*, 2> cameras_;
  FramePairingOptions options_;
  std::mutex mutex_;  ///< of all below
  FramePairing pairing_;
  PairSink sink_;
};

}  // namespace crosstie::devices
