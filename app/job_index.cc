#include "app/job_index.h"

#include <string>
#include <system_error>
#include <vector>

#include <fmt/format.h>

#include "app/job_steps.h"
#include "base/certificate.h"
#include "base/envelope_reader.h"
#include "base/file.h"
#include "report/job_report.h"

namespace crosstie::app {
namespace {

namespace fs = std::filesystem;
using base::Result;

/// A page that says the same is left alone: a job that is up to date may lie where nobody writes.
Result<> write_if_other(const fs::path& path, const std::string& page) {
  const auto present = base::read_file(path);
  if (present && *present == page) return {};
  return base::write_file_atomically(path, page);
}

}  // namespace

Result<> write_job_index(const Job& job, const fs::path& results) {
  report::JobOverview overview{
      .job = job.name, .date = job.date ? base::format_date(*job.date) : std::string(), .results = {}, .not_done = {}};
  for (const JobStep* step : steps_of(job)) {
    for (const WantedResult& one : results_of(*step, job)) {
      std::error_code none;
      if (!fs::exists(results / one.folder / "result.json", none)) {
        overview.not_done.push_back(one.name);
        continue;
      }
      auto envelope = base::read_envelope(results / one.folder);
      if (!envelope) return base::fail(std::move(envelope));
      const fs::path page = one.folder / "report.html";
      overview.results.push_back({.name = one.name,
                                  .page = fs::exists(results / page, none) ? page.generic_string() : std::string(),
                                  .envelope = *std::move(envelope)});
    }
  }
  if (overview.results.empty()) return {};
  return write_if_other(results / "index.html", report::job_report(overview));
}

Result<Outcome> with_index(const Job& job, Result<Outcome> ended) {
  if (!ended) return ended;
  if (auto written = write_job_index(job, job.folder / "results"); !written) return base::fail(std::move(written));
  return ended;
}

}  // namespace crosstie::app
