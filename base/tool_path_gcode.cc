#include "base/tool_path_gcode.h"

#include <cctype>
#include <map>
#include <optional>

#include <fmt/format.h>

#include "base/detail/gcode_moves.h"
#include "base/file.h"
#include "base/text.h"

namespace crosstie::base {
namespace {

using detail::gcode_number;
using detail::GcodeMove;
using detail::TorchAngles;
using Values = std::map<std::string, std::string, std::less<>>;

constexpr std::string_view kBegin = "{begin points}";
constexpr std::string_view kEnd = "{end points}";
constexpr std::size_t kLongestComment = 200;

/// A name inside of a comment: what would end it or the line is left out.
std::string for_comment(std::string_view text) {
  std::string clean;
  for (const char c : text.substr(0, kLongestComment)) {
    const bool printable = c >= ' ' && c <= '~';
    clean += printable && c != '(' && c != ')' ? c : '_';
  }
  return clean;
}

Values values_of(const ToolPath& path, const GcodeOptions& options, int plane) {
  return {{"program", for_comment(options.program)},
          {"frame", for_comment(path.frame)},
          {"count", std::to_string(path.points.size())},
          {"length_mm", fmt::format("{:.3f}", path.length_mm)},
          {"duration_s", fmt::format("{:.1f}", path.duration_s)},
          {"plane", fmt::format("G{}", plane)}};
}

void set_point(Values& values, const ToolPathPoint& p, const TorchAngles& angles, double retract_mm, std::size_t number) {
  const auto set = [&](const char* name, double value) { values[name] = gcode_number(value); };
  const Eigen::Vector3d approach = p.point_mm + retract_mm * p.torch;
  constexpr const char* kAxes[] = {"x", "y", "z"};
  for (int axis = 0; axis < 3; ++axis) {
    const std::string name = kAxes[axis];
    set(name.c_str(), p.point_mm(axis));
    set(("approach_" + name).c_str(), approach(axis));
    set(("torch_" + name).c_str(), p.torch(axis));
    set(("n" + name).c_str(), p.normal(axis));
  }
  set("a_deg", angles.a_deg);
  set("b_deg", angles.b_deg);
  set("tilt_deg", angles.tilt_deg);
  set("azimuth_deg", angles.azimuth_deg);
  constexpr double kSecondsPerMinute = 60.0;
  values["feed"] = fmt::format("{:.3f}", p.speed_mm_per_s * kSecondsPerMinute);
  values["s_mm"] = fmt::format("{:.3f}", p.s_mm);
  values["source"] = path_source_name(p.source);
  values["n"] = std::to_string(number);
}

struct Line {
  std::string_view text;
  std::size_t number = 0;
};

/// A template's lines before, in and after its block.
struct Parts {
  std::vector<Line> before;
  std::vector<Line> block;
  std::vector<Line> after;
};

tl::unexpected<Error> bad(std::size_t line, const std::string& what) {
  return fail(ErrorCode::kBadInput, fmt::format("G-code template, line {}: {}", line, what));
}

Result<Parts> parts_of(std::string_view text) {
  Parts parts;
  int stage = 0;
  std::size_t number = 0;
  if (text.ends_with('\n')) text.remove_suffix(1);
  for (std::string_view line : split(text, '\n')) {
    ++number;
    if (line.ends_with('\r')) line.remove_suffix(1);
    if (trim(line) == kBegin) {
      if (stage != 0) return bad(number, "a second {begin points}");
      stage = 1;
    } else if (trim(line) == kEnd) {
      if (stage != 1) return bad(number, "{end points} without {begin points} before it");
      stage = 2;
    } else {
      (stage == 0 ? parts.before : stage == 1 ? parts.block : parts.after).push_back({line, number});
    }
  }
  if (stage != 2) return bad(number, stage == 0 ? "it has no {begin points}" : "{begin points} without {end points}");
  return parts;
}

Result<std::string> filled(const Line& line, const Values& values) {
  std::string out;
  for (std::size_t i = 0; i < line.text.size(); ++i) {
    const char c = line.text[i];
    if (c != '{') {
      out += c;
      continue;
    }
    if (i + 1 < line.text.size() && line.text[i + 1] == '{') {
      out += '{';
      ++i;
      continue;
    }
    const std::size_t end = line.text.find('}', i);
    if (end == std::string_view::npos) return bad(line.number, "a brace is not closed");
    const std::string name(line.text.substr(i + 1, end - i - 1));
    const auto value = values.find(name);
    if (value == values.end()) {
      std::vector<std::string> known;
      for (const auto& [key, unused] : values) known.push_back(key);
      const auto meant = nearest_word(name, known);
      return bad(line.number, fmt::format("{{{}}} is no placeholder{}", name,
                                          name == "motion" ? " outside of the points"
                                          : meant          ? fmt::format("; did you mean {{{}}}", *meant)
                                                           : ""));
    }
    out += value->second;
    i = end;
  }
  return out + '\n';
}

/// Whether a word stands in a line outside of its comments.
bool has_word(std::string_view line, std::string_view word) {
  std::string code;
  bool in_comment = false;
  for (const char c : line) {
    if (c == ';') break;
    if (c == '(') in_comment = true;
    if (!in_comment && c != ' ' && c != '\t') code += static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
    if (c == ')') in_comment = false;
  }
  for (std::size_t at = code.find(word); at != std::string::npos; at = code.find(word, at + 1)) {
    const std::size_t next = at + word.size();
    if (next == code.size() || (code[next] != '.' && std::isdigit(static_cast<unsigned char>(code[next])) == 0)) return true;
  }
  return false;
}

Result<> check_unit(const Parts& parts) {
  bool stated = false;
  for (const auto* lines : {&parts.before, &parts.block, &parts.after}) {
    for (const Line& line : *lines) {
      if (has_word(line.text, "G20")) return bad(line.number, "G20 (inches); the path is in mm, state G21");
      stated = stated || (lines == &parts.before && has_word(line.text, "G21"));
    }
  }
  if (stated) return {};
  return bad(1, "no line before {begin points} states the unit; write G21 (mm)");
}

Result<> fill(const std::vector<Line>& lines, const Values& values, std::string& out) {
  for (const Line& line : lines) {
    auto text = filled(line, values);
    if (!text) return fail(std::move(text));
    out += *text;
  }
  return {};
}

}  // namespace

std::string_view default_gcode_template() {
  return R"(%
({program}: {count} points, {length_mm} mm, {duration_s} s)
(unit mm, frame {frame}; torch axis = Rx A Ry B z)
G21 G90 G94 {plane} G40 G49 G80
G0 X{approach_x} Y{approach_y} Z{approach_z} A{a_deg} B{b_deg}
G1 X{x} Y{y} Z{z} F{feed}
{begin points}
{motion} A{a_deg} B{b_deg} F{feed}
{end points}
G1 X{approach_x} Y{approach_y} Z{approach_z}
M2
%
)";
}

