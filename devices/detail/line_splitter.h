#pragma once

#include <cstddef>
#include <functional>
#include <string>
#include <string_view>

namespace crosstie::devices::detail {

/// Cuts a stream of bytes into lines at '\n' or '\r', however the bytes arrive. Empty lines are left out, so "\r\n" ends one line.
/// A line over `max_bytes` is dropped to its end and told of once: no stream, however broken, takes more memory than that.
class LineSplitter {
 public:
  explicit LineSplitter(std::size_t max_bytes) : max_bytes_(max_bytes) {}

  /// Calls `line` for each line that the bytes complete, `too_long` as soon as a line exceeds the limit, with its begin.
  void push(std::string_view bytes, const std::function<void(std::string_view)>& line,
            const std::function<void(std::string_view)>& too_long);
  /// What comes up to the next line end is the rest of a line whose begin was missed.
  void skip_to_line_end();
  [[nodiscard]] std::size_t held_bytes() const { return held_.size(); }

 private:
  std::size_t max_bytes_;
  std::string held_;
  bool skipping_ = false;
};

}  // namespace crosstie::devices::detail
