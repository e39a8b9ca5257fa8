// images of a board -> lenses and rig

#include "app/steps_calibrate.h"

#include <algorithm>

#include <fmt/core.h>
#include <nlohmann/json.hpp>

#include "app/certificates.h"
#include "app/current.h"
#include "app/lens_word.h"
#include "app/result_folder.h"
#include "app/verdicts.h"
#include "base/calibration_reader.h"
#include "base/camera_file.h"
#include "base/file.h"
#include "base/npy.h"
#include "base/result_document.h"
#include "calib/compare_corners.h"
#include "calib/quality.h"
#include "calib/second_opinion.h"
#include "report/calibration_report.h"
#include "report/calibration_tables.h"

namespace crosstie::app {
namespace {

namespace fs = std::filesystem;
using base::Calibration;
using base::Result;
using nlohmann::ordered_json;

ordered_json board_options(const JobBoard& job) {
  const base::Board& board = job.board;
  ordered_json json = {{"pattern", base::pattern_name(board.pattern)},
                       {"corners", {board.columns, board.rows}},
                       {"pitch_mm", board.pitch_mm},
                       {"temperature_c", board.temperature_c},
                       {"cte_per_k", board.cte_per_k},
                       {"shape", board.free ? "free" : "rigid"},
                       {"detector", job.detector}};
  if (board.free) {
    json.update({{"sigma_mm", board.prior.sigma_mm},
                 {"bend_sigma_mm", board.prior.bend_sigma_mm},
                 {"pitch_sigma_ppm", board.prior.pitch_sigma_ppm}});
  }
  if (board.pattern == base::BoardPattern::kAprilGrid) {
    json.update({{"tag_mm", board.tag_mm}, {"first_id", board.first_id}, {"family", job.family}});
  }
  const base::Certificate& certificate = board.certificate;
  if (!certificate.number.empty()) json["certificate"] = certificate.number;
  if (certificate.issued) json["certificate_date"] = base::format_date(*certificate.issued);
  if (certificate.valid_until) json["certificate_expires"] = base::format_date(*certificate.valid_until);
  return json;
}

/// All that the calibration depends on, apart from files.
ordered_json effective_options(const CalibrationTask& task) {
  const calib::CalibrateOptions& options = task.options;
  ordered_json json = {{"board", board_options(task.board)},
                       {"lens", options.lens ? lens_word(*options.lens) : "chosen by cross-validation"},
                       {"cross_validate", options.cross_validate},
                       {"folds", options.folds},
                       {"significance", options.significance},
                       {"reject_outliers", options.reject_outliers}};
  json["cameras"] = ordered_json::array();
  for (const std::string& name : task.cameras) {
    ordered_json& camera = json["cameras"].emplace_back(ordered_json{{"name", name}});
    if (task.temperatures_c.contains(name)) camera["temperature_c"] = task.temperatures_c.at(name);
    ordered_json images = ordered_json::array();
    for (const ImageFile& file : task.images) {
      if (file.camera == name) images.push_back(file.name);
    }
    for (const auto& [owner, pattern] : task.corner_patterns) {
      if (owner == name) images.push_back(pattern);
    }
    camera["images"] = std::move(images);
  }
  if (task.corners) json["size_px"] = {task.width_px, task.height_px};
  if (options.sigma_px) json["sigma_px"] = *options.sigma_px;
  if (options.expected_baseline_mm) json["expected_baseline_mm"] = *options.expected_baseline_mm;
  if (task.date) json["date"] = base::format_date(*task.date);
  const JobLimits& limits = task.limits;
  json["limits"] = {{"heldout_rms_px", limits.heldout_rms_px},
                    {"halves_ratio", limits.halves_ratio},
                    {"area_not_covered", limits.area_not_covered},
                    {"prior_ratio", limits.prior_ratio}};
  if (limits.baseline_sigma_mm) json["limits"]["baseline_sigma_mm"] = *limits.baseline_sigma_mm;
  if (task.distance_mm) json["distance_mm"] = *task.distance_mm;
  if (task.previous) {
    json["previous"] = true;
    json["limits"]["rig_change_w"] = limits.rig_change_w;
  }
  return json;
}

Result<std::vector<base::ResultInput>> inputs_of(const CalibrationTask& task) {
  std::vector<fs::path> files;
  for (const ImageFile& file : task.images) files.push_back(file.path);
  if (task.corners) files.push_back(*task.corners);
  if (task.previous) {
    for (const char* name : {"result.json", "covariance.json", "covariance.npy"}) files.push_back(*task.previous / name);
  }
  return hashed_inputs(files, task.base_folder);
}

bool is_jpeg(const ImageFile& file) {
  const std::string ending = file.path.extension().string();
  return ending == ".jpg" || ending == ".jpeg" || ending == ".JPG" || ending == ".JPEG";
}

/// What is to be said of the input besides what the calibration says.
std::vector<base::Warning> warnings_of(const CalibrationTask& task) {
  std::vector<base::Warning> warnings;
  check_certificate(task.board.board.certificate, "the board", task.date, warnings);
  const auto jpegs = std::count_if(task.images.begin(), task.images.end(), is_jpeg);
  if (jpegs > 0) {
    warnings.push_back(
        {"jpeg_images", "",
         fmt::format("{} of {} images are JPEG files: their compression moves edges. Record PNG or TIFF where the "
                     "last hundredths of a pixel count",
                     jpegs, task.images.size())});
  }
  return warnings;
}

/// Those of `images` that `sample` holds, too.
std::vector<base::BoardImage> same_photographs(const std::vector<base::BoardImage>& images,
                                               const std::vector<base::BoardImage>& sample) {
  std::vector<base::BoardImage> same;
  for (const base::BoardImage& image : images) {
    if (std::any_of(sample.begin(), sample.end(),
                    [&](const auto& s) { return s.image == image.image && s.camera == image.camera; }))
      same.push_back(image);
  }
  return same;
}

/// What each detector's corners lead to; of a sample of the photographs the first one's, too. nothing where there is one detector only.
std::vector<base::DetectorTrial> detector_trials(const CalibrationTask& task, const std::vector<FoundCorners>& found,
                                                 const Calibration& used, Session& session) {
  std::vector<base::DetectorTrial> trials;
  if (found.size() < 2) return trials;
  base::DetectorTrial& own = trials.emplace_back();
  own.detector = found.front().detector;
  own.images = found.front().images_with_board();
  for (const base::BoardImage& image : found.front().images) own.corners += static_cast<int>(image.corners.size());
  own.rms_px = used.rms_px;
  for (const base::CalibratedCamera& camera : used.cameras) own.focal_px.push_back(camera.camera.focal_px().x());
  if (used.rig) own.baseline_mm = used.rig->baseline_mm;
  own.used = true;
  const calib::BoardViews views{task.board.board, task.cameras, found.front().images};
  const auto compare = [&](const std::string& detector, const std::vector<base::BoardImage>& images) {
    trials.push_back(calib::compare_corners(detector, {task.board.board, task.cameras, images}, views,
                                            used.cameras.front().camera.model(), task.options, session.progress()));
  };
  for (std::size_t i = 1; i < found.size(); ++i) {
    if (found[i].sample) compare(found.front().detector, same_photographs(found.front().images, found[i].images));
    compare(found[i].detector, found[i].images);
  }
  return trials;
}

/// The same corners by mrcal, with a rigid board; where it gives none, why.
base::SecondOpinion opinion_on(const Calibration& calibration) {
  calib::SecondOpinionOptions options;
  const base::LensModel lens = calibration.cameras.front().camera.model();
  options.lens = lens == base::LensModel::kPinhole ? base::LensModel::kOpenCv4 : lens;
  auto opinion = calib::second_opinion(calibration, options);
  if (opinion) return *std::move(opinion);
  base::SecondOpinion none;
  none.program = "mrcal";
  none.failure = opinion.error().message;
  return none;
}

/// What the covariance says over the images, of the pairs, and against an earlier calibration.
Result<base::CalibrationQuality> quality_of(const CalibrationTask& task, const std::optional<Calibration>& previous,
                                            const Calibration& calibration) {
  const double distance_mm = task.distance_mm.value_or(calib::working_distance_mm(calibration));
  auto maps = calib::calibration_maps(calibration, distance_mm);
  if (!maps) return base::fail(std::move(maps));
  base::CalibrationQuality quality{*std::move(maps), calib::epipolar_pairs(calibration), {}};
  if (!previous) return quality;
  quality.change = calib::calibration_change(*previous, calibration, distance_mm);
  quality.change->previous = task.previous->generic_string();
  if (!quality.change->cameras.empty()) return quality;
  return base::fail(base::ErrorCode::kBadInput,
                    fmt::format("{}: this calibration knows none of the cameras; with it nothing can be compared",
                                base::shown(*task.previous)));
}

Result<Calibration> calibration_of(const CalibrationTask& task, const std::vector<FoundCorners>& found, Session& session) {
  calib::CalibrateOptions options = task.options;
  options.threads = session.threads();
  auto calibration = calib::calibrate({task.board.board, task.cameras, found.front().images}, options, session.progress());
  if (!calibration) return calibration;
  for (base::CalibratedCamera& camera : calibration->cameras) {
    const auto temperature = task.temperatures_c.find(camera.name);
    if (temperature != task.temperatures_c.end()) camera.temperature_c = temperature->second;
  }
  calibration->second_opinion = opinion_on(*calibration);
  calibration->detectors = detector_trials(task, found, *calibration, session);
  const std::vector<base::Warning> own = warnings_of(task);
  calibration->warnings.insert(calibration->warnings.end(), own.begin(), own.end());
  return calibration;
}

Result<> write_files(const fs::path& folder, const Calibration& calibration, const base::CalibrationQuality& quality,
                     const FoundCorners& corners) {
  for (const base::CalibratedCamera& camera : calibration.cameras) {
    if (auto written = base::write_cameramodel(folder / (camera.name + ".cameramodel"), camera.camera); !written)
      return written;
  }
  if (auto written = base::write_covariance(folder, {calibration.covariance, calibration.labels}); !written) return written;
  if (auto written = report::write_map_tables(folder, calibration, *quality.maps); !written) return written;
  return report::write_calibration_tables(folder, calibration, corners.images);
}

std::string summary(const Calibration& calibration) {
  std::string text =
      fmt::format("{} images of {} camera{}, {}", calibration.views.size(), calibration.cameras.size(),
                  calibration.cameras.size() == 1 ? "" : "s", lens_word(calibration.cameras.front().camera.model()));
  text += fmt::format(", rms {:.3f} px", calibration.rms_px);
  double heldout = 0.0;
  for (const auto& camera : calibration.cameras) heldout = std::max(heldout, camera.rms_heldout_px);
  if (heldout > 0.0) text += fmt::format(" (held out {:.3f} px)", heldout);
  if (calibration.rig)
    text += fmt::format(", baseline {:.3f} +- {:.3f} mm", calibration.rig->baseline_mm, calibration.rig->baseline_sigma_mm);
  return text + fmt::format(", {} rejected, {} warnings", calibration.rejected.size(), calibration.warnings.size());
}

}  // namespace

Result<StepOutcome> calibrate_step(const CalibrationTask& task, const fs::path& out, Session& session) {
  const ordered_json options = effective_options(task);
  auto inputs = inputs_of(task);
  if (!inputs) return base::fail(std::move(inputs));
  const ordered_json earlier = earlier_result(out, options);
  if (same_inputs(earlier, *inputs)) return StepOutcome{out, "up to date", true, outcome_of(earlier)};

  std::optional<Calibration> previous;
  if (task.previous) {
    auto read = base::read_calibration(*task.previous);
    if (!read) return base::fail(std::move(read));
    previous = *std::move(read);
  }
  auto folder = ResultFolder::begin(out);
  if (!folder) return base::fail(std::move(folder));
  const auto found = find_board(task, session);
  if (!found) return tl::unexpected(found.error());
  const auto calibration = calibration_of(task, *found, session);
  if (!calibration) return tl::unexpected(calibration.error());
  const auto quality = quality_of(task, previous, *calibration);
  if (!quality) return tl::unexpected(quality.error());

  base::ResultEnvelope envelope{"calibrate", "rig", std::move(*inputs), judge(*calibration, task.limits),
                                calibration->warnings};
  if (quality->change) {
    const std::vector<base::Verdict> changed = judge(*quality->change, task.limits);
    envelope.verdicts.insert(envelope.verdicts.end(), changed.begin(), changed.end());
  }
  if (auto written = write_files(folder->path(), *calibration, *quality, found->front()); !written)
    return base::fail(std::move(written));
  const std::string html = report::calibration_report(
      *calibration, *quality, {"Camera calibration", task.title, envelope, options.dump(2), overview_of(out, session)});
  ordered_json body = base::calibration_json(*calibration);
  body.update(base::calibration_quality_json(*quality, task.cameras));
  const ordered_json result = base::result_json(envelope, options, body);
  if (auto published = publish(*folder, html, result); !published) return base::fail(std::move(published));
  return StepOutcome{out, summary(*calibration), false, outcome_of(envelope.verdicts)};
}

}  // namespace crosstie::app
