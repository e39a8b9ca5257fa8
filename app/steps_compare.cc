// two camera models -> their difference

#include "app/steps_compare.h"

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "app/current.h"
#include "app/result_folder.h"
#include "base/result_document.h"
#include "report/model_comparison_report.h"

namespace crosstie::app {
namespace {

namespace fs = std::filesystem;
using base::ModelComparison;
using base::Result;
using nlohmann::ordered_json;

ordered_json effective_options(const math::ProjectionDifferenceOptions& options) {
  return {{"distance_mm", options.distance_mm},
          {"columns", options.columns},
          {"radius_px", options.radius_px},
          {"significance", options.significance}};
}

}  // namespace

Result<ModelComparison> compare_models(const ComparisonTask& task) {
  auto difference = math::projection_difference(task.a.camera, task.b.camera, task.options);
  if (!difference) {
    return base::fail(difference.error().code, fmt::format("{} and {}: {}", task.a.file.generic_string(),
                                                           task.b.file.generic_string(), difference.error().message));
  }
  return ModelComparison{
      {task.a.file.generic_string(), task.a.camera}, {task.b.file.generic_string(), task.b.camera}, *std::move(difference)};
}

Outcome outcome_of(const ModelComparison& comparison) {
  const auto& test = comparison.difference.test;
  return test && test->exceeded() ? Outcome::kVerdictFailed : Outcome::kOk;
}

Result<Outcome> write_comparison(const ComparisonTask& task, const ModelComparison& comparison, const fs::path& out) {
  auto inputs = hashed_inputs({task.a.file, task.b.file}, task.base_folder);
  if (!inputs) return base::fail(std::move(inputs));
  base::ResultEnvelope envelope{"compare", "camera", *std::move(inputs), {}, {}};
  if (const auto& test = comparison.difference.test) {
    envelope.verdicts.push_back({"difference of the models", comparison.difference.rms_px, test->limit_px, "px",
                                 fmt::format("the covariances of both models, level {}", test->level),
                                 test->exceeded() ? base::VerdictLevel::kFail : base::VerdictLevel::kOk});
  }
  const ordered_json options = effective_options(task.options);
  auto folder = ResultFolder::begin(out);
  if (!folder) return base::fail(std::move(folder));
  if (auto written = report::write_difference_table(folder->path() / "difference.csv", comparison.difference); !written)
    return base::fail(std::move(written));
  const std::string html =
      report::model_comparison_report(comparison, {"Comparison of camera models", "", envelope, options.dump(2)});
  const ordered_json result = base::result_json(envelope, options, base::model_comparison_json(comparison));
  if (auto published = publish(*folder, html, result); !published) return base::fail(std::move(published));
  return outcome_of(comparison);
}

}  // namespace crosstie::app
