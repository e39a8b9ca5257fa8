#include "report/bound_report.h"

#include <optional>
#include <string_view>
#include <utility>

#include <fmt/format.h>

#include "report/detail/html.h"

namespace crosstie::report {
namespace {

void replace_all(std::string& text, std::string_view what, std::string_view by) {
  std::string result;
  std::size_t from = 0;
  for (std::size_t at = text.find(what); at != std::string::npos; at = text.find(what, from)) {
    result.append(text, from, at - from).append(by);
    from = at + what.size();
  }
  text = result.append(text, from);
}

/// Address of a folder's file, with what a URL cannot hold as %XX.
std::string file_address(std::string_view folder) {
  std::string address = "file://";
  for (const char c : folder) {
    const bool plain = (c >= '0' && c <= '9') || (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '-' || c == '_' ||
                       c == '.' || c == '~' || c == '/';
    address += plain ? std::string(1, c) : fmt::format("%{:02X}", static_cast<int>(static_cast<unsigned char>(c)));
  }
  return address;
}

struct Parts {
  std::string head;  ///< up to the body
  std::string body;  ///< header, contents, main
  std::string scripts;
};

std::optional<Parts> parts_of(const std::string& html) {
  constexpr std::string_view kBody = "<body>\n";
  constexpr std::string_view kMain = "</main>\n";
  const std::size_t body = html.find(kBody);
  const std::size_t end = html.rfind(kMain);
  const std::size_t last = html.rfind("</body>");
  if (body == std::string::npos || end == std::string::npos || last == std::string::npos || end < body || last < end) return {};
  const std::size_t from = body + kBody.size();
  const std::size_t scripts = end + kMain.size();
  return Parts{html.substr(0, from), html.substr(from, scripts - from), html.substr(scripts, last - scripts)};
}

}  // namespace

std::string bound_report(const std::vector<BoundPage>& pages) {
  std::string body;
  std::optional<Parts> frame;
  bool viewer = false;
  for (std::size_t i = 0; i < pages.size(); ++i) {
    auto parts = parts_of(pages[i].html);
    if (!parts) return {};
    std::string& text = parts->body;
    const bool has_scene = text.find("data-scene=\"") != std::string::npos;
    // Texts of reports are escaped, so that these quotes are those of attributes alone.
    for (const std::string_view attribute : {" id=\"", " href=\"#", " aria-labelledby=\"h-", " data-scene=\""}) {
      const bool heading = attribute.ends_with("h-");
      const std::string_view kept = heading ? attribute.substr(0, attribute.size() - 2) : attribute;
      replace_all(text, attribute, fmt::format("{}r{}-{}", kept, i, heading ? "h-" : ""));
    }
    replace_all(text, " src=\"", fmt::format(" src=\"{}/", detail::escape(file_address(pages[i].folder))));
    for (std::size_t k = 1; i == 0 && k < pages.size(); ++k) {
      replace_all(text, fmt::format(" href=\"{}\"", detail::escape(pages[k].from_top)), fmt::format(" href=\"#r{}\"", k));
    }
    body += fmt::format("<div class=\"bound\" id=\"r{}\">\n{}</div>\n", i, text);
    if (!frame || (has_scene && !viewer)) frame = std::move(parts);
    viewer = viewer || has_scene;
  }
  if (!frame) return {};
  replace_all(frame->head, "<html lang=\"en\">", "<html lang=\"en\" data-still=\"still\">");
  return frame->head + body + frame->scripts + "</body>\n</html>\n";
}

}  // namespace crosstie::report
