#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>

#include "base/result.h"

namespace crosstie::base::detail {

/// Reads blank-separated words line by line. After the first fault it stays there, and all further values are zero, so that a
/// record is read as a whole and asked once whether it failed.
class WordScanner {
 public:
  /// `path` is what error messages name; both arguments must outlive the scanner.
  WordScanner(const std::filesystem::path& path, std::string_view text);

  /// Goes to the next line that holds anything but a comment (#); false at the end or after a fault.
  bool next_line();
  [[nodiscard]] bool at_line_end() const;

  /// `what` names the value in messages.
  double number(const char* what);
  int id(const char* what);       ///< 0 or more
  int integer(const char* what);  ///< of any sign
  /// Nothing where the word is `fix`; a sigma is 0 or more.
  std::optional<double> sigma(const char* what);
  std::string quoted(const char* what);  ///< "in quotation marks", or a word without
  /// A fault where the line holds more words.
  void expect_line_end();

  void refuse(std::string reason);
  [[nodiscard]] bool failed() const { return !fault_.empty(); }
  [[nodiscard]] tl::unexpected<Error> failure() const;

 private:
  std::string_view word(const char* what);

  const std::filesystem::path& path_;
  std::string_view text_;
  std::string_view rest_;
  int line_ = 0;
  std::string fault_;
};

}  // namespace crosstie::base::detail
