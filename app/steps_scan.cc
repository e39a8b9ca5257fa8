// fringe images of two cameras -> cloud with a sigma for each point

#include "app/steps_scan.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include <fmt/core.h>
#include <nlohmann/json.hpp>

#include "app/current.h"
#include "app/head_files.h"
#include "app/result_folder.h"
#include "base/depth_image.h"
#include "base/image.h"
#include "base/parallel.h"
#include "base/pattern_sequence.h"
#include "base/ply.h"
#include "base/result_document.h"
#include "base/scan_summary.h"
#include "report/scan_report.h"

namespace crosstie::app {
namespace {

namespace fs = std::filesystem;
using base::ErrorCode;
using base::PhaseMap;
using base::Result;
using nlohmann::ordered_json;

constexpr double kEpipolarLimit_px = 0.25;  // a well calibrated head keeps within a few hundredths; warm-up moves it by tenths

ordered_json effective_options(const ScanTask& task) {
  ordered_json options = {
      {"head", task.head},
      {"max_phase_sigma_rad", task.decode.max_phase_sigma_rad},
      {"min_modulation", task.decode.min_modulation},
      {"max_residual_ratio", task.decode.max_residual_ratio},
      {"min_word_agreement", task.decode.min_word_agreement},
      {"correct_ripple", task.decode.correct_ripple},
      {"min_depth_mm", task.match.min_depth_mm},
      {"max_depth_mm", task.match.max_depth_mm},
      {"min_slope", task.match.min_slope},
      {"max_epipolar_sigmas", task.match.max_epipolar_sigmas},
      {"max_epipolar_px", task.match.max_epipolar_px},
      {"guard_px", task.match.guard_px},
      {"max_grazing_rad", task.cloud.max_grazing_rad},
      {"max_surface_sigmas", task.cloud.max_surface_sigmas},
      {"filter_radius_px", task.cloud.filter_radius_px},
      {"write_covariance", task.write_covariance},
  };
  if (task.decode.noise) options["noise"] = {task.decode.noise->read, task.decode.noise->shot};
  return options;
}

fs::path image_path(const ScanTask& task, const base::Pattern& pattern, std::size_t camera) {
  return (camera == 0 ? task.left : task.right) / pattern.files[camera];
}

Result<std::vector<base::ResultInput>> inputs_of(const ScanTask& task, const base::PatternSequence& sequence,
                                                 const std::vector<fs::path>& head_files) {
  std::vector<fs::path> paths = head_files;
  paths.push_back(task.manifest);
  for (const base::Pattern& pattern : sequence.patterns) {
    for (std::size_t camera = 0; camera < 2; ++camera) paths.push_back(image_path(task, pattern, camera));
  }
  std::vector<base::ResultInput> inputs;
  for (const fs::path& path : paths) {
    auto input = hashed_input(path, task.base_folder);
    if (!input) return base::fail(std::move(input));
    inputs.push_back(*std::move(input));
  }
  std::sort(inputs.begin(), inputs.end(), [](const auto& a, const auto& b) { return a.path < b.path; });
  inputs.erase(std::unique(inputs.begin(), inputs.end(), [](const auto& a, const auto& b) { return a.path == b.path; }),
               inputs.end());
  return inputs;
}

/// One camera's images, one after the other.
Result<PhaseMap> decode_camera(const ScanTask& task, const base::PatternSequence& sequence, std::size_t camera,
                               const base::Progress& progress) {
  std::optional<scan::Decoder> decoder;
  for (std::size_t i = 0; i < sequence.patterns.size(); ++i) {
    if (progress.cancelled()) return base::cancelled("scan");
    const fs::path path = image_path(task, sequence.patterns[i], camera);
    auto image = base::read_image(path);
    if (!image) return base::fail(std::move(image));
    if (!decoder) {
      auto made = scan::Decoder::make(sequence, image->width(), image->height(), task.decode);
      if (!made) return base::fail(std::move(made));
      decoder.emplace(*std::move(made));
    }
    if (auto added = decoder->add(static_cast<int>(i), *std::move(image)); !added)
      return base::fail(added.error().code, fmt::format("{}: {}", path.string(), added.error().message));
  }
  auto map = decoder->finish(progress);
  if (!map && map.error().code == ErrorCode::kBadInput)
    return base::fail(ErrorCode::kBadInput,
                      fmt::format("{}: {}", (camera == 0 ? task.left : task.right).string(), map.error().message));
  return map;
}

double quantile(std::vector<double> values, double share) {
  if (values.empty()) return 0.0;
  const auto at = static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), values.begin() + at, values.end());
  return values[static_cast<std::size_t>(at)];
}

