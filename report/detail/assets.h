#pragma once

#include <string_view>

namespace crosstie::report::detail {

/// Files of report/assets and report/viewer/dist, put into the library at build time (crosstie_embed).
std::string_view page_css();
std::string_view page_js();
std::string_view viewer_js();

}  // namespace crosstie::report::detail
