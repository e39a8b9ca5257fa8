#pragma once

#include <cctype>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace crosstie::tests {

/// A small XML reader: nothing where the page is well formed, otherwise what is wrong. Knows elements, quoted attributes,
/// character references, CDATA and the doctype, which is all that the reports use.
inline std::optional<std::string> markup_error(std::string_view page) {
  std::vector<std::string> open;
  const auto near = [&](std::size_t at) { return std::string(page.substr(at, 80)); };
  for (std::size_t at = 0; at < page.size();) {
    if (page[at] == '&') {
      const std::size_t end = page.find(';', at);
      if (end == std::string_view::npos || end - at > 8) return "bare & near " + near(at);
      const std::string_view name = page.substr(at + 1, end - at - 1);
      const bool known = name == "amp" || name == "lt" || name == "gt" || name == "quot" || name.starts_with("#");
      if (!known) return "unknown reference near " + near(at);
      at = end + 1;
    } else if (page[at] != '<') {
      ++at;
    } else if (page.substr(at).starts_with("<![CDATA[")) {
      const std::size_t end = page.find("]]>", at);
      if (end == std::string_view::npos) return "open CDATA near " + near(at);
      at = end + 3;
    } else if (page.substr(at).starts_with("<!DOCTYPE")) {
      at = page.find('>', at) + 1;
    } else if (page.substr(at).starts_with("</")) {
      const std::size_t end = page.find('>', at);
      const std::string name(page.substr(at + 2, end - at - 2));
      if (open.empty() || open.back() != name) return "end of " + name + " inside " + (open.empty() ? "nothing" : open.back());
      open.pop_back();
      at = end + 1;
    } else {
      std::size_t i = at + 1;
      while (i < page.size() && (std::isalnum(static_cast<unsigned char>(page[i])) != 0 || page[i] == '-')) ++i;
      const std::string name(page.substr(at + 1, i - at - 1));
      if (name.empty()) return "bare < near " + near(at);
      std::vector<std::string> attributes;
      bool closed = false;
      while (i < page.size() && page[i] != '>') {
        if (page[i] == '/' && i + 1 < page.size() && page[i + 1] == '>') {
          closed = true;
          ++i;
          break;
        }
        if (page[i] != ' ' && page[i] != '\n') return "attribute without a blank near " + near(at);
        while (page[i] == ' ' || page[i] == '\n') ++i;
        if (page[i] == '/' || page[i] == '>') continue;
        const std::size_t equals = page.find("=\"", i);
        if (equals == std::string_view::npos || equals - i > 40) return "attribute without a quoted value near " + near(at);
        const std::string attribute(page.substr(i, equals - i));
        for (const std::string& other : attributes) {
          if (other == attribute) return "attribute twice near " + near(at);
        }
        attributes.push_back(attribute);
        const std::size_t end = page.find('"', equals + 2);
        if (page.substr(equals + 2, end - equals - 2).find('<') != std::string_view::npos)
          return "< in a value near " + near(at);
        i = end + 1;
      }
      if (!closed) open.push_back(name);
      at = i + 1;
    }
  }
  if (!open.empty()) return "never ended: " + open.back();
  return std::nullopt;
}

/// For expectations on whole pages, which nobody wants to see printed.
inline bool contains(std::string_view page, std::string_view text) { return page.find(text) != std::string_view::npos; }

/// The values of an attribute anywhere in the page.
inline std::vector<std::string> attribute_values(std::string_view page, const std::string& name) {
  std::vector<std::string> values;
  const std::string key = " " + name + "=\"";
  for (std::size_t at = page.find(key); at != std::string_view::npos; at = page.find(key, at + 1)) {
    const std::size_t begin = at + key.size();
    values.emplace_back(page.substr(begin, page.find('"', begin) - begin));
  }
  return values;
}

/// The page without its scripts and its style, whose text is code.
inline std::string without_code(std::string page) {
  for (const char* tag : {"script", "style"}) {
    const std::string begin = std::string("<") + tag;
    const std::string end = std::string("</") + tag + ">";
    for (std::size_t at = page.find(begin); at != std::string::npos; at = page.find(begin, at)) {
      page.erase(at, page.find(end, at) + end.size() - at);
    }
  }
  return page;
}

}  // namespace crosstie::tests
