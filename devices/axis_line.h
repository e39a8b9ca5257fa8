#pragma once

#include <cstddef>
#include <limits>
#include <string>
#include <string_view>

#include "base/result.h"

namespace crosstie::devices {

/// Longest line that is read, in bytes; longer ones are dropped whole.
inline constexpr std::size_t kMaxAxisLineBytes = 256;

/// How a line of text tells the position of the axis (docs/devices.md).
///
/// Without a label the line is one number, with or without its unit: `850.04`, `+  850.04 mm`. With a label the number is the one
/// that follows or is attached to it, whatever else the line says: `X` in `X850.04 Y12.0`, `MPos` in
/// `<Idle|MPos:850.040,0.000|FS:0,0>`, `ABS_ACT_POS` in `ABS_ACT_POS 850.04 0 0`.
/// position_mm = zero_mm + mm_per_unit * number. A decimal comma and a unit other than the stated one are refused: guessing either
/// would move the machine.
struct AxisLineFormat {
  std::string label = {};
  std::string unit = "mm";   ///< the word that may follow the number; any other known unit is refused
  double mm_per_unit = 1.0;  ///< 0.001 for um, 25.4 for inches, negative where the control counts the other way
  double zero_mm = 0.0;      ///< machine X where the control shows 0
  /// Travel of the axis. A damaged digit that leads outside is noticed; no limits by default, for no travel suits all machines.
  double min_mm = -std::numeric_limits<double>::infinity();
  double max_mm = std::numeric_limits<double>::infinity();

  [[nodiscard]] base::Result<> validate() const;
};

/// The position in mm. Errors: kBadInput, with the line as far as it can be shown.
[[nodiscard]] base::Result<double> parse_axis_line(std::string_view line, const AxisLineFormat& format);

}  // namespace crosstie::devices
