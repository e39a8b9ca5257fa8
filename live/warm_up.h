#pragma once

#include <optional>
#include <span>

#include "base/result.h"
#include "devices/host_time.h"

namespace crosstie::live {

/// A camera's temperature as it was read.
struct TemperatureReading {
  devices::HostTime time;
  double temperature_c = 0.0;
};

struct WarmUpOptions {
  /// [K per 10 min] A rise that is still warming up. Default: 0.5, in which an aluminium bar of 0.8 m between the cameras (23e-6 per K) grows
  /// by 9 um, less than a marker's sigma; cameras reach it some 30 to 60 minutes after they were switched on.
  double most_k_per_10_min = 0.5;
  double window_s = 600.0;  ///< over which the rise is taken: the latest readings
  double least_s = 180.0;   ///< that readings must span before they say anything: sensors show steps of 0.1 to 1 K

  /// Error kUsage with the member that is out of its domain.
  [[nodiscard]] base::Result<> validate() const;
};

struct WarmUp {
  std::optional<double> temperature_c = {};  ///< the latest reading; nothing without any
  /// Slope of the straight line through the window's readings, and its sigma from their scatter; nothing where they span less than least_s.
  std::optional<double> k_per_10_min = {};
  double sigma_k_per_10_min = 0.0;
  bool warming = false;  ///< the slope is known and above the limit
};

/// Whether a camera is still warming up: lenses and the bar between them move until it is not, and a calibration holds for the
/// temperature at which it was taken. Readings in the order of their times; those older than the window at the latest one are not used.
/// Falling temperatures are not warming. Errors: options.
[[nodiscard]] base::Result<WarmUp> judge_warm_up(std::span<const TemperatureReading> readings,
                                                 const WarmUpOptions& options = {});

}  // namespace crosstie::live
