#include "app/job_graph.h"

#include <algorithm>

#include <fmt/core.h>

#include "base/version.h"

namespace crosstie::app {
namespace {

namespace fs = std::filesystem;
using base::Result;

/// As a string of the Snakefile's language; braces are wildcards there.
std::string quoted(const std::string& text) {
  std::string result = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') result += '\\';
    result += c;
    if (c == '{' || c == '}') result += c;
  }
  return result + "\"";
}

std::string stamp(const JobStep& step) { return fmt::format("results/{}.done", step.folder); }

}  // namespace

Result<std::string> snakefile(const Job& job, const std::vector<const JobStep*>& steps) {
  std::string text =
      fmt::format("# The steps of the job \"{}\", made by crosstie {}. Run it in the job folder: snakemake --cores all\n",
                  job.name, base::version());
  text += "rule all:\n    input:\n";
  for (const JobStep* step : steps) text += fmt::format("        {},\n", quoted(stamp(*step)));
  for (const JobStep* step : steps) {
    if (auto complete = step->check(job); !complete) return base::fail(std::move(complete));
    auto files = step->files(job);
    if (!files) return base::fail(std::move(files));
    std::vector<std::string> inputs{job.file.filename().string()};
    for (const fs::path& file : *files) {
      std::error_code ignored;
      const fs::path relative = fs::proximate(file, job.folder, ignored);
      inputs.push_back((ignored ? file : relative).generic_string());
    }
    std::sort(inputs.begin() + 1, inputs.end());
    for (const std::string_view name : step->needs(job)) {
      const auto needed = std::find_if(steps.begin(), steps.end(), [&](const JobStep* other) { return other->name == name; });
      if (needed != steps.end()) inputs.push_back(stamp(**needed));
    }
    text += fmt::format("\nrule {}:\n    input:\n", step->name);
    for (const std::string& input : inputs) text += fmt::format("        {},\n", quoted(input));
    text += fmt::format("    output: touch({})\n", quoted(stamp(*step)));
    text += fmt::format("    shell: {}\n",
                        quoted(fmt::format("crosstie run {} --to {} || [ $? -eq 1 ]", inputs.front(), step->name)));
  }
  return text;
}

}  // namespace crosstie::app
