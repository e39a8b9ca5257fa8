#include "report/detail/colour.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <span>

#include <fmt/format.h>

namespace crosstie::report::detail {
namespace {

struct Stop {
  double at;
  std::array<double, 3> rgb;
};

constexpr std::array<Stop, 5> kSequential = {{{0.0, {0x2c, 0x7b, 0xb6}},
                                              {0.35, {0x35, 0xa9, 0xa1}},
                                              {0.6, {0x9c, 0xbf, 0x4b}},
                                              {0.8, {0xf0, 0xa3, 0x3a}},
                                              {1.0, {0xd7, 0x30, 0x1f}}}};
std::string mixed(std::span<const Stop> stops, double at) {
  at = std::isfinite(at) ? std::clamp(at, stops.front().at, stops.back().at) : stops.front().at;
  std::size_t i = 1;
  while (i + 1 < stops.size() && at > stops[i].at) ++i;
  const double t = (at - stops[i - 1].at) / (stops[i].at - stops[i - 1].at);
  std::array<int, 3> rgb{};
  for (std::size_t k = 0; k < 3; ++k) {
    rgb[k] = static_cast<int>(std::lround(stops[i - 1].rgb[k] + t * (stops[i].rgb[k] - stops[i - 1].rgb[k])));
  }
  return fmt::format("#{:02x}{:02x}{:02x}", rgb[0], rgb[1], rgb[2]);
}

}  // namespace

std::string sequential_colour(double fraction) { return mixed(kSequential, fraction); }

std::string diverging_colour(double value) {
  const double strength = std::isfinite(value) ? std::min(1.0, std::abs(value)) : 0.0;
  return fmt::format("{}{:02x}", value < 0.0 ? "#2c7bb6" : "#d7301f", static_cast<int>(std::lround(180.0 * strength)));
}

}  // namespace crosstie::report::detail
