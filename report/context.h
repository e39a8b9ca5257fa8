#pragma once

#include <string>

#include "base/result_document.h"

namespace crosstie::report {

/// What a report says besides the result itself. All strings are plain UTF-8 text; the reports escape them.
struct ReportContext {
  std::string title;              ///< heading of the page: "Bundle adjustment"
  std::string job;                ///< the job's name; may be empty
  base::ResultEnvelope envelope;  ///< verdicts, inputs with their hashes, warnings of the verb
  std::string options_json;       ///< the effective options, as JSON text; may be empty
  std::string overview = {};      ///< from the report to the overview of its job, "../index.html"; empty: it stands in none
};

}  // namespace crosstie::report
