#pragma once

#include <functional>
#include <mutex>
#include <optional>
#include <string>

#include "base/result.h"
#include "devices/host_time.h"

namespace crosstie::devices {

/// Where the machine's X axis stood, as its control says.
struct AxisReading {
  double position_mm = 0.0;
  HostTime time;  ///< when the host received it; never later than that, where a medium hides it
};

/// What a reader knows at this moment.
struct AxisState {
  std::string source;                 ///< what messages call it: "axis file x.txt", "axis 192.168.1.20:5007"
  std::optional<AxisReading> latest;  ///< of any age
  std::string trouble;                ///< what came in place of a newer reading; empty: nothing did
};

/// The reading that a station may be given: the latest one, unless it is absent or older than `max_age_s` at `now`.
///
/// What is refused says how old it is and what was in the way, since a wrong X position would shift a whole station.
/// Errors: kDevice for an absent or a stale reading, kUsage for a limit that is not positive and finite.
[[nodiscard]] base::Result<AxisReading> fresh_reading(const AxisState& state, HostTime now, double max_age_s);

/// A source of axis readings. Broken lines, damaged text and missing files are no errors here: the latest good reading stays and
/// ages, `trouble` says why, and fresh_reading() refuses it in the end.
class AxisReader {
 public:
  virtual ~AxisReader() = default;
  /// Never waits for the device; safe to call from any thread.
  [[nodiscard]] virtual AxisState state() = 0;
};

/// A position that somebody reads from the control's display and types in. It ages like any other; forget() after a station keeps
/// the next one from taking it by mistake.
class TypedAxis : public AxisReader {
 public:
  explicit TypedAxis(Clock clock = host_now);
  /// Error kUsage for a position that is not finite; the one before stays.
  base::Result<> enter(double position_mm);
  void forget();
  [[nodiscard]] AxisState state() override;

 private:
  Clock clock_;
  std::mutex mutex_;
  std::optional<AxisReading> latest_;
};

/// An axis whose position at each moment is computed: the digital twin's. An error of `position_mm` is the trouble of a device
/// that does not answer; the reading before stays.
class SimulatedAxis : public AxisReader {
 public:
  explicit SimulatedAxis(std::function<base::Result<double>(HostTime)> position_mm, Clock clock = host_now);
  [[nodiscard]] AxisState state() override;

 private:
  std::function<base::Result<double>(HostTime)> position_mm_;
  Clock clock_;
  std::mutex mutex_;
  std::optional<AxisReading> latest_;
};

}  // namespace crosstie::devices
