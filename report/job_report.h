#pragma once

#include <string>
#include <vector>

#include "base/result_document.h"

namespace crosstie::report {

/// One result of a job, as its own result.json has it.
struct JobResult {
  std::string name;  ///< of the step, with the station where there are several: "scan x0500"
  std::string page;  ///< where its report stands, seen from the overview; empty: it has none
  base::ResultEnvelope envelope;
};

/// All results of a job, in the order of the work.
struct JobOverview {
  std::string job;   ///< its name
  std::string date;  ///< of the measurement; may be empty
  std::vector<JobResult> results;
  std::vector<std::string> not_done;  ///< names of those that the job asks for and that are not there
};

/// One HTML page on a whole job: whether all of it keeps its limits, each step with the worst of its verdicts and a link to its report, then all
/// verdicts and warnings by step. The same input gives the same bytes.
std::string job_report(const JobOverview& overview);

}  // namespace crosstie::report
