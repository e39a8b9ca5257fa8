#pragma once

namespace crosstie::markers::detail {

// What is known beforehand of how the levels around a marker change, as standard deviations for each dot radius.
inline constexpr double kLightSlopeSigma = 0.05;    ///< relative change of the light: all levels in proportion,
inline constexpr double kUnknownSlopeSigma = 0.02;  ///< the same where one of the levels is saturated,
inline constexpr double kOtherSlopeSigma = 0.003;   ///< and change of a level by other causes, of the contrast

}  // namespace crosstie::markers::detail
