#include "base/pattern_sequence.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <utility>

#include <fmt/format.h>

namespace crosstie::base {
namespace {

constexpr std::array<std::pair<PatternKind, std::string_view>, 5> kKinds = {{
    {PatternKind::kWhite, "white"},
    {PatternKind::kBlack, "black"},
    {PatternKind::kGray, "gray"},
    {PatternKind::kGrayInverse, "gray_inverse"},
    {PatternKind::kFringe, "fringe"},
}};

constexpr int kMaxBits = 15;
constexpr int kMaxExtent_px = 1 << 15;
constexpr double kMaxFringes = 16384.0;
constexpr std::size_t kMaxPatterns = 1000;

tl::unexpected<Error> refuse(std::string message) { return fail(ErrorCode::kBadInput, "patterns: " + std::move(message)); }

bool tells(const Pattern& pattern, PatternKind kind, ProjectorAxis axis) {
  return pattern.kind == kind && pattern.axis == axis && !pattern.repeat;
}

/// Whether two images show the same.
bool same_pattern(const Pattern& a, const Pattern& b) {
  return a.kind == b.kind && a.axis == b.axis && a.bit == b.bit && a.frequency == b.frequency && a.shift == b.shift &&
         a.exposure == b.exposure;
}

Result<> check_fringes(const PatternSequence& sequence, ProjectorAxis axis) {
  const AxisCode& code = sequence.code(axis);
  for (std::size_t f = 0; f < code.fringes.size(); ++f) {
    if (!(code.fringes[f] > 0.0 && code.fringes[f] <= kMaxFringes)) {
      return refuse(fmt::format("{} fringes over the axis {}; from above 0 to {} are possible", code.fringes[f],
                                axis_name(axis), kMaxFringes));
    }
    std::set<double> shifts;
    for (const int i : sequence.fringe_images(axis, static_cast<int>(f))) {
      const double shift = sequence.patterns[static_cast<std::size_t>(i)].shift;
      shifts.insert(std::round((shift - std::floor(shift)) * 1e9));
    }
    if (shifts.size() < 3) {
      return refuse(fmt::format("set {} of the axis {} has {} different shifts; a phase needs three or more", f,
                                axis_name(axis), shifts.size()));
    }
  }
  return {};
}

Result<> check_gray(const PatternSequence& sequence, ProjectorAxis axis) {
  const AxisCode& code = sequence.code(axis);
  if (code.gray_bits < 0 || code.gray_bits > kMaxBits) {
    return refuse(fmt::format("{} bits of Gray code; at most {} are possible", code.gray_bits, kMaxBits));
  }
  std::vector<int> seen(static_cast<std::size_t>(code.gray_bits), 0);
  for (const Pattern& pattern : sequence.patterns) {
    if (!tells(pattern, PatternKind::kGray, axis) && !tells(pattern, PatternKind::kGrayInverse, axis)) continue;
    if (pattern.bit < 0 || pattern.bit >= code.gray_bits) {
      return refuse(
          fmt::format("an image shows bit {} of the axis {}, which has {}", pattern.bit, axis_name(axis), code.gray_bits));
    }
    const int mask = pattern.kind == PatternKind::kGray ? 1 : 2;
    int& bit = seen[static_cast<std::size_t>(pattern.bit)];
    if ((bit & mask) != 0) {
      return refuse(fmt::format("two images show the same {} of bit {} of the axis {}", pattern_kind_name(pattern.kind),
                                pattern.bit, axis_name(axis)));
    }
    bit |= mask;
  }
  for (std::size_t bit = 0; bit < seen.size(); ++bit) {
    if ((seen[bit] & 1) == 0) return refuse(fmt::format("no image shows bit {} of the axis {}", bit, axis_name(axis)));
  }
  if (code.gray_bits > 0 && !(code.word_periods > 0.0 && code.word_periods <= 1.0)) {
    return refuse(fmt::format("Gray words of {} periods; a word is longer than 0 and at most one period", code.word_periods));
  }
  return {};
}

Result<> check_axis(const PatternSequence& sequence, ProjectorAxis axis) {
  const AxisCode& code = sequence.code(axis);
  const bool shown = std::any_of(sequence.patterns.begin(), sequence.patterns.end(), [&](const Pattern& pattern) {
    return pattern.axis == axis && pattern.kind != PatternKind::kWhite && pattern.kind != PatternKind::kBlack;
  });
  if (!code.used()) {
    if (shown) return refuse(fmt::format("images tell the axis {}, which has no fringes", axis_name(axis)));
    return {};
  }
  if (auto ok = check_fringes(sequence, axis); !ok) return ok;
  if (auto ok = check_gray(sequence, axis); !ok) return ok;
  const double finest = code.fringes[static_cast<std::size_t>(code.finest())];
  if (code.gray_bits == 0 && code.fringes.size() < 2 && finest > 1.0) {
    return refuse(
        fmt::format("{} fringes of the axis {} with neither a Gray code nor a second set: nothing tells which is which", finest,
                    axis_name(axis)));
  }
  if (code.gray_bits > 0 && std::ldexp(code.word_periods, code.gray_bits) < finest - 1e-6) {
    return refuse(fmt::format("{} bits of Gray code number {} periods of the axis {}, which has {}", code.gray_bits,
                              std::ldexp(code.word_periods, code.gray_bits), axis_name(axis), finest));
  }
  return {};
}

}  // namespace

std::string_view pattern_kind_name(PatternKind kind) {
  return std::find_if(kKinds.begin(), kKinds.end(), [&](const auto& entry) { return entry.first == kind; })->second;
}

std::optional<PatternKind> pattern_kind_from_name(std::string_view name) {
  for (const auto& [kind, known] : kKinds) {
    if (known == name) return kind;
  }
  return {};
}

std::string_view axis_name(ProjectorAxis axis) { return axis == ProjectorAxis::kX ? "x" : "y"; }

std::optional<int> PatternSequence::first_of(int index) const {
  const Pattern& last = patterns[static_cast<std::size_t>(index)];
  const bool reference = last.kind == PatternKind::kWhite || last.kind == PatternKind::kBlack;
  if (!last.repeat && !reference) return {};
  for (int i = 0; i < index; ++i) {
    if (same_pattern(patterns[static_cast<std::size_t>(i)], last)) return i;
  }
  return {};
}

int AxisCode::finest() const { return static_cast<int>(std::max_element(fringes.begin(), fringes.end()) - fringes.begin()); }

std::vector<int> PatternSequence::fringe_images(ProjectorAxis axis, int frequency) const {
  std::vector<int> result;
  for (std::size_t i = 0; i < patterns.size(); ++i) {
    if (tells(patterns[i], PatternKind::kFringe, axis) && patterns[i].frequency == frequency)
      result.push_back(static_cast<int>(i));
  }
  return result;
}

Result<> PatternSequence::validate() const {
  if (width_px < 0 || height_px < 0 || width_px > kMaxExtent_px || height_px > kMaxExtent_px) {
    return refuse(fmt::format("a projector of {} x {} px; up to {} are possible", width_px, height_px, kMaxExtent_px));
  }
  if (patterns.size() > kMaxPatterns)
    return refuse(fmt::format("{} images; up to {} are possible", patterns.size(), kMaxPatterns));
  if (!x.used() && !y.used()) return refuse("there are no fringes");
  for (const Pattern& pattern : patterns) {
    if (!std::isfinite(pattern.shift)) return refuse("a shift is not a number");
    if (!(pattern.exposure > 0.0 && pattern.exposure <= 1e6)) return refuse(fmt::format("an exposure of {}", pattern.exposure));
    if (pattern.kind == PatternKind::kFringe &&
        (pattern.frequency < 0 || pattern.frequency >= static_cast<int>(code(pattern.axis).fringes.size()))) {
      return refuse(fmt::format("an image shows set {} of the axis {}, which has {}", pattern.frequency,
                                axis_name(pattern.axis), code(pattern.axis).fringes.size()));
    }
  }
  for (std::size_t i = 0; i < patterns.size(); ++i) {
    if (patterns[i].repeat && !first_of(static_cast<int>(i)))
      return refuse(fmt::format("image {} repeats a pattern that is not shown before it", i + 1));
  }
  if (auto ok = check_axis(*this, ProjectorAxis::kX); !ok) return ok;
  return check_axis(*this, ProjectorAxis::kY);
}

}  // namespace crosstie::base