base::ScannedCamera describe(const std::string& name, const PhaseMap& map) {
  constexpr std::size_t kEvery = 11;
  base::ScannedCamera camera;
  camera.name = name;
  camera.counts = map.counts;
  camera.noise = map.noise;
  camera.noise_given = map.noise_given;
  camera.residual_ratio = map.residual_ratio;
  const base::PhasePlane& plane = map.x ? *map.x : *map.y;
  std::vector<double> light, modulation, sigma;
  for (std::size_t i = 0; i < map.status.size(); i += kEvery) {
    if (map.status[i] != base::PhaseStatus::kValid) continue;
    light.push_back(map.light[i]);
    modulation.push_back(plane.modulation[i]);
    sigma.push_back(2.0 * std::numbers::pi * static_cast<double>(plane.sigma_turns[i]));
  }
  camera.light = quantile(std::move(light), 0.5);
  camera.modulation = quantile(std::move(modulation), 0.5);
  camera.sigma_phase_rad = quantile(std::move(sigma), 0.5);
  for (const auto* axis : {&map.x, &map.y}) {
    if (!*axis) continue;
    camera.ripple_rad = std::max(camera.ripple_rad, 2.0 * std::numbers::pi * (*axis)->ripple_turns);
    camera.word_agreement = std::min(camera.word_agreement, (*axis)->word_agreement);
    camera.repaired += (*axis)->repaired;
  }
  return camera;
}

/// Means over cells of the left image.
void fill_cells(const scan::DepthMap& depths, const scan::ScanCloud& cloud, base::ScanSummary& summary) {
  constexpr int kColumns = 48;
  const int cell = std::max(1, depths.width / kColumns);
  const int columns = (depths.width + cell - 1) / cell;
  const int rows = (depths.height + cell - 1) / cell;
  summary.cell_px = cell;
  summary.depth_mm = Eigen::MatrixXd::Zero(rows, columns);
  summary.sigma_cells_mm = Eigen::MatrixXd::Zero(rows, columns);
  Eigen::MatrixXd counts = Eigen::MatrixXd::Zero(rows, columns);
  for (int y = 0; y < depths.height; ++y) {
    for (int x = 0; x < depths.width; ++x) {
      const auto at = static_cast<std::size_t>(y) * static_cast<std::size_t>(depths.width) + static_cast<std::size_t>(x);
      if (std::isnan(cloud.depth_mm[at])) continue;
      summary.depth_mm(y / cell, x / cell) += static_cast<double>(cloud.depth_mm[at]);
      summary.sigma_cells_mm(y / cell, x / cell) += static_cast<double>(depths.sigma_mm[at]);
      counts(y / cell, x / cell) += 1.0;
    }
  }
  summary.depth_mm = summary.depth_mm.cwiseQuotient(counts);  // 0 / 0 is what is wanted: not a number
  summary.sigma_cells_mm = summary.sigma_cells_mm.cwiseQuotient(counts);
}

const std::vector<double>* field(const base::Cloud& cloud, const std::string& name) {
  for (const base::CloudField& candidate : cloud.fields) {
    if (candidate.name == name) return &candidate.values;
  }
  return nullptr;
}

std::vector<base::Warning> warnings_of(const base::ScanSummary& summary) {
  constexpr double kDisturbed = 0.02;
  constexpr double kSaturated = 0.02;
  std::vector<base::Warning> warnings;
  if (!summary.both_axes) {
    warnings.push_back(
        {"calibration_not_tested", "",
         "with one direction of fringes a scan does not test the calibration of the head; show both directions"});
  }
  for (const base::ScannedCamera& camera : summary.cameras) {
    const auto count = [&](base::PhaseStatus status) {
      return static_cast<double>(camera.counts[static_cast<std::size_t>(status)]);
    };
    const double lit =
        count(base::PhaseStatus::kValid) + count(base::PhaseStatus::kDisturbed) + count(base::PhaseStatus::kSaturated);
    if (count(base::PhaseStatus::kDisturbed) > kDisturbed * lit) {
      warnings.push_back(
          {"disturbed", camera.name,
           fmt::format("{:.1f} % of the pixels do not see shifted fringes: did something move, or did other light change?",
                       100.0 * count(base::PhaseStatus::kDisturbed) / lit)});
    }
    if (count(base::PhaseStatus::kSaturated) > kSaturated * lit) {
      warnings.push_back(
          {"saturated", camera.name,
           fmt::format("{:.1f} % of the lit pixels are saturated in too many images; expose less, or take an exposure series",
                       100.0 * count(base::PhaseStatus::kSaturated) / lit)});
    }
  }
  return warnings;
}

