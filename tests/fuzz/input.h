#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string_view>
#include <vector>

#include "base/result.h"

namespace crosstie::fuzz {

/// Ends the process, saying what does not hold: a finding of the fuzzer, a failure of the replay.
void expect(bool holds, std::string_view what);

/// Every error that a reader gives for a file: it blames the input, on one line that people can read.
void expect_sensible(const base::Error& error);

/// The same of a Result; true where it holds a value.
template <typename Result>
bool sensible(const Result& result) {
  if (!result) expect_sensible(result.error());
  return result.has_value();
}

/// Folder of this process for the files that readers are given: in memory where the system has such a place; gone with the process.
const std::filesystem::path& folder();

/// `bytes` as a file of that name in folder(), in the place of an earlier one.
std::filesystem::path file(std::string_view name, std::string_view bytes);

inline std::string_view text_of(const std::uint8_t* data, std::size_t size) {
  return {reinterpret_cast<const char*>(data), size};
}

/// The input's first byte chooses one of `count` ways to read the rest of it, which it leaves. 0 where the input is empty.
std::size_t choose(std::string_view& input, std::size_t count);

/// Makes folder() / "in" hold the files of the input and no others: each begins after a line "=== NAME", NAME one of `names`, and ends
/// where the next one begins. What stands before the first is left out.
std::filesystem::path unpack(std::string_view input, std::span<const std::string_view> names);

}  // namespace crosstie::fuzz
