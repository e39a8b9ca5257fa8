#include "base/json_file.h"

#include <algorithm>
#include <set>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "base/file.h"

namespace crosstie::base {
namespace {

using Json = nlohmann::ordered_json;

constexpr int kMaxDepth = 64;

/// Thrown by the parser's callback, caught in read_json().
struct Refused {
  std::string reason;
};

/// Refuses what the parser itself would take: deep nesting and keys that occur twice in one object.
class Guard {
 public:
  bool operator()(int depth, Json::parse_event_t event, Json& value) {
    if (depth >= kMaxDepth) throw Refused{fmt::format("nested deeper than {} levels", kMaxDepth)};
    switch (event) {
      case Json::parse_event_t::object_start:
        keys_.emplace_back();
        break;
      case Json::parse_event_t::object_end:
        keys_.pop_back();
        break;
      case Json::parse_event_t::key: {
        const auto& key = value.get_ref<const std::string&>();
        if (!keys_.back().insert(key).second) throw Refused{fmt::format("the key \"{}\" occurs twice in one object", key)};
        break;
      }
      default:
        break;
    }
    return true;
  }

 private:
  std::vector<std::set<std::string>> keys_;
};

/// "line:column" of a byte of the text, counted from 1.
std::string position(const std::string& text, std::size_t byte) {
  const auto end = text.begin() + static_cast<std::ptrdiff_t>(std::min(byte > 0 ? byte - 1 : 0, text.size()));
  const auto line = std::count(text.begin(), end, '\n') + 1;
  const auto line_start = std::find(std::make_reverse_iterator(end), text.rend(), '\n').base();
  return fmt::format("{}:{}", line, end - line_start + 1);
}

/// What the parser says, without its own prefix and position.
std::string reason(const Json::exception& e) {
  std::string text = e.what();
  if (const auto bracket = text.find("] "); bracket != std::string::npos) text.erase(0, bracket + 2);
  if (const auto colon = text.find(": "); text.starts_with("parse error at") && colon != std::string::npos)
    text.erase(0, colon + 2);
  constexpr std::size_t kLongest = 300;
  if (text.size() > kLongest) text = text.substr(0, kLongest) + "...";
  std::replace(text.begin(), text.end(), '\n', ' ');
  return text;
}

}  // namespace

Result<nlohmann::ordered_json> read_json(const std::filesystem::path& path) {
  auto text = read_file(path);
  if (!text) return fail(std::move(text));
  try {
    return Json::parse(*text, [guard = Guard()](int depth, Json::parse_event_t event, Json& value) mutable {
      return guard(depth, event, value);
    });
  } catch (const Refused& refused) {
    return fail(ErrorCode::kBadInput, fmt::format("{}: {}", shown(path), refused.reason));
  } catch (const Json::parse_error& e) {
    return fail(ErrorCode::kBadInput, fmt::format("{}:{}: {}", shown(path), position(*text, e.byte), reason(e)));
  } catch (const Json::exception& e) {
    return fail(ErrorCode::kBadInput, fmt::format("{}: {}", shown(path), reason(e)));
  }
}

Result<> write_json(const std::filesystem::path& path, const nlohmann::ordered_json& json) {
  return write_file_atomically(path, json.dump(2, ' ', false, Json::error_handler_t::replace) + '\n');
}

}  // namespace crosstie::base
