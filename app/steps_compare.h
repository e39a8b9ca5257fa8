#pragma once

#include <filesystem>
#include <optional>

#include "app/camera_choice.h"
#include "app/session.h"
#include "app/verb.h"
#include "base/model_comparison.h"
#include "base/result.h"
#include "math/projection_difference.h"

namespace crosstie::app {

/// Two models of one camera, and how they are to be compared.
struct ComparisonTask {
  ChosenCamera a;
  ChosenCamera b;
  math::ProjectionDifferenceOptions options;
  std::filesystem::path base_folder;  ///< paths in the result are relative to it
};

/// two camera models -> their difference.
base::Result<base::ModelComparison> compare_models(const ComparisonTask& task);

/// Writes result.json, report.html and difference.csv into `out`. The verdict holds the difference against what the covariances of
/// both models predict, where both have one.
base::Result<Outcome> write_comparison(const ComparisonTask& task, const base::ModelComparison& comparison,
                                       const std::filesystem::path& out);

/// kVerdictFailed where the difference is more than predicted.
[[nodiscard]] Outcome outcome_of(const base::ModelComparison& comparison);

}  // namespace crosstie::app
