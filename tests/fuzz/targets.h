#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace crosstie::fuzz {

/// A fuzzer's LLVMFuzzerTestOneInput under a name of its own.
struct Target {
  const char* name;
  int (*run)(const std::uint8_t* data, std::size_t size);
};

/// All of them; CMakeLists.txt writes it.
std::vector<Target> targets();

}  // namespace crosstie::fuzz
