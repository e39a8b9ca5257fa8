#pragma once

#include <filesystem>
#include <string>

#include "base/acceptance.h"
#include "base/repeatability.h"
#include "base/result.h"
#include "report/context.h"

namespace crosstie::report {

/// One self-contained HTML page on an acceptance test: each characteristic against its limit, all positions with their uncertainties, and the
/// deviations over cap or plate with a fixed legend.
std::string acceptance_report(const base::Acceptance& acceptance, const ReportContext& context);

/// acceptance.csv: position,artefact,sphere,characteristic,value_mm,sigma_mm,noise_sigma_mm,artefact_sigma_mm; and form.csv: position,sphere,
/// u_mm,v_mm,deviation_mm of every point that counted.
base::Result<> write_acceptance_tables(const std::filesystem::path& folder, const base::Acceptance& acceptance);

/// One self-contained HTML page on repeated results: scatter against predicted sigma, of each group and each quantity.
std::string repeatability_report(const base::Repeatability& repeatability, const ReportContext& context);

/// repeatability.csv: group,quantity,mean_mm,sd_mm,sd_low_mm,sd_high_mm,predicted_mm,ratio,p.
base::Result<> write_repeatability_tables(const std::filesystem::path& folder, const base::Repeatability& repeatability);

}  // namespace crosstie::report
