#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "app/job.h"
#include "app/live/live_status.h"

namespace crosstie::app {

/// What the results of a job say that the operator sees. A result that is missing or damaged is not there: to compute it again is what
/// helps in either case.
struct JobFacts {
  struct Epipolar {
    double px = 0.0;  ///< rms distance of both cameras' images of the same from the epipolar curves
    double sigma_px = 0.0;
  };
  struct Result {
    std::string summary;  ///< its checks in words
    std::string report;   ///< its page in the job's folder; empty: it has none
    std::vector<base::Verdict> verdicts;
  };
  std::map<LiveStage, Result> results;      ///< of the stages that are done
  std::map<std::string, Epipolar> scanned;  ///< stations whose cloud is there
  std::optional<GapStatus> gaps;            ///< of the hole's edge
  HealthStatus health;                      ///< of the latest check of the head

  [[nodiscard]] bool done(LiveStage stage) const { return results.contains(stage); }
};

JobFacts read_job_facts(const Job& job, const std::filesystem::path& results);

}  // namespace crosstie::app
