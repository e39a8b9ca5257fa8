#include "app/live/job_edit.h"

#include <cstddef>

#include <fmt/core.h>
#define TOML_EXCEPTIONS 0
#define TOML_ASSERT(expr) static_assert(true)  // base/toml_guard.h
#include <toml++/toml.h>

#include "app/toml_text.h"
#include "base/file.h"

namespace crosstie::app {
namespace {

using base::ErrorCode;
using base::Result;

constexpr std::size_t kMaxJobBytes = std::size_t{1} << 20;

/// Where a position begins that TOML's parser tells by line and column, both from 1; columns count characters, not bytes, and a byte
/// order mark is none.
std::size_t offset_of(std::string_view text, const toml::source_position& position) {
  constexpr std::string_view kByteOrderMark = "\xEF\xBB\xBF";
  std::size_t at = text.starts_with(kByteOrderMark) ? kByteOrderMark.size() : 0;
  for (toml::source_index line = 1; line < position.line && at < text.size(); ++line) {
    const std::size_t end = text.find('\n', at);
    at = end == std::string_view::npos ? text.size() : end + 1;
  }
  const auto continues = [&](std::size_t i) { return i < text.size() && (static_cast<unsigned char>(text[i]) & 0xC0) == 0x80; };
  for (toml::source_index column = 1; column < position.column && at < text.size(); ++column) {
    ++at;
    while (continues(at)) ++at;
  }
  return at;
}

}  // namespace

Result<std::string> with_station_axis(std::string_view text, const std::filesystem::path& file, const std::string& station,
                                      double axis_mm) {
  const toml::parse_result parsed = toml::parse(text);
  if (!parsed) {
    return base::fail(ErrorCode::kBadInput, fmt::format("{}:{}: {}", file.string(), parsed.error().source().begin.line,
                                                        parsed.error().description()));
  }
  const toml::array* stations = parsed.table()["station"].as_array();
  for (std::size_t i = 0; stations != nullptr && i < stations->size(); ++i) {
    const toml::table* one = stations->get(i)->as_table();
    if (one == nullptr || (*one)["name"].value_or(std::string()) != station) continue;
    const toml::node* reading = one->get("axis_mm");
    if (reading == nullptr || !reading->is_number()) break;
    const std::size_t begin = offset_of(text, reading->source().begin);
    const std::size_t end = offset_of(text, reading->source().end);
    return fmt::format("{}{}{}", text.substr(0, begin), toml_number(axis_mm), text.substr(end));
  }
  return base::fail(ErrorCode::kBadInput, fmt::format("{}: there is no station '{}' with axis_mm", file.string(), station));
}

Result<> write_station_axis(const std::filesystem::path& file, const std::string& station, double axis_mm) {
  const auto text = base::read_file(file, kMaxJobBytes);
  if (!text) return tl::unexpected(text.error());
  const auto edited = with_station_axis(*text, file, station, axis_mm);
  if (!edited) return tl::unexpected(edited.error());
  return *edited == *text ? Result<>() : base::write_file_atomically(file, *edited);
}

}  // namespace crosstie::app
