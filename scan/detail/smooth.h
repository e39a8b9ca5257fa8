#pragma once

#include <span>
#include <vector>

namespace crosstie::scan::detail {

/// The mean of a plane over the square of 2 * radius + 1 pixels about each good pixel, where all of these are good; else the plane's own
/// value there. `averaged`, where given, becomes 1 where it is a mean.
std::vector<float> box_mean(std::span<const float> plane, const std::vector<char>& good, int width, int height, int radius,
                            int threads, std::vector<char>* averaged = nullptr);

}  // namespace crosstie::scan::detail
