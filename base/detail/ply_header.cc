#include "base/detail/ply_header.h"

#include <algorithm>
#include <optional>

#include <fmt/format.h>

#include "base/text.h"

namespace crosstie::base::detail {
namespace {

constexpr std::size_t kMaxHeaderBytes = 65536;

tl::unexpected<std::string> bad(std::string reason) { return tl::unexpected<std::string>(std::move(reason)); }

std::optional<PlyType> type_from_name(std::string_view name) {
  struct Name {
    std::string_view name;
    PlyType type;
  };
  static constexpr Name kNames[] = {
      {"char", PlyType::kInt8},   {"int8", PlyType::kInt8},     {"uchar", PlyType::kUint8},   {"uint8", PlyType::kUint8},
      {"short", PlyType::kInt16}, {"int16", PlyType::kInt16},   {"ushort", PlyType::kUint16}, {"uint16", PlyType::kUint16},
      {"int", PlyType::kInt32},   {"int32", PlyType::kInt32},   {"uint", PlyType::kUint32},   {"uint32", PlyType::kUint32},
      {"float", PlyType::kFloat}, {"float32", PlyType::kFloat}, {"double", PlyType::kDouble}, {"float64", PlyType::kDouble}};
  for (const Name& entry : kNames) {
    if (entry.name == name) return entry.type;
  }
  return std::nullopt;
}

std::vector<std::string_view> words_of(std::string_view line) {
  std::vector<std::string_view> words;
  for (const std::string_view word : split(line, ' ')) {
    if (!trim(word).empty()) words.push_back(trim(word));
  }
  return words;
}

bool has_control_character(std::string_view word) {
  return std::any_of(word.begin(), word.end(), [](char c) { return static_cast<unsigned char>(c) < 0x20 || c == 0x7f; });
}

/// Takes one line of the header into account; the error is the reason.
tl::expected<void, std::string> read_line(std::string_view line, PlyHeader& header, bool& has_format) {
  const auto words = words_of(line);
  if (words.empty()) return {};
  if (words[0] == "comment" || words[0] == "obj_info") {
    header.comments.emplace_back(trim(line.substr(std::min(line.find(words[0]) + words[0].size(), line.size()))));
  } else if (words[0] == "format") {
    if (words.size() != 3 || words[2] != "1.0") return bad("a format other than 1.0");
    if (words[1] == "ascii")
      header.format = PlyFormat::kAscii;
    else if (words[1] == "binary_little_endian")
      header.format = PlyFormat::kLittleEndian;
    else if (words[1] == "binary_big_endian")
      header.format = PlyFormat::kBigEndian;
    else
      return bad(fmt::format("unknown format {}", words[1]));
    has_format = true;
  } else if (words[0] == "element") {
    const auto count = words.size() == 3 ? parse_int(words[2]) : std::nullopt;
    if (!count || *count < 0) return bad(fmt::format("an element whose count cannot be read: {}", line));
    header.elements.push_back({std::string(words[1]), static_cast<std::uint64_t>(*count), {}});
  } else if (words[0] == "property") {
    if (header.elements.empty()) return bad("a property before the first element");
    PlyProperty property;
    property.is_list = words.size() > 1 && words[1] == "list";
    if (words.size() != (property.is_list ? 5U : 3U) || has_control_character(words.back()))
      return bad(fmt::format("a property that cannot be read: {}", line));
    const auto type = type_from_name(words[words.size() - 2]);
    const auto count_type = property.is_list ? type_from_name(words[2]) : PlyType::kUint8;
    if (!type || !count_type || *count_type == PlyType::kFloat || *count_type == PlyType::kDouble) {
      return bad(fmt::format("a property of unknown type: {}", line));
    }
    property.type = *type;
    property.count_type = *count_type;
    property.name = words.back();
    auto& properties = header.elements.back().properties;
    if (std::any_of(properties.begin(), properties.end(), [&](const PlyProperty& p) { return p.name == property.name; })) {
      return bad(fmt::format("the property {} occurs twice", property.name));
    }
    properties.push_back(std::move(property));
  } else {
    return bad(fmt::format("a header line that cannot be read: {}", line));
  }
  return {};
}

}  // namespace

std::size_t size_of(PlyType type) {
  switch (type) {
    case PlyType::kInt8:
    case PlyType::kUint8:
      return 1;
    case PlyType::kInt16:
    case PlyType::kUint16:
      return 2;
    case PlyType::kInt32:
    case PlyType::kUint32:
    case PlyType::kFloat:
      return 4;
    case PlyType::kDouble:
      return 8;
  }
  return 1;
}

std::uint64_t PlyElement::min_record_bytes(PlyFormat format) const {
  std::uint64_t size = 0;
  for (const PlyProperty& p : properties) size += format == PlyFormat::kAscii ? 2 : size_of(p.is_list ? p.count_type : p.type);
  return size;
}

tl::expected<PlyHeader, std::string> parse_ply_header(std::string_view bytes) {
  PlyHeader header;
  bool has_format = false;
  for (std::size_t at = 0, number = 1;; ++number) {
    const std::size_t end = bytes.find('\n', at);
    if (end == std::string_view::npos || end > kMaxHeaderBytes) {
      return bad(number == 1 ? "no PLY file" : "its header does not end: the file is cut off or damaged");
    }
    const std::string_view line = trim(bytes.substr(at, end - at));
    at = end + 1;
    if (number == 1) {
      if (line != "ply") return bad("no PLY file");
      continue;
    }
    if (line.size() > 1000) return bad("a header line that cannot be read");
    if (line == "end_header") {
      header.data_offset = at;
      break;
    }
    if (auto read = read_line(line, header, has_format); !read) return bad(std::move(read).error());
  }
  if (!has_format) return bad("its header states no format");
  std::uint64_t left = bytes.size() - header.data_offset + 1;  // the last line may lack its newline
  for (const PlyElement& element : header.elements) {
    const std::uint64_t size = element.min_record_bytes(header.format);
    if (element.count > 0 && (size == 0 || element.count > left / size)) {
      return bad(fmt::format("its header claims {} of {}, more than the file holds", element.count, element.name));
    }
    left -= element.count * size;
  }
  return header;
}

}  // namespace crosstie::base::detail
