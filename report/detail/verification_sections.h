#pragma once

#include <string>
#include <vector>

#include "base/verification.h"
#include "report/detail/page.h"

namespace crosstie::report::detail {

/// The parts of the verification report; each returns finished markup.
std::vector<KeyFigure> verification_key_figures(const base::Verification& verification);
std::string verification_fit_section(const base::Verification& verification);
std::string verification_plan_section(const base::Verification& verification);
std::string verification_statistics_section(const base::Verification& verification);
std::string verification_points_section(const base::Verification& verification);
std::string verification_lengths_section(const base::Verification& verification);
std::string verification_position_section(const base::Verification& verification);
std::string verification_partners_section(const base::Verification& verification);

/// Magnification at which the deviations can be seen.
double deviation_magnification(const base::Verification& verification);

}  // namespace crosstie::report::detail
