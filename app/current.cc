#include "app/current.h"

#include <nlohmann/json.hpp>

#include "base/file.h"
#include "base/json_file.h"
#include "base/version.h"

namespace crosstie::app {

using base::Result;
using nlohmann::ordered_json;

Result<base::ResultInput> hashed_input(const std::filesystem::path& path, const std::filesystem::path& folder) {
  auto hash = base::sha256_of_file(path);
  if (!hash) return base::fail(std::move(hash));
  std::error_code ignored;
  std::filesystem::path relative = std::filesystem::proximate(path, folder, ignored);
  return base::ResultInput{(ignored ? path : relative).generic_string(), std::move(*hash)};
}

Result<std::vector<base::ResultInput>> hashed_inputs(const std::vector<std::filesystem::path>& paths,
                                                     const std::filesystem::path& folder) {
  std::vector<base::ResultInput> inputs;
  for (const std::filesystem::path& path : paths) {
    auto input = hashed_input(path, folder);
    if (!input) return base::fail(std::move(input));
    inputs.push_back(*std::move(input));
  }
  return inputs;
}

ordered_json earlier_result(const std::filesystem::path& folder, const ordered_json& options) {
  ResultFolder::clear_leftovers(folder);
  const auto result = base::read_json(folder / "result.json");
  if (!result || !result->is_object()) return nullptr;
  if (result->value("format", ordered_json()) != "crosstie-result/1") return nullptr;
  const auto version = result->find("version");
  const auto made_with = result->find("options");
  if (version == result->end() || made_with == result->end()) return nullptr;
  if (*version != base::version() || *made_with != options) return nullptr;
  return *result;
}

Outcome outcome_of(const ordered_json& result) {
  if (!result.is_object() || !result.contains("verdicts")) return Outcome::kOk;
  for (const ordered_json& verdict : result["verdicts"]) {
    if (verdict.is_object() && verdict.value("level", "") == base::verdict_level_name(base::VerdictLevel::kFail))
      return Outcome::kVerdictFailed;
  }
  return Outcome::kOk;
}

bool same_inputs(const ordered_json& result, const std::vector<base::ResultInput>& inputs) {
  if (!result.is_object() || !result.contains("inputs") || !result["inputs"].is_array()) return false;
  const ordered_json& recorded = result["inputs"];
  if (recorded.size() != inputs.size()) return false;
  for (std::size_t i = 0; i < inputs.size(); ++i) {
    if (!recorded[i].is_object() || recorded[i].value("path", "") != inputs[i].path ||
        recorded[i].value("sha256", "") != inputs[i].sha256) {
      return false;
    }
  }
  return true;
}

namespace {

/// With the same spelling for the same folder, without a slash at its end.
std::filesystem::path plain_path(const std::filesystem::path& path) {
  std::error_code none;
  const std::filesystem::path whole = std::filesystem::absolute(path, none).lexically_normal();
  return whole.has_filename() ? whole : whole.parent_path();
}

}  // namespace

std::string overview_of(const std::filesystem::path& out, const Session& session) {
  std::filesystem::path folder = plain_path(out);
  const std::filesystem::path job_results =
      session.job_results().empty() ? std::filesystem::path() : plain_path(session.job_results());
  std::string way;
  for (int level = 0; level < 2; ++level) {  // a station's scan stands one deeper
    folder = folder.parent_path();
    way += "../";
    std::error_code none;
    const bool of_job = folder.filename() == "results" && std::filesystem::exists(folder.parent_path() / "job.toml", none);
    if (of_job || folder == job_results) return way + "index.html";
  }
  return {};
}

Result<> publish(ResultFolder& folder, const std::string& html, const ordered_json& result) {
  if (auto written = base::write_file_atomically(folder.path() / "report.html", html); !written) return written;
  if (auto written = base::write_json(folder.path() / "result.json", result); !written) return written;
  return folder.commit();
}

}  // namespace crosstie::app
