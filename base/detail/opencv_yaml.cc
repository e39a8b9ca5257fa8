#include "base/detail/opencv_yaml.h"

#include <algorithm>
#include <cstdint>
#include <optional>

#include <fmt/format.h>

#include "base/text.h"

namespace crosstie::base::detail {
namespace {

std::string lower(std::string_view text) {
  std::string result(text);
  for (char& c : result) {
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
  }
  return result;
}

/// A line `key: value`, split at its first colon.
struct Entry {
  std::string_view key;
  std::string_view value;
};

std::optional<Entry> entry_of(std::string_view line) {
  const std::size_t colon = line.find(':');
  if (colon == std::string_view::npos) return std::nullopt;
  return Entry{trim(line.substr(0, colon)), trim(line.substr(colon + 1))};
}

std::string_view without_quotes(std::string_view value) {
  const bool quoted = value.size() >= 2 && (value.front() == '"' || value.front() == '\'') && value.back() == value.front();
  return quoted ? value.substr(1, value.size() - 2) : value;
}

/// A block of the top level while its lines are read.
struct Block {
  std::string key;
  int line = 0;
  std::optional<std::int64_t> rows;
  std::optional<std::int64_t> columns;
  bool has_data = false;
  bool open = false;  ///< inside of [ ... ]
  std::vector<double> data;
};

class Reader {
 public:
  tl::expected<YamlDocument, YamlError> read(std::string_view text) {
    if (text.starts_with("\xEF\xBB\xBF")) text.remove_prefix(3);
    for (const std::string_view raw : split(text, '\n')) {
      ++line_;
      const std::string_view line = trim(raw);
      if (block_.open) {
        if (!values(line)) return tl::unexpected<YamlError>(error_);
        continue;
      }
      if (line.empty() || line[0] == '#' || line[0] == '%' || line == "---" || line == "...") continue;
      const bool indented = raw[0] == ' ' || raw[0] == '\t';
      if (!(indented ? inside(line) : top(line))) return tl::unexpected<YamlError>(error_);
    }
    if (!finish()) return tl::unexpected<YamlError>(error_);
    return std::move(document_);
  }

 private:
  bool refuse(int line, std::string reason) {
    error_ = {line, std::move(reason)};
    return false;
  }

  bool top(std::string_view line) {
    if (!finish()) return false;
    const auto entry = entry_of(line);
    if (!entry) return line[0] == '-' || refuse(line_, "neither a key nor a value");
    const std::string key = lower(entry->key);
    if (document_.scalars.contains(key) || document_.matrices.contains(key))
      return refuse(line_, fmt::format("{} occurs twice", key));
    if (entry->value.empty() || entry->value.starts_with("!!")) {
      block_.key = key;
      block_.line = line_;
    } else {
      document_.scalars[key] = without_quotes(entry->value);
    }
    return true;
  }

  bool inside(std::string_view line) {
    const auto entry = entry_of(line);
    if (!entry || block_.key.empty()) return true;
    if (entry->key == "rows" || entry->key == "cols") {
      const auto value = parse_int(entry->value);
      if (!value || *value < 1 || *value > 64) return refuse(line_, "a matrix of implausible size");
      (entry->key == "rows" ? block_.rows : block_.columns) = value;
    } else if (entry->key == "data") {
      if (!entry->value.starts_with("[")) return refuse(line_, "the values of a matrix are missing");
      block_.has_data = block_.open = true;
      return values(entry->value.substr(1));
    }
    return true;
  }

  /// Values separated by commas, up to the closing bracket.
  bool values(std::string_view line) {
    const std::size_t end = line.find(']');
    if (end != std::string_view::npos) block_.open = false;
    const auto cells = split(line.substr(0, end), ',');
    for (std::size_t i = 0; i < cells.size(); ++i) {
      const std::string_view cell = trim(cells[i]);
      if (cell.empty() && i + 1 == cells.size()) continue;  // a comma at the end of the line
      const auto value = parse_double(cell);
      if (!value) return refuse(line_, fmt::format("\"{}\" is no finite number", cell.substr(0, 40)));
      if (block_.data.size() >= 4096) return refuse(line_, "a matrix of implausible size");
      block_.data.push_back(*value);
    }
    return true;
  }

  bool finish() {
    if (block_.open) return refuse(line_, "the file is cut off");
    if (block_.rows || block_.columns || block_.has_data) {
      if (!block_.rows || !block_.columns || static_cast<std::int64_t>(block_.data.size()) != *block_.rows * *block_.columns) {
        return refuse(block_.line, fmt::format("{} does not hold as many values as its rows and cols say", block_.key));
      }
      document_.matrices[block_.key] = {static_cast<int>(*block_.rows), static_cast<int>(*block_.columns),
                                        std::move(block_.data)};
    }
    block_ = {};
    return true;
  }

  YamlDocument document_;
  YamlError error_;
  Block block_;
  int line_ = 0;
};

}  // namespace

tl::expected<YamlDocument, YamlError> parse_opencv_yaml(std::string_view text) { return Reader().read(text); }

}  // namespace crosstie::base::detail
