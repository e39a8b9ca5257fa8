#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

namespace crosstie::math {

/// The middle value, of an even number the upper one of both; 0 without values. Takes them by value: they are reordered.
template <typename Value>
double median(std::vector<Value> values) {
  if (values.empty()) return 0.0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return static_cast<double>(*middle);
}

}  // namespace crosstie::math
