#include "devices/detail/line_splitter.h"

namespace crosstie::devices::detail {

void LineSplitter::push(std::string_view bytes, const std::function<void(std::string_view)>& line,
                        const std::function<void(std::string_view)>& too_long) {
  while (!bytes.empty()) {
    const std::size_t end = bytes.find_first_of("\r\n");
    const std::string_view part = bytes.substr(0, end);
    if (!skipping_) {
      held_.append(part.substr(0, max_bytes_ + 1 - held_.size()));
      if (held_.size() > max_bytes_) {
        too_long(held_);
        skip_to_line_end();
      }
    }
    if (end == std::string_view::npos) return;
    if (!skipping_ && !held_.empty()) line(held_);
    held_.clear();
    skipping_ = false;
    bytes.remove_prefix(end + 1);
  }
}

void LineSplitter::skip_to_line_end() {
  held_.clear();
  skipping_ = true;
}

}  // namespace crosstie::devices::detail
