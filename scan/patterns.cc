#include "scan/patterns.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <fmt/format.h>

#include "scan/detail/fringe_kernel.h"

namespace crosstie::scan {
namespace {

using base::ErrorCode;
using base::fail;
using base::Pattern;
using base::PatternKind;
using base::PatternSequence;
using base::ProjectorAxis;
using base::Result;

constexpr int kMaxExtent_px = 1 << 15;

int extent_px(const PatternOptions& options, ProjectorAxis axis) {
  return axis == ProjectorAxis::kX ? options.width_px : options.height_px;
}

base::AxisCode code_of(const PatternOptions& options, ProjectorAxis axis) {
  base::AxisCode code;
  const double extent = extent_px(options, axis);
  for (const double period : options.periods_px) code.fringes.push_back(extent / period);
  if (options.periods_px.size() > 1) return code;
  code.word_periods = options.complementary ? 0.5 : 1.0;
  code.word_offset = 0.0;
  while (std::ldexp(code.word_periods, code.gray_bits) < code.fringes.front()) ++code.gray_bits;
  return code;
}

void add_axis(const PatternOptions& options, ProjectorAxis axis, PatternSequence& sequence) {
  const base::AxisCode& code = sequence.code(axis);
  for (int bit = 0; bit < code.gray_bits; ++bit) {
    Pattern pattern{PatternKind::kGray, axis, bit, 0, 0.0, 1.0, {}};
    sequence.patterns.push_back(pattern);
    if (!options.inverse) continue;
    pattern.kind = PatternKind::kGrayInverse;
    sequence.patterns.push_back(pattern);
  }
  for (std::size_t set = 0; set < code.fringes.size(); ++set) {
    for (const double exposure : options.exposures) {
      for (int step = 0; step < options.steps; ++step) {
        sequence.patterns.push_back(
            {PatternKind::kFringe, axis, 0, static_cast<int>(set), static_cast<double>(step) / options.steps, exposure, {}});
      }
    }
  }
}

/// The grey level that a projector with this gamma turns into `light` of its brightest, both 0..1.
double level_of(double light, double gamma) { return std::pow(std::clamp(light, 0.0, 1.0), 1.0 / gamma); }

}  // namespace

Result<> PatternOptions::validate() const {
  const auto bad = [](const std::string& what) { return fail(ErrorCode::kUsage, "patterns: " + what); };
  if (width_px < 1 || height_px < 1 || width_px > kMaxExtent_px || height_px > kMaxExtent_px)
    return bad(fmt::format("a projector of {} x {} px; from 1 to {} are possible", width_px, height_px, kMaxExtent_px));
  if (periods_px.empty()) return bad("there must be a period");
  for (const double period : periods_px) {
    if (!(period >= 3.0 && period <= kMaxExtent_px))
      return bad(fmt::format("a period of {} px; it must be 3 px or more", period));
  }
  if (steps < 3 || steps > detail::kMaxSteps)
    return bad(fmt::format("{} steps; from 3 to {} are possible", steps, detail::kMaxSteps));
  if (!x && !y) return bad("neither direction is asked for");
  if (!(gamma > 0.1 && gamma < 10.0)) return bad(fmt::format("gamma is {}, not in (0.1, 10)", gamma));
  if (!(contrast > 0.0 && contrast <= 1.0)) return bad(fmt::format("contrast is {}, not in (0, 1]", contrast));
  if (exposures.empty()) return bad("there must be an exposure");
  for (const double exposure : exposures) {
    if (!(exposure > 0.0 && exposure <= 1e6)) return bad(fmt::format("an exposure of {}", exposure));
  }
  return {};
}

Result<PatternSequence> make_patterns(const PatternOptions& options) {
  if (auto ok = options.validate(); !ok) return fail(std::move(ok));
  PatternSequence sequence;
  sequence.width_px = options.width_px;
  sequence.height_px = options.height_px;
  if (options.x) sequence.x = code_of(options, ProjectorAxis::kX);
  if (options.y) sequence.y = code_of(options, ProjectorAxis::kY);
  const auto add_references = [&] {
    sequence.patterns.push_back({PatternKind::kWhite, ProjectorAxis::kX, 0, 0, 0.0, 1.0, {}});
    sequence.patterns.push_back({PatternKind::kBlack, ProjectorAxis::kX, 0, 0, 0.0, 1.0, {}});
  };
  add_references();
  if (options.x) add_axis(options, ProjectorAxis::kX, sequence);
  if (options.y) add_axis(options, ProjectorAxis::kY, sequence);
  if (options.repeat) {
    for (const ProjectorAxis axis : {ProjectorAxis::kX, ProjectorAxis::kY}) {
      const base::AxisCode& code = sequence.code(axis);
      if (!code.used()) continue;
      Pattern pattern = sequence.patterns[static_cast<std::size_t>(sequence.fringe_images(axis, code.finest()).front())];
      pattern.repeat = true;
      sequence.patterns.push_back(pattern);
    }
    add_references();
  }
  const int digits = sequence.patterns.size() > 100 ? 3 : 2;
  for (std::size_t i = 0; i < sequence.patterns.size(); ++i)
    sequence.patterns[i].files.fill(fmt::format("{:0{}}.png", i, digits));
  if (auto ok = sequence.validate(); !ok) return fail(ErrorCode::kUsage, ok.error().message);
  return sequence;
}

base::Image render_pattern(const PatternOptions& options, const PatternSequence& sequence, const Pattern& pattern) {
  constexpr double kWhite = 255.0;
  base::Image image(options.width_px, options.height_px, 8);
  const base::AxisCode& code = sequence.code(pattern.axis);
  const int extent = extent_px(options, pattern.axis);
  std::vector<std::uint8_t> along(static_cast<std::size_t>(extent));
  for (int i = 0; i < extent; ++i) {
    const double at = (i + 0.5) / extent;  // of the pixel's middle over the extent
    double light = pattern.kind == PatternKind::kWhite ? 1.0 : 0.0;
    if (pattern.kind == PatternKind::kFringe) {
      const double turns = code.fringes[static_cast<std::size_t>(pattern.frequency)] * at - pattern.shift;
      light = 0.5 + 0.5 * options.contrast * std::cos(2.0 * std::numbers::pi * turns);
    } else if (pattern.kind == PatternKind::kGray || pattern.kind == PatternKind::kGrayInverse) {
      const auto word = static_cast<unsigned>(code.fringes[static_cast<std::size_t>(code.finest())] * at / code.word_periods);
      const bool set = (((word ^ (word >> 1U)) >> static_cast<unsigned>(code.gray_bits - 1 - pattern.bit)) & 1U) != 0;
      light = set == (pattern.kind == PatternKind::kGray) ? 1.0 : 0.0;
    }
    along[static_cast<std::size_t>(i)] = static_cast<std::uint8_t>(std::lround(kWhite * level_of(light, options.gamma)));
  }
  for (int y = 0; y < options.height_px; ++y) {
    auto* row = image.row<std::uint8_t>(y);
    if (pattern.axis == ProjectorAxis::kX) {
      std::copy(along.begin(), along.end(), row);
    } else {
      std::fill_n(row, options.width_px, along[static_cast<std::size_t>(y)]);
    }
  }
  return image;
}

}  // namespace crosstie::scan
