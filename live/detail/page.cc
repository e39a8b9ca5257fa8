#include "live/detail/page.h"

#include <fmt/format.h>

#include "base/content_policy.h"

namespace crosstie::live::detail {

std::string page_policy(std::string_view html) {
  std::string scripts, styles;
  while (true) {
    const std::size_t script = html.find("<script"), style = html.find("<style");
    const std::size_t begin = std::min(script, style);
    if (begin == std::string_view::npos) break;
    const bool is_script = begin == script;
    const std::size_t content = html.find('>', begin);
    const std::size_t end = html.find(is_script ? "</script" : "</style", begin);
    if (content == std::string_view::npos || end == std::string_view::npos || end <= content) break;
    (is_script ? scripts : styles) += fmt::format(" {}", base::csp_hash(html.substr(content + 1, end - content - 1)));
    html.remove_prefix(end + 1);
  }
  const auto sources = [](const std::string& hashes) { return hashes.empty() ? " 'none'" : hashes; };
  return fmt::format(
      "default-src 'none'; script-src{}; style-src{}; img-src 'self' data: blob:; connect-src 'self'; base-uri 'none'; "
      "form-action "
      "'none'; frame-ancestors 'none'",
      sources(scripts), sources(styles));
}

}  // namespace crosstie::live::detail
