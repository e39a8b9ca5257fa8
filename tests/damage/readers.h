#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "base/result.h"
#include "tests/support/damage.h"

namespace crosstie::tests {

/// A reader with a file that it reads well.
struct Reader {
  std::string name;
  Sample sample;
  std::function<std::optional<base::Error>(const std::filesystem::path&)> read;
  std::string file = {};                                         ///< the name it must have; empty: any
  std::vector<std::pair<std::string, std::string>> beside = {};  ///< files of the same folder, by name
  bool takes_mark = true;                                        ///< whether the file may begin with a byte order mark
};

/// All of them: a new reader is one more row.
std::vector<Reader> readers();

}  // namespace crosstie::tests
