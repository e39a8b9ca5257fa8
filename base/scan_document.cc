// scan summary -> JSON (docs/formats.md)

#include <nlohmann/json.hpp>

#include "base/detail/result_json.h"
#include "base/result_document.h"
#include "base/scan_summary.h"

namespace crosstie::base {
namespace {

using detail::Json;

Json camera_json(const ScannedCamera& camera) {
  const auto count = [&](PhaseStatus status) { return camera.counts[static_cast<std::size_t>(status)]; };
  return {{"name", camera.name},
          {"valid", count(PhaseStatus::kValid)},
          {"dark", count(PhaseStatus::kDark)},
          {"saturated", count(PhaseStatus::kSaturated)},
          {"undecided", count(PhaseStatus::kUndecided)},
          {"disturbed", count(PhaseStatus::kDisturbed)},
          {"noise", {{"read", camera.noise.read}, {"shot", camera.noise.shot}, {"given", camera.noise_given}}},
          {"light", camera.light},
          {"modulation", camera.modulation},
          {"sigma_phase_rad", camera.sigma_phase_rad},
          {"residual_ratio", camera.residual_ratio},
          {"ripple_rad", camera.ripple_rad},
          {"word_agreement", camera.word_agreement},
          {"repaired", camera.repaired}};
}

}  // namespace

Json scan_json(const ScanSummary& scan) {
  Json json = {{"points", scan.points}};
  json["masked"] = {{"guarded", scan.guarded},
                    {"unmatched", scan.unmatched},
                    {"off_curve", scan.off_curve},
                    {"grazing", scan.grazing},
                    {"off_surface", scan.off_surface}};
  json["sigma_phase_rad"] = {scan.cameras[0].sigma_phase_rad, scan.cameras[1].sigma_phase_rad};
  json["epipolar_median_px"] = nullptr;
  json["epipolar_mad_px"] = nullptr;
  if (scan.epipolar_median_px) {
    json["epipolar_median_px"] = *scan.epipolar_median_px;
    json["epipolar_mad_px"] = scan.epipolar_mad_px;
  }
  json["sigma_mm"] = scan.sigma_mm;
  json["sigma_p95_mm"] = scan.sigma_p95_mm;
  json["calibration_mm"] = nullptr;
  if (scan.calibration_mm) json["calibration_mm"] = *scan.calibration_mm;
  json["depth_mm"] = {scan.depth_min_mm, scan.depth_max_mm};
  json["correlation_length_mm"] = scan.correlation_length_mm;
  json["cameras"] = {camera_json(scan.cameras[0]), camera_json(scan.cameras[1])};
  return json;
}

}  // namespace crosstie::base
