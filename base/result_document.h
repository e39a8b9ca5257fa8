#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "base/calibration.h"
#include "base/machine.h"
#include "base/network.h"
#include "base/observation.h"
#include "base/result.h"
#include "base/verdict.h"
#include "base/verification.h"

namespace crosstie::base {

struct ScanSummary;

/// A file that a result was computed from.
struct ResultInput {
  std::string path;  ///< relative to the job's folder
  std::string sha256;
};

/// What every result.json holds besides the body of its verb (docs/formats.md).
struct ResultEnvelope {
  std::string verb;
  std::string frame;
  std::vector<ResultInput> inputs;  ///< sorted by path
  std::vector<Verdict> verdicts;
  std::vector<Warning> warnings;
};

/// The keys that all results share, then those of `body`; `options` are the effective ones.
nlohmann::ordered_json result_json(const ResultEnvelope& envelope, const nlohmann::ordered_json& options,
                                   const nlohmann::ordered_json& body);

/// The body of `detect`: images, their counts and exposure. `with_millis` false writes null, so that results compare bytewise.
nlohmann::ordered_json detection_json(const std::vector<ImageObservations>& images, bool with_millis);
/// The body of `adjust`.
nlohmann::ordered_json network_json(const AdjustedNetwork& network);
/// The body of `calibrate`.
nlohmann::ordered_json calibration_json(const Calibration& calibration);
/// The body of `commission`.
nlohmann::ordered_json commissioning_json(const Commissioning& commissioning);
/// The body of `commission --check`.
nlohmann::ordered_json head_check_json(const HeadCheck& check);
/// The body of `verify`.
nlohmann::ordered_json verification_json(const Verification& verification);

/// The body of `scan`.
nlohmann::ordered_json scan_json(const ScanSummary& scan);

/// Points with covariances back from an `adjust` result.
Result<PointList> points_from_network_json(const std::filesystem::path& result_json);

/// residuals.csv: image,id,x_px,y_px,residual_x_px,residual_y_px,sigma_x_px,sigma_y_px,redundancy_x,redundancy_y,w of every
/// observation that took part.
Result<> write_residuals(const std::filesystem::path& path, const AdjustedNetwork& network);

/// observations.csv: image,family,id,x_px,y_px,cov_xx,cov_xy,cov_yy,a_px,b_px,angle_rad,margin,status; id -1 where there is
/// none.
Result<> write_observations(const std::filesystem::path& path, const std::vector<ImageObservations>& images);
/// Reads it back, images in the order of their first rows; camera, size and exposure are not in the table and stay empty, and
/// an image without observations does not appear.
Result<std::vector<ImageObservations>> read_observations(const std::filesystem::path& path);

}  // namespace crosstie::base
