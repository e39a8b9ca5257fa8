#pragma once

#include <string>

#include "base/machine.h"
#include "report/context.h"

namespace crosstie::report {

/// One HTML page on a check of the head by one pair of photographs: what it says, each test with its value, sigma and p, and what
/// changed. `verdict` is the sentence for the operator.
std::string head_check_report(const base::HeadCheck& check, const std::string& verdict, const ReportContext& context);

}  // namespace crosstie::report
