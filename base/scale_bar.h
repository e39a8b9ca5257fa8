#pragma once

#include <string>

namespace crosstie::base {

enum class ScaleBarRole {
  kUsed,     ///< its length is an observation of the adjustment
  kCheck,    ///< its length is compared with the adjusted one and tells nothing to the adjustment
  kDefines,  ///< its length is taken as exact and defines the scale (one only; for distances without a sigma)
};

/// A certified distance between two targets.
struct ScaleBar {
  int id_a = 0;
  int id_b = 0;
  double length_mm = 0.0;       ///< at 20 degrees C
  double sigma_mm = 0.0;        ///< of length_mm; 0 only for kDefines and kCheck
  double temperature_c = 20.0;  ///< at which it was photographed
  double cte_per_k = 0.0;       ///< coefficient of thermal expansion
  ScaleBarRole role = ScaleBarRole::kUsed;
  std::string certificate;

  /// Length at the measured temperature.
  [[nodiscard]] double length_at_temperature_mm() const { return length_mm * (1.0 + cte_per_k * (temperature_c - 20.0)); }
};

}  // namespace crosstie::base
