#pragma once

#include <map>
#include <string>
#include <string_view>
#include <vector>

#include <tl/expected.hpp>

namespace crosstie::base::detail {

/// A value of Python's literal syntax, as far as mrcal's camera models use it.
struct PythonLiteral {
  enum class Kind { kNumber, kText, kName, kList, kDictionary };

  Kind kind = Kind::kName;
  double number = 0.0;
  std::string text;  ///< of a text without its quotation marks (escapes stay as they are), or a name: None, True
  std::vector<PythonLiteral> items;
  std::map<std::string, PythonLiteral> entries;

  /// The entry of a dictionary, null where there is none.
  [[nodiscard]] const PythonLiteral* find(const std::string& key) const;
};

struct PythonError {
  int line = 0;
  std::string reason;
};

/// Parses one literal and nothing after it but blanks and comments. Bytes literals (b'...') are checked, but not kept: they may
/// be long. Nesting is bounded.
tl::expected<PythonLiteral, PythonError> parse_python_literal(std::string_view text);

}  // namespace crosstie::base::detail
