#pragma once

#include <string>
#include <string_view>

namespace crosstie::base {

/// The hash of an inline style or script as a content security policy names it: 'sha256-...' with its quotes
/// (CSP level 3, section 2.3.1).
std::string csp_hash(std::string_view content);

}  // namespace crosstie::base
