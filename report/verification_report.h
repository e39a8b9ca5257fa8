#pragma once

#include <string>

#include "base/verification.h"
#include "report/context.h"

namespace crosstie::report {

/// One self-contained HTML page on a comparison with reference points: verdicts, the fit and its degrees of freedom, deviations
/// per axis after the fit and untransformed, normalised deviations, length errors against the maximum permissible error, a
/// deviation map and a 3D view. It opens offline, asks for no other file and holds no date: the same input gives the same
/// bytes.
std::string verification_report(const base::Verification& verification, const ReportContext& context);

}  // namespace crosstie::report
