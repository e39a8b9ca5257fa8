// crosstie calibrate: images of a board -> lenses and rig

#include <fmt/core.h>
#include <fmt/ranges.h>

#include "app/job_index.h"
#include "app/lens_word.h"
#include "app/steps_calibrate.h"
#include "app/verb.h"
#include "base/text.h"
#include "markers/family.h"

namespace crosstie::app {
namespace {

using base::ErrorCode;
using base::fail;
using base::Result;

/// "9x6": two whole numbers.
Result<std::pair<int, int>> read_size(const std::string& option, const std::string& text, int most) {
  const auto parts = base::split(text, 'x');
  const long first = base::parse_int(parts.front()).value_or(0);
  const long second = base::parse_int(parts.back()).value_or(0);
  if (parts.size() != 2 || first < 1 || second < 1 || first > most || second > most) {
    return fail(ErrorCode::kUsage, fmt::format("{} takes two whole numbers such as 9x6, not '{}'", option, text));
  }
  return std::pair{static_cast<int>(first), static_cast<int>(second)};
}

Result<> read_number(const Arguments& arguments, const char* name, bool zero, std::optional<double>& value) {
  const auto number = arguments.number(name);
  if (!number) return tl::unexpected(number.error());
  if (*number && !(**number > 0.0) && !(zero && **number == 0.0)) {
    return fail(ErrorCode::kUsage, fmt::format("{} must be {}", name, zero ? "0 or positive" : "positive"));
  }
  if (*number) value = **number;
  return {};
}

Result<std::string> read_word(const Arguments& arguments, const char* name, const std::vector<std::string>& words) {
  const std::string word = arguments.get(name).value_or(words.front());
  if (std::find(words.begin(), words.end(), word) == words.end()) {
    return fail(ErrorCode::kUsage, fmt::format("{} is one of {}, not '{}'", name, fmt::join(words, ", "), word));
  }
  return word;
}

Result<> read_board(const Arguments& arguments, JobBoard& read) {
  base::Board& board = read.board;
  if (!arguments.has("--pattern") || !arguments.has("--pitch-mm")) {
    return fail(ErrorCode::kUsage, "calibrate needs --pattern COLUMNSxROWS (inner corners) and --pitch-mm");
  }
  constexpr int kMostCorners = 1000;
  const auto size = read_size("--pattern", *arguments.get("--pattern"), kMostCorners);
  if (!size) return tl::unexpected(size.error());
  std::tie(board.columns, board.rows) = *size;
  const auto grid = read_word(arguments, "--grid", {"chessboard", "circles", "asymmetric_circles", "aprilgrid"});
  if (!grid) return tl::unexpected(grid.error());
  board.pattern = *base::pattern_from_name(*grid);
  const auto shape = read_word(arguments, "--board", {"free", "rigid"});
  if (!shape) return tl::unexpected(shape.error());
  board.free = *shape == "free";
  auto detector = read_word(arguments, "--detector", {"auto", "classic", "sb"});
  if (!detector) return tl::unexpected(detector.error());
  read.detector = std::move(*detector);
  read.family = arguments.get("--family").value_or(board.pattern == base::BoardPattern::kAprilGrid ? "apriltag:tag36h11" : "");
  std::optional<double> pitch_mm;
  std::optional<double> tag_mm;
  if (auto ok = read_number(arguments, "--pitch-mm", false, pitch_mm); !ok) return ok;
  if (auto ok = read_number(arguments, "--tag-mm", false, tag_mm); !ok) return ok;
  board.pitch_mm = *pitch_mm;
  board.tag_mm = tag_mm.value_or(0.0);
  if (board.free) board = board.with_default_prior();
  for (const auto& [name, sigma] :
       {std::pair{"--board-sigma-mm", &board.prior.sigma_mm}, std::pair{"--bend-sigma-mm", &board.prior.bend_sigma_mm},
        std::pair{"--pitch-sigma-ppm", &board.prior.pitch_sigma_ppm}}) {
    if (arguments.has(name) && !board.free) {
      return fail(ErrorCode::kUsage, fmt::format("{} says how far a free board's shape may go; --board rigid has none", name));
    }
    std::optional<double> value;
    if (auto ok = read_number(arguments, name, true, value); !ok) return ok;
    *sigma = value.value_or(*sigma);
  }
  if (const auto valid = board.validate(); !valid) return fail(ErrorCode::kUsage, valid.error().message);
  return {};
}

Result<> read_images(const Arguments& arguments, CalibrationTask& task) {
  const bool from_file = arguments.has("--corners");
  if (from_file == arguments.has("--images")) {
    return fail(ErrorCode::kUsage,
                "give --images NAME='PATTERN' of each camera, or --corners FILE.vnl with --camera and --size");
  }
  std::vector<ImageFile> images;
  for (const std::string& word : arguments.all(from_file ? "--camera" : "--images")) {
    const auto named = named_pattern(from_file ? "--camera" : "--images", word);
    if (!named) return tl::unexpected(named.error());
    if (std::find(task.cameras.begin(), task.cameras.end(), named->first) != task.cameras.end()) {
      return fail(ErrorCode::kUsage, fmt::format("the camera {} is named twice", named->first));
    }
    task.cameras.push_back(named->first);
    if (from_file) {
      task.corner_patterns.push_back(*named);
      continue;
    }
    auto files = match_files(named->second);
    if (!files) return tl::unexpected(files.error());
    for (std::filesystem::path& path : *files) images.push_back({{}, named->first, std::move(path)});
  }
  if (task.cameras.empty() || task.cameras.size() > 2) {
    return fail(ErrorCode::kUsage, "calibrate takes one camera, or two on one mount, the left one first");
  }
  if (!from_file) {
    auto named = name_images(std::move(images));
    if (!named) return tl::unexpected(named.error());
    task.images = std::move(*named);
    return {};
  }
  if (!arguments.has("--size")) return fail(ErrorCode::kUsage, "--corners needs --size, WIDTHxHEIGHT of the images in pixels");
  constexpr int kMostPixels = 100'000;
  const auto size = read_size("--size", *arguments.get("--size"), kMostPixels);
  if (!size) return tl::unexpected(size.error());
  std::tie(task.width_px, task.height_px) = *size;
  task.corners = *arguments.get("--corners");
  return {};
}

Result<CalibrationTask> task_of(const Arguments& arguments) {
  CalibrationTask task;
  task.base_folder = std::filesystem::current_path();
  if (auto ok = read_board(arguments, task.board); !ok) return fail(std::move(ok));
  if (auto ok = read_images(arguments, task); !ok) return fail(std::move(ok));
  if (const auto lens = arguments.get("--lens")) {
    task.options.lens = lens_from_word(*lens);
    if (!task.options.lens) {
      return fail(ErrorCode::kUsage, fmt::format("--lens is one of {}, not '{}'", fmt::join(lens_words(), ", "), *lens));
    }
  }
  if (auto ok = read_number(arguments, "--baseline-mm", false, task.options.expected_baseline_mm); !ok)
    return fail(std::move(ok));
  if (auto ok = read_number(arguments, "--sigma-px", false, task.options.sigma_px); !ok) return fail(std::move(ok));
  task.options.reject_outliers = !arguments.has("--keep-outliers");
  return task;
}

/// What goes with a job and without.
Result<CalibrationTask> with_common_options(Result<CalibrationTask> task, const Arguments& arguments) {
  if (!task) return task;
  task->options.cross_validate = !arguments.has("--no-validation");
  if (const auto previous = arguments.get("--previous")) task->previous = *previous;
  if (auto ok = read_number(arguments, "--distance-mm", false, task->distance_mm); !ok) return fail(std::move(ok));
  return task;
}

Result<Outcome> calibrate_into(const Result<CalibrationTask>& task, const std::filesystem::path& out, Session& session) {
  if (!task) return tl::unexpected(task.error());
  const auto step = calibrate_step(*task, out, session);
  if (!step) return tl::unexpected(step.error());
  session.say("calibrate  " + step->summary);
  session.print((step->folder / "result.json").string());
  return step->outcome;
}

Result<Outcome> run(const Arguments& arguments, Session& session) {
  const auto out = arguments.get("--out");
  if (!arguments.has("JOB")) {
    if (!out) return fail(ErrorCode::kUsage, "without a JOB calibrate needs --out, a folder for the result");
    return calibrate_into(with_common_options(task_of(arguments), arguments), *out, session);
  }
  for (const char* option : {"--corners", "--camera", "--images", "--pattern", "--pitch-mm", "--size", "--grid", "--lens",
                             "--board", "--detector", "--family", "--tag-mm", "--board-sigma-mm", "--bend-sigma-mm",
                             "--pitch-sigma-ppm", "--baseline-mm", "--sigma-px", "--keep-outliers"}) {
    if (arguments.has(option)) {
      return fail(ErrorCode::kUsage, fmt::format("{} goes without a JOB; a job says it in its job.toml", option));
    }
  }
  const auto job = read_job(*arguments.get("JOB"));
  if (!job) return tl::unexpected(job.error());
  const auto task = with_common_options(calibration_task(*job), arguments);
  if (out) return calibrate_into(task, *out, session);
  return with_index(*job, calibrate_into(task, job->folder / "results" / "calibrate", session));
}

}  // namespace

Verb calibrate_verb() {
  return {
      "calibrate",
      "calibrate cameras by images of a board: lenses and rig with full covariance, validated on what they have not seen",
      "  $ crosstie calibrate --images left='board/left*.png' --images right='board/right*.png' --pattern 11x8 \\\n"
      "      --pitch-mm 19 --out head\n"
      "  calibrate  40 images of 2 cameras, opencv5, rms 0.055 px (held out 0.068 px), baseline 119.651 +- 0.041 mm, 3 "
      "rejected, "
      "2 warnings\n"
      "  head/result.json",
      {{"JOB", "JOB", "job folder or its job.toml, with [board] and board_images; or the options below", false, false},
       {"--out", "DIR", "folder for the result (default: JOB/results/calibrate); replaced as a whole", false, false},
       {"--images", "NAME='PATTERN'", "photographs of a camera; of two cameras the left one first", false, true},
       {"--corners", "FILE", "instead: corners that another program found (.vnl: filename x y level)", false, false},
       {"--camera", "NAME='PATTERN'", "with --corners: a camera and the names of its images; the left one first", false, true},
       {"--size", "WIDTHxHEIGHT", "with --corners: size of the images in pixels", false, false},
       {"--pattern", "COLUMNSxROWS", "inner corners, or dots, of the board", false, false},
       {"--pitch-mm", "MM", "distance of neighbouring corners", false, false},
       {"--grid",
        "GRID",
        "chessboard (default), circles, asymmetric_circles, aprilgrid",
        false,
        false,
        1,
        {"chessboard", "circles", "asymmetric_circles", "aprilgrid"}},
       {"--tag-mm", "MM", "of an AprilGrid: edge of a tag", false, false},
       {"--family", "FAMILY", "of an AprilGrid: its tags (default apriltag:tag36h11)", false, false, 1,
        markers::marker_family_names()},
       {"--board",
        "SHAPE",
        "free (default): its shape is estimated under a prior; rigid: it is taken as nominal",
        false,
        false,
        1,
        {"free", "rigid"}},
       {"--board-sigma-mm", "MM", "the prior: scatter of each point's coordinates (default pitch / 250)", false, false},
       {"--bend-sigma-mm", "MM", "the prior: smooth bending (default 1/1000 of the diagonal)", false, false},
       {"--pitch-sigma-ppm", "PPM", "the prior: scale of the pitch (default 1000)", false, false},
       {"--lens", "LENS", "pinhole, opencv4, opencv5, opencv8, opencv12 (default: chosen by cross-validation)", false, false, 1,
        lens_words()},
       {"--detector",
        "DETECTOR",
        "of a chessboard: classic, sb, or auto (default): classic, unless sb finds the board in a third more images; the two "
        "are compared, "
        "above 25 megapixels of images on a sample",
        false,
        false,
        1,
        {"auto", "classic", "sb"}},
       {"--baseline-mm", "MM", "distance of the cameras as a drawing says; what contradicts it is refused", false, false},
       {"--sigma-px", "PX", "standard deviation of a corner's coordinate (default: told by the residuals)", false, false},
       {"--distance-mm", "MM", "working distance for which uncertainties are stated (default: the median one of the boards)",
        false, false},
       {"--previous", "DIR", "an earlier result of calibrate: what has changed since, over its sigma", false, false},
       {"--keep-outliers", "", "every corner takes part (default: outliers are left out, with reasons)", false, false},
       {"--no-validation", "", "no cross-validation: much faster, and nothing tells how well the result predicts", false,
        false}},
      run};
}

}  // namespace crosstie::app