base::ScanSummary summarise(const ScanTask& task, const base::Head& head, const std::array<PhaseMap, 2>& maps,
                            const scan::DepthMap& depths, const scan::ScanCloud& cloud) {
  constexpr std::size_t kEvery = 17;
  base::ScanSummary summary;
  summary.name = task.title;
  summary.width = depths.width;
  summary.height = depths.height;
  summary.both_axes = !depths.epipolar_px.empty();
  summary.cameras = {describe(head.left_name, maps[0]), describe(head.right_name, maps[1])};
  summary.points = static_cast<std::int64_t>(cloud.cloud.points.size());
  summary.guarded = depths.guarded;
  summary.unmatched = depths.unmatched;
  summary.off_curve = depths.off_curve;
  summary.grazing = cloud.grazing;
  summary.off_surface = cloud.off_surface;
  const std::vector<double>& sigma = *field(cloud.cloud, "sigma_mm");
  summary.sigma_mm = quantile(sigma, 0.5);
  summary.sigma_p95_mm = quantile(sigma, 0.95);
  if (const auto* calibration = field(cloud.cloud, "calibration_mm")) summary.calibration_mm = quantile(*calibration, 0.5);
  if (summary.both_axes) {
    summary.epipolar_median_px = depths.epipolar_median_px;
    summary.epipolar_mad_px = depths.epipolar_mad_px;
    for (std::size_t i = 0; i < depths.epipolar_px.size(); i += kEvery) {
      if (!std::isnan(depths.epipolar_px[i])) summary.epipolar_px.push_back(static_cast<double>(depths.epipolar_px[i]));
    }
  }
  std::vector<double> depth;
  for (const Eigen::Vector3d& point : cloud.cloud.points) depth.push_back(point.z());
  summary.depth_min_mm = quantile(depth, 0.0);
  summary.depth_max_mm = quantile(std::move(depth), 1.0);
  summary.correlation_length_mm = cloud.correlation_length_mm;
  fill_cells(depths, cloud, summary);
  summary.warnings = warnings_of(summary);
  return summary;
}

/// The noise part: sigma^2 along the ray of each point.
void add_covariance(base::Cloud& cloud) {
  const std::vector<double>& sigma = *field(cloud, "sigma_mm");
  for (std::size_t i = 0; i < cloud.points.size(); ++i) {
    const Eigen::Vector3d ray = cloud.points[i].normalized();
    cloud.cov_mm2.emplace_back(sigma[i] * sigma[i] * ray * ray.transpose());
  }
}

}  // namespace

Result<StepOutcome> scan_step(const ScanTask& task, const fs::path& out, Session& session) {
  const auto sequence = base::read_pattern_manifest(task.manifest);
  if (!sequence) return tl::unexpected(sequence.error());
  if (sequence->patterns.empty()) return base::fail(ErrorCode::kBadInput, fmt::format("{}: no images", task.manifest.string()));
  const auto info = base::read_image_info(image_path(task, sequence->patterns.front(), 0));
  if (!info) return tl::unexpected(info.error());
  const auto head = read_head(task.head, info->width, info->height);
  if (!head) return tl::unexpected(head.error());
  const ordered_json options = effective_options(task);
  const auto inputs = inputs_of(task, *sequence, head->files);
  if (!inputs) return tl::unexpected(inputs.error());
  if (const ordered_json earlier = earlier_result(out, options); same_inputs(earlier, *inputs)) {
    return StepOutcome{out, "up to date", true, outcome_of(earlier)};
  }

  auto folder = ResultFolder::begin(out);
  if (!folder) return base::fail(std::move(folder));
  const base::Progress progress = session.progress();
  std::array<PhaseMap, 2> maps;
  for (std::size_t camera = 0; camera < 2; ++camera) {
    auto map = decode_camera(task, *sequence, camera, progress);
    if (!map) return base::fail(std::move(map));
    maps[camera] = *std::move(map);
  }
  const auto depths = scan::match(maps[0], maps[1], head->head, task.match, progress);
  if (!depths) return tl::unexpected(depths.error());
  auto cloud = scan::make_cloud(*depths, maps[0], head->head, task.cloud, progress);
  if (!cloud) return base::fail(std::move(cloud));
  const base::ScanSummary summary = summarise(task, head->head, maps, *depths, *cloud);

  base::ResultEnvelope envelope{"scan", "rig", *inputs, {}, summary.warnings};
  if (summary.epipolar_median_px) {
    const double off = std::abs(*summary.epipolar_median_px);
    envelope.verdicts.push_back({"epipolar distance", off, kEpipolarLimit_px, "px",
                                 "default: a calibrated head keeps within a few hundredths of a pixel",
                                 base::judge_upper_limit(off, kEpipolarLimit_px, 0.0)});
  }
  const ordered_json result = base::result_json(envelope, options, base::scan_json(summary));
  if (task.write_covariance) add_covariance(cloud->cloud);
  if (auto written = base::write_ply(folder->path() / "cloud.ply", cloud->cloud); !written)
    return base::fail(std::move(written));
  if (auto written = base::write_depth_tiff(folder->path() / "depth.tiff", depths->width, depths->height, cloud->depth_mm);
      !written)
    return base::fail(std::move(written));
  const std::string html = report::scan_report(summary, {"Scan", task.title, envelope, options.dump(2)});
  if (auto published = publish(*folder, html, result); !published) return base::fail(std::move(published));
  return StepOutcome{out, fmt::format("{} points, median sigma {:.4f} mm", summary.points, summary.sigma_mm), false,
                     outcome_of(result)};
}

}  // namespace crosstie::app
