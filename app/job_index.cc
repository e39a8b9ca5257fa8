#include "app/job_index.h"

#include <algorithm>
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

/// The folders of a step's results: its own, or one for each station.
std::vector<fs::path> folders_of(const fs::path& folder) {
  std::error_code none;
  if (fs::exists(folder / "result.json", none)) return {folder};
  std::vector<fs::path> folders;
  for (fs::directory_iterator entry(folder, none), end; !none && entry != end; entry.increment(none)) {
    if (fs::exists(entry->path() / "result.json", none)) folders.push_back(entry->path());
  }
  std::sort(folders.begin(), folders.end());
  return folders;
}

}  // namespace

Result<> write_job_index(const Job& job, const fs::path& results) {
  report::JobOverview overview{
      .job = job.name, .date = job.date ? base::format_date(*job.date) : std::string(), .results = {}, .not_done = {}};
  for (const JobStep* step : steps_of(job)) {
    const std::vector<fs::path> folders = folders_of(results / step->folder);
    if (folders.empty()) overview.not_done.emplace_back(step->name);
    for (const fs::path& folder : folders) {
      auto envelope = base::read_envelope(folder);
      if (!envelope) return base::fail(std::move(envelope));
      const bool of_station = folder != results / step->folder;
      std::error_code none;
      const bool has_page = fs::exists(folder / "report.html", none);
      overview.results.push_back(
          {.name = of_station ? fmt::format("{} {}", step->name, folder.filename().string()) : std::string(step->name),
           .page = has_page ? (folder.lexically_relative(results) / "report.html").generic_string() : std::string(),
           .envelope = *std::move(envelope)});
    }
  }
  if (overview.results.empty()) return {};
  return base::write_file_atomically(results / "index.html", report::job_report(overview));
}

Result<Outcome> with_index(const Job& job, Result<Outcome> ended) {
  if (!ended) return ended;
  if (auto written = write_job_index(job, job.folder / "results"); !written) return base::fail(std::move(written));
  return ended;
}

}  // namespace crosstie::app
