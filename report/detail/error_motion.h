#pragma once

#include <algorithm>
#include <array>
#include <string_view>

#include <Eigen/Core>

namespace crosstie::report::detail {

/// How an error motion of a linear axis (ISO 230-1) is shown: um and urad are what machines' axes are judged in.
struct ShownMotion {
  const char* letters;
  const char* name;
  double per_unit;  ///< from mm or rad
  const char* unit;
  bool angle;
  Eigen::Index component;
};

inline constexpr std::array<ShownMotion, 6> kShownMotions = {
    {{"EXX", "positioning, beyond the scale", 1e3, "\u00b5m", false, 0},
     {"EYX", "straightness along Y", 1e3, "\u00b5m", false, 1},
     {"EZX", "straightness along Z", 1e3, "\u00b5m", false, 2},
     {"EAX", "roll, about X", 1e6, "\u00b5rad", true, 0},
     {"EBX", "pitch, about Y", 1e6, "\u00b5rad", true, 1},
     {"ECX", "yaw, about Z", 1e6, "\u00b5rad", true, 2}}};

/// Null where there is no such motion.
inline const ShownMotion* shown_motion(std::string_view letters) {
  const auto found =
      std::find_if(kShownMotions.begin(), kShownMotions.end(), [&](const ShownMotion& one) { return letters == one.letters; });
  return found == kShownMotions.end() ? nullptr : &*found;
}

}  // namespace crosstie::report::detail
