// pattern sequence <-> manifest (docs/formats.md)

#include <algorithm>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <nlohmann/json.hpp>

#include "base/file.h"
#include "base/json_file.h"
#include "base/pattern_sequence.h"
#include "base/text.h"

namespace crosstie::base {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::string_view kFormat = "crosstie-patterns/1";

/// Thrown on the way through the document, caught in read_pattern_manifest().
struct Refused {
  std::string message;
};

[[noreturn]] void refuse(const std::string& message) { throw Refused{message}; }

void check_keys(const Json& object, const std::string& where, const std::vector<std::string>& known) {
  if (!object.is_object()) refuse(where + " must be an object, { ... }");
  for (const auto& [key, value] : object.items()) {
    if (std::find(known.begin(), known.end(), key) != known.end()) continue;
    const auto meant = nearest_word(key, known);
    refuse(fmt::format(
        "{}: unknown key '{}'{}", where, key,
        meant ? fmt::format(", did you mean '{}'?", *meant) : fmt::format("; it knows {}", fmt::join(known, ", "))));
  }
}

double number(const Json& object, const std::string& where, const char* key) {
  if (!object.contains(key)) refuse(fmt::format("{}: {} is missing", where, key));
  if (!object[key].is_number()) refuse(fmt::format("{}: {} must be a number", where, key));
  return object[key].get<double>();
}

int integer(const Json& object, const std::string& where, const char* key) {
  constexpr double kMost = 1e6;
  const double value = number(object, where, key);
  if (value != std::floor(value) || std::abs(value) > kMost) refuse(fmt::format("{}: {} must be a whole number", where, key));
  return static_cast<int>(value);
}

std::string text(const Json& object, const std::string& where, const char* key) {
  if (!object.contains(key)) refuse(fmt::format("{}: {} is missing", where, key));
  if (!object[key].is_string()) refuse(fmt::format("{}: {} must be a text", where, key));
  return object[key].get<std::string>();
}

AxisCode axis_code(const Json& json, const std::string& where) {
  check_keys(json, where, {"fringes", "gray_bits", "word_periods", "word_offset"});
  AxisCode code;
  if (!json.contains("fringes") || !json["fringes"].is_array()) refuse(where + ": fringes must be a list of numbers");
  for (const Json& count : json["fringes"]) {
    if (!count.is_number()) refuse(where + ": fringes must be a list of numbers");
    code.fringes.push_back(count.get<double>());
  }
  if (code.fringes.empty()) refuse(where + ": fringes is empty");
  if (json.contains("gray_bits")) code.gray_bits = integer(json, where, "gray_bits");
  if (json.contains("word_periods")) code.word_periods = number(json, where, "word_periods");
  if (json.contains("word_offset")) code.word_offset = number(json, where, "word_offset");
  return code;
}

/// A name, not a way to other folders.
std::string file_name(const Json& json, const std::string& where, const char* key) {
  std::string name = text(json, where, key);
  if (name.empty() || name.find('/') != std::string::npos || name == "." || name == "..") {
    refuse(fmt::format("{}: '{}' is not the name of a file in the capture's folder", where, name));
  }
  return name;
}

Pattern pattern_of(const Json& json, const std::string& where) {
  check_keys(json, where, {"kind", "axis", "set", "bit", "shift", "exposure", "repeat", "file", "left", "right"});
  Pattern pattern;
  const std::string kind = text(json, where, "kind");
  const auto known = pattern_kind_from_name(kind);
  if (!known) refuse(fmt::format("{}: kind is white, black, gray, gray_inverse or fringe, not '{}'", where, kind));
  pattern.kind = *known;
  if (pattern.kind == PatternKind::kGray || pattern.kind == PatternKind::kGrayInverse || pattern.kind == PatternKind::kFringe) {
    const std::string axis = text(json, where, "axis");
    if (axis != "x" && axis != "y") refuse(fmt::format("{}: axis is x or y, not '{}'", where, axis));
    pattern.axis = axis == "x" ? ProjectorAxis::kX : ProjectorAxis::kY;
    if (pattern.kind == PatternKind::kFringe) {
      pattern.shift = number(json, where, "shift");
      if (json.contains("set")) pattern.frequency = integer(json, where, "set");
    } else {
      pattern.bit = integer(json, where, "bit");
    }
  }
  if (json.contains("repeat")) {
    if (!json["repeat"].is_boolean()) refuse(where + ": repeat is true or false");
    pattern.repeat = json["repeat"].get<bool>();
  }
  if (json.contains("exposure")) pattern.exposure = number(json, where, "exposure");
  if (json.contains("file")) {
    if (json.contains("left") || json.contains("right")) refuse(where + ": give file, or left and right");
    pattern.files.fill(file_name(json, where, "file"));
  } else {
    pattern.files = {file_name(json, where, "left"), file_name(json, where, "right")};
  }
  return pattern;
}

PatternSequence sequence_of(const Json& json) {
  check_keys(json, "the manifest", {"format", "projector", "x", "y", "images"});
  if (const std::string format = text(json, "the manifest", "format"); format != kFormat) {
    refuse(fmt::format("a manifest starts with \"format\": \"{}\", not \"{}\"", kFormat, format));
  }
  PatternSequence sequence;
  if (json.contains("projector")) {
    check_keys(json["projector"], "projector", {"width_px", "height_px"});
    sequence.width_px = integer(json["projector"], "projector", "width_px");
    sequence.height_px = integer(json["projector"], "projector", "height_px");
  }
  if (json.contains("x")) sequence.x = axis_code(json["x"], "x");
  if (json.contains("y")) sequence.y = axis_code(json["y"], "y");
  if (!json.contains("images") || !json["images"].is_array()) refuse("images must be a list");
  for (std::size_t i = 0; i < json["images"].size(); ++i) {
    sequence.patterns.push_back(pattern_of(json["images"][i], fmt::format("image {}", i + 1)));
  }
  return sequence;
}

Json axis_json(const AxisCode& code) {
  Json json = {{"fringes", code.fringes}};
  if (code.gray_bits > 0) {
    json["gray_bits"] = code.gray_bits;
    json["word_periods"] = code.word_periods;
    if (code.word_offset) json["word_offset"] = *code.word_offset;
  }
  return json;
}

Json pattern_json(const Pattern& pattern) {
  Json json = {{"kind", std::string(pattern_kind_name(pattern.kind))}};
  if (pattern.kind == PatternKind::kFringe) {
    json["axis"] = std::string(axis_name(pattern.axis));
    json["set"] = pattern.frequency;
    json["shift"] = pattern.shift;
  } else if (pattern.kind == PatternKind::kGray || pattern.kind == PatternKind::kGrayInverse) {
    json["axis"] = std::string(axis_name(pattern.axis));
    json["bit"] = pattern.bit;
  }
  if (pattern.exposure != 1.0) json["exposure"] = pattern.exposure;
  if (pattern.repeat) json["repeat"] = true;
  if (pattern.files[0] == pattern.files[1]) {
    json["file"] = pattern.files[0];
  } else {
    json["left"] = pattern.files[0];
    json["right"] = pattern.files[1];
  }
  return json;
}

}  // namespace

Result<PatternSequence> read_pattern_manifest(const std::filesystem::path& path) {
  const auto json = read_json(path);
  if (!json) return tl::unexpected(json.error());
  const auto named = [&](const std::string& message) {
    return fail(ErrorCode::kBadInput, fmt::format("{}: {}", shown(path), message));
  };
  try {
    PatternSequence sequence = sequence_of(*json);
    if (auto ok = sequence.validate(); !ok) return named(ok.error().message);
    return sequence;
  } catch (const Refused& refused) {
    return named(refused.message);
  }
}

Result<> write_pattern_manifest(const std::filesystem::path& path, const PatternSequence& sequence) {
  Json json = {{"format", std::string(kFormat)}};
  if (sequence.width_px > 0) json["projector"] = {{"width_px", sequence.width_px}, {"height_px", sequence.height_px}};
  if (sequence.x.used()) json["x"] = axis_json(sequence.x);
  if (sequence.y.used()) json["y"] = axis_json(sequence.y);
  json["images"] = Json::array();
  for (const Pattern& pattern : sequence.patterns) json["images"].push_back(pattern_json(pattern));
  return write_json(path, json);
}

}  // namespace crosstie::base
