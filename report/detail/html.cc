#include "report/detail/html.h"

#include <cmath>

#include <fmt/format.h>

#include "base/text.h"
#include "report/detail/number.h"

namespace crosstie::report::detail {
namespace {

constexpr std::string_view kReplacement = "\uFFFD";

/// Length of the well-formed UTF-8 sequence at `at`, 0 where there is none (Unicode 15, table 3-7).
std::size_t utf8_length(std::string_view text, std::size_t at) {
  const auto byte = [&](std::size_t i) { return at + i < text.size() ? static_cast<unsigned char>(text[at + i]) : 0u; };
  const auto continues = [&](std::size_t i) { return (byte(i) & 0xC0u) == 0x80u; };
  const unsigned first = byte(0);
  if (first < 0x80u) return 1;
  if (first >= 0xC2u && first <= 0xDFu) return continues(1) ? 2 : 0;
  if (first >= 0xE0u && first <= 0xEFu) {
    if (!continues(1) || !continues(2)) return 0;
    if (first == 0xE0u && byte(1) < 0xA0u) return 0;
    if (first == 0xEDu && byte(1) >= 0xA0u) return 0;
    if (first == 0xEFu && byte(1) == 0xBFu && byte(2) >= 0xBEu) return 0;  // U+FFFE, U+FFFF: no XML characters
    return 3;
  }
  if (first >= 0xF0u && first <= 0xF4u) {
    if (!continues(1) || !continues(2) || !continues(3)) return 0;
    if (first == 0xF0u && byte(1) < 0x90u) return 0;
    if (first == 0xF4u && byte(1) >= 0x90u) return 0;
    return 4;
  }
  return 0;
}

template <typename Append>
std::string transformed(std::string_view text, Append append) {
  std::string result;
  result.reserve(text.size() + text.size() / 8);
  for (std::size_t at = 0; at < text.size();) {
    const std::size_t length = utf8_length(text, at);
    if (length == 0) {
      result += kReplacement;
      ++at;
    } else if (length > 1) {
      result += text.substr(at, length);
      at += length;
    } else {
      append(result, text[at]);
      ++at;
    }
  }
  return result;
}

bool is_control(char c) { return static_cast<unsigned char>(c) < 0x20 || c == 0x7f; }

}  // namespace

std::string escape(std::string_view text) {
  return transformed(text, [](std::string& out, char c) {
    switch (c) {
      case '&':
        out += "&amp;";
        break;
      case '<':
        out += "&lt;";
        break;
      case '>':
        out += "&gt;";
        break;
      case '"':
        out += "&quot;";
        break;
      case '\'':
        out += "&#39;";
        break;
      case '\n':
      case '\t':
        out += c;
        break;
      default:
        if (is_control(c))
          out += kReplacement;
        else
          out += c;
    }
  });
}

std::string json_quoted(std::string_view text) {
  return '"' +
         transformed(text,
                     [](std::string& out, char c) {
                       if (c == '"' || c == '\\')
                         out += fmt::format("\\{}", c);
                       else if (is_control(c) || c == '<' || c == '>' || c == '&')
                         out += fmt::format("\\u{:04x}", static_cast<int>(c));
                       else
                         out += c;
                     }) +
         '"';
}

Cell number_cell(std::string text, double value, std::string css_class) {
  return {std::move(text), std::isfinite(value) ? base::format_double(value) : "", std::move(css_class), ""};
}

Cell text_cell(std::string text, std::string css_class) { return {std::move(text), "", std::move(css_class), ""}; }

HtmlTable::HtmlTable(std::string caption, std::vector<Column> columns)
    : caption_(std::move(caption)), columns_(std::move(columns)) {}

void HtmlTable::add_row(std::vector<Cell> cells, const std::string& row_id) {
  std::string row = row_id.empty() ? "<tr>" : fmt::format("<tr id=\"{}\">", escape(row_id));
  for (std::size_t i = 0; i < cells.size(); ++i) {
    const Cell& cell = cells[i];
    const char* tag = i == 0 ? "th" : "td";
    std::string css = i < columns_.size() && columns_[i].numeric ? "n" : "";
    if (!cell.css_class.empty()) css += (css.empty() ? "" : " ") + cell.css_class;
    std::string content = escape(cell.text);
    if (!cell.href.empty()) content = fmt::format("<a href=\"{}\">{}</a>", escape(cell.href), content);
    const bool named = cards_ && i > 0 && i < columns_.size();
    row += fmt::format("<{}{}{}{}{}>{}</{}>", tag, i == 0 ? " scope=\"row\"" : "",
                       named ? fmt::format(" data-name=\"{}\"", escape(columns_[i].name)) : "",
                       css.empty() ? "" : fmt::format(" class=\"{}\"", escape(css)),
                       cell.sort_key.empty() ? "" : fmt::format(" data-v=\"{}\"", escape(cell.sort_key)), content, tag);
  }
  rows_.push_back(row + "</tr>\n");
}

void HtmlTable::limit_rows(std::size_t max_rows, std::string where_all_are) {
  max_rows_ = max_rows;
  where_all_are_ = std::move(where_all_are);
}

std::string HtmlTable::html() const {
  const bool cut = max_rows_ > 0 && rows_.size() > max_rows_;
  std::string caption = escape(caption_);
  if (cut) {
    caption += fmt::format(" The first {} of {} rows; all of them: {}.", counted(static_cast<long long>(max_rows_)),
                           counted(static_cast<long long>(rows_.size())), escape(where_all_are_));
  }
  std::string html = fmt::format(
      "<div class=\"table{}\" role=\"region\" tabindex=\"0\" aria-label=\"{}\"><table><caption><span>{}</span></caption>\n"
      "<thead><tr>",
      cards_ ? " cards" : "", escape(caption_), caption);
  for (const Column& column : columns_) {
    html += fmt::format("<th scope=\"col\"{}{}><span>{}</span>{}</th>", column.numeric ? " class=\"n\"" : "",
                        column.about.empty() ? "" : fmt::format(" title=\"{}\"", escape(column.about)), escape(column.name),
                        column.unit.empty() ? "" : fmt::format(" <small>{}</small>", escape(column.unit)));
  }
  html += "</tr></thead>\n<tbody>\n";
  for (std::size_t i = 0; i < (cut ? max_rows_ : rows_.size()); ++i) html += rows_[i];
  return html + "</tbody></table></div>\n";
}

std::string definition_list(const std::vector<std::pair<std::string, std::string>>& entries) {
  std::string html = "<dl>\n";
  for (const auto& [term, value] : entries) {
    html += fmt::format("<div><dt>{}</dt><dd>{}</dd></div>\n", escape(term), escape(value));
  }
  return html + "</dl>\n";
}

std::string figure(const std::string& svg, std::string_view caption, bool wide) {
  return fmt::format("<figure{}>{}<figcaption>{}</figcaption></figure>\n", wide ? " class=\"wide\"" : "", svg, escape(caption));
}

std::string figures(const std::vector<std::string>& list) {
  std::string html = "<div class=\"figures\">\n";
  for (const std::string& one : list) html += one;
  return html + "</div>\n";
}

std::string anchor(std::string_view prefix, std::string_view name) {
  std::string result(prefix);
  for (const char c : name) {
    const bool safe = (c >= '0' && c <= '9') || (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '-';
    result += safe ? std::string(1, c) : fmt::format("_{:02x}", static_cast<int>(static_cast<unsigned char>(c)));
  }
  return result;
}

}  // namespace crosstie::report::detail
