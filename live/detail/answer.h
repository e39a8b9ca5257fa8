#pragma once

#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/result.h"

namespace crosstie::live::detail {

using HeaderFields = std::vector<std::pair<std::string, std::string>>;

/// What every answer carries: nothing is cached, guessed, embedded elsewhere or told to others.
[[nodiscard]] const HeaderFields& common_fields();

/// Why a request is refused.
struct Refusal {
  int status = 400;
  std::string message;
  std::string allow = {};  ///< with 405: the methods that the path has
};

/// {"error": message}; bytes that are not UTF-8 are replaced.
[[nodiscard]] std::string error_body(std::string_view message);

/// The status that a command's error has.
[[nodiscard]] int status_of(base::ErrorCode code);

/// A whole refusal, for requests that do not come as far as the HTTP library.
[[nodiscard]] std::string refusal_text(const Refusal& refusal);

}  // namespace crosstie::live::detail
