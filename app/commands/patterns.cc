// crosstie patterns: what a projector is to show, and the manifest by which a scan reads its images

#include <algorithm>
#include <filesystem>
#include <string_view>

#include <fmt/core.h>

#include "app/result_folder.h"
#include "app/verb.h"
#include "base/file.h"
#include "base/image.h"
#include "base/text.h"
#include "scan/patterns.h"

namespace crosstie::app {
namespace {

namespace fs = std::filesystem;
using base::ErrorCode;
using base::Result;

Result<std::vector<double>> numbers(const Arguments& arguments, const std::string& option, std::vector<double> unless_given) {
  const auto text = arguments.get(option);
  if (!text) return unless_given;
  std::vector<double> values;
  for (const std::string_view part : base::split(*text, ',')) {
    const auto value = base::parse_double(part);
    if (!value) return base::fail(ErrorCode::kUsage, fmt::format("{} takes numbers such as 16,17.5, not '{}'", option, *text));
    values.push_back(*value);
  }
  return values;
}

Result<scan::PatternOptions> options_of(const Arguments& arguments) {
  scan::PatternOptions options;
  const std::string size = *arguments.get("--projector");
  const auto cross = std::find(size.begin(), size.end(), 'x');
  const auto width = base::parse_int(std::string_view(size.begin(), cross));
  const auto height = cross == size.end() ? std::nullopt : base::parse_int(std::string_view(cross + 1, size.end()));
  constexpr std::int64_t kMost = 1 << 15;
  if (!width || !height || *width < 1 || *height < 1 || *width > kMost || *height > kMost)
    return base::fail(ErrorCode::kUsage,
                      fmt::format("--projector is WIDTHxHEIGHT in pixels, such as 1920x1080, not '{}'", size));
  options.width_px = static_cast<int>(*width);
  options.height_px = static_cast<int>(*height);
  auto periods = numbers(arguments, "--period-px", options.periods_px);
  if (!periods) return tl::unexpected(periods.error());
  options.periods_px = *std::move(periods);
  auto exposures = numbers(arguments, "--exposures", options.exposures);
  if (!exposures) return tl::unexpected(exposures.error());
  options.exposures = *std::move(exposures);
  const auto steps = arguments.integer("--steps");
  if (!steps) return tl::unexpected(steps.error());
  options.steps = static_cast<int>(std::clamp(steps->value_or(options.steps), -1L, 1000L));
  for (const auto& [name, value] : {std::pair{"--gamma", &options.gamma}, std::pair{"--contrast", &options.contrast}}) {
    const auto number = arguments.number(name);
    if (!number) return tl::unexpected(number.error());
    *value = number->value_or(*value);
  }
  const std::string direction = arguments.get("--direction").value_or("both");
  if (direction != "both" && direction != "x" && direction != "y")
    return base::fail(ErrorCode::kUsage, fmt::format("--direction is x, y or both, not '{}'", direction));
  options.x = direction != "y";
  options.y = direction != "x";
  options.inverse = !arguments.has("--no-inverse");
  options.repeat = !arguments.has("--no-repeat");
  options.complementary = !arguments.has("--no-complementary");
  return options;
}

/// A folder of patterns may be replaced by another.
bool holds_patterns(const fs::path& folder) {
  std::error_code ignored;
  return fs::exists(folder / "patterns.json", ignored);
}

Result<Outcome> run(const Arguments& arguments, Session& session) {
  const auto options = options_of(arguments);
  if (!options) return tl::unexpected(options.error());
  const auto sequence = scan::make_patterns(*options);
  if (!sequence) return tl::unexpected(sequence.error());
  const fs::path out = *arguments.get("--out");
  auto folder = ResultFolder::begin(out, holds_patterns);
  if (!folder) return base::fail(std::move(folder));
  const base::Progress progress = session.progress();
  for (std::size_t i = 0; i < sequence->patterns.size(); ++i) {
    if (progress.cancelled()) return base::cancelled("patterns");
    const base::Pattern& pattern = sequence->patterns[i];
    const base::Image image = scan::render_pattern(*options, *sequence, pattern);
    if (auto written = base::write_image(folder->path() / pattern.files[0], image.view()); !written)
      return base::fail(std::move(written));
    progress("patterns", i + 1, sequence->patterns.size());
  }
  if (auto written = base::write_pattern_manifest(folder->path() / "patterns.json", *sequence); !written)
    return base::fail(std::move(written));
  if (auto done = folder->commit(); !done) return base::fail(std::move(done));
  session.say(fmt::format("{} images of {} x {} px", sequence->patterns.size(), options->width_px, options->height_px));
  session.print((out / "patterns.json").string());
  return Outcome::kOk;
}

}  // namespace

Verb patterns_verb() {
  return {"patterns",
          "make the images that a projector shows for a scan, with their manifest",
          "  $ crosstie patterns --projector 1024x768 --period-px 16 --steps 8 --out patterns\n"
          "  50 images of 1024 x 768 px\n"
          "  patterns/patterns.json",
          {{"--projector", "WxH", "size of the projector in pixels, such as 1920x1080", true, false},
           {"--period-px", "PX",
            "extent of a fringe in projector pixels (default 32); several, such as 16,17.5,21: no Gray code, the sets "
            "tell the fringes together",
            false, false},
           {"--steps", "N", "images of each set of fringes, 3 to 64 (default 8)", false, false},
           {"--direction",
            "AXIS",
            "x (upright stripes), y (lying) or both (default): two directions test the calibration in every scan",
            false,
            false,
            1,
            {"x", "y", "both"}},
           {"--no-inverse", "", "show no Gray code image with bright and dark exchanged", false, false},
           {"--no-complementary", "",
            "Gray code words of whole fringes: an image less, but blurred edges can tell a wrong fringe", false, false},
           {"--no-repeat", "",
            "do not show the first patterns once more at the end, by which movement and changed light are told", false, false},
           {"--gamma", "NUMBER", "gamma of the projector, for which levels are corrected (default 1)", false, false},
           {"--contrast", "NUMBER", "of the fringes, 0 to 1 (default 0.9)", false, false},
           {"--exposures", "LIST", "relative exposure times of a series, such as 1,4,16 (default 1)", false, false},
           {"--out", "DIR", "folder for the images (PNG) and patterns.json; replaced as a whole", true, false}},
          run};
}

}  // namespace crosstie::app