Result<std::string> gcode_of(const ToolPath& path, const GcodeOptions& options) {
  if (!(options.retract_mm >= 0.0) || !(options.arc_tolerance_mm >= 0.0)) {
    return fail(ErrorCode::kUsage, "retract_mm and arc_tolerance_mm are not negative");
  }
  if (path.points.size() < 2) return fail(ErrorCode::kInternal, "a tool path of less than two points is no program");
  const std::string text = options.template_text.empty() ? std::string(default_gcode_template()) : options.template_text;
  const auto parts = parts_of(text);
  if (!parts) return tl::unexpected(parts.error());
  if (auto good = check_unit(*parts); !good) return fail(std::move(good));
  const int plane = detail::arc_plane(path);
  const std::vector<TorchAngles> angles = detail::torch_angles(path);
  Values values = values_of(path, options, plane);
  std::string out;
  set_point(values, path.points.front(), angles.front(), options.retract_mm, 0);
  if (auto good = fill(parts->before, values, out); !good) return fail(std::move(good));
  for (const GcodeMove& move : detail::gcode_moves(path, plane, options.arc_tolerance_mm)) {
    set_point(values, path.points[move.to], angles[move.to], options.retract_mm, move.to);
    values["motion"] = move.words;
    if (auto good = fill(parts->block, values, out); !good) return fail(std::move(good));
  }
  values.erase("motion");
  if (auto good = fill(parts->after, values, out); !good) return fail(std::move(good));
  return out;
}

Result<> write_gcode(const std::filesystem::path& path, const ToolPath& tool_path, const GcodeOptions& options) {
  auto text = gcode_of(tool_path, options);
  if (!text) return fail(std::move(text));
  return write_file_atomically(path, *text);
}

}  // namespace crosstie::base
