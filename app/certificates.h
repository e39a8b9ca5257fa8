#pragma once

#include <chrono>
#include <optional>
#include <string_view>
#include <vector>

#include "base/certificate.h"
#include "base/result.h"

namespace crosstie::app {

/// Warns where the certificate of `what` ("the board") had ended on the day of the measurement, was issued after it, or cannot be
/// judged because the job has no date. The job's date counts and not the clock: results do not depend on when they are computed.
void check_certificate(const base::Certificate& certificate, std::string_view what,
                       const std::optional<std::chrono::year_month_day>& date, std::vector<base::Warning>& warnings);

}  // namespace crosstie::app
